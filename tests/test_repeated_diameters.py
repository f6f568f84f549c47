"""Diameters that a detector gives to what it could not measure."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from pomona import FruitCloud, PomonaWarning
from pomona.orchard import load_session


def written(path: Path, diameters_m: np.ndarray) -> Path:
    rng = np.random.default_rng(3)
    cloud = FruitCloud(rng.uniform(size=(len(diameters_m), 3)) * [10.0, 1.0, 2.0], diameters_m=diameters_m)
    cloud.write(path)
    return path


def sizes(rng: np.random.Generator) -> np.ndarray:
    return np.asarray(0.06 + 0.006 * rng.normal(size=200))


def test_a_size_that_many_fruits_share_to_the_last_digit_is_told(tmp_path: Path) -> None:
    diameters_m = sizes(np.random.default_rng(1))
    diameters_m[::10] = 0.07
    path = written(tmp_path / "visit.csv", diameters_m)
    with pytest.warns(PomonaWarning, match=r"visit.csv: 20 of 200 diameters are 0.07 m exactly"):
        load_session(path, date="2026-07-01")


@pytest.mark.parametrize("step_m", [0.0, 0.001, 0.005, 0.01])
def test_sizes_that_are_measured_or_rounded_are_not(step_m: float, tmp_path: Path) -> None:
    diameters_m = sizes(np.random.default_rng(2))
    if step_m:
        diameters_m = np.round(diameters_m / step_m) * step_m
    path = written(tmp_path / "visit.csv", diameters_m)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_session(path, date="2026-07-01")
