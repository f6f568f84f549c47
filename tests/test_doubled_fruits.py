"""Fruits that a detector finds twice: one inside the other, as no fruits hang."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from pomona import FruitCloud, PomonaWarning
from pomona.orchard import load_session
from pomona.synth.seasons import SEASONS, draw_season


def hung_apart(rng: np.random.Generator) -> np.ndarray:
    """Two hundred fruits of 6 cm that touch at most, places good to 8 mm."""
    places = np.stack(np.meshgrid(np.arange(20), np.arange(5), np.arange(2)), axis=-1).reshape(-1, 3) * 0.065
    return places + rng.normal(0.0, 0.008, places.shape)


def written(path: Path, places: np.ndarray, rng: np.random.Generator) -> Path:
    FruitCloud(places, diameters_m=0.06 * rng.lognormal(0.0, 0.08, len(places))).write(path)
    return path


def test_fruits_that_were_found_twice_are_told(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    places = hung_apart(rng)
    twice = places[:40] + rng.normal(0.0, 0.008, (40, 3))
    path = written(tmp_path / "visit.csv", np.concatenate([places, twice]), rng)
    with pytest.warns(PomonaWarning, match=r"visit.csv: found \d+ of 240 fruits with the middle of another one inside"):
        load_session(path, date="2026-07-01")


def test_fruits_that_touch_are_not(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    path = written(tmp_path / "visit.csv", hung_apart(rng), rng)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_session(path, date="2026-07-01")


def test_drawn_seasons_are_not(tmp_path: Path) -> None:
    for number, visit in enumerate(draw_season(SEASONS["hard"], 0).visits):
        path = tmp_path / f"{number}.csv"
        visit.cloud.write(path)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            load_session(path, date="2026-07-01")
