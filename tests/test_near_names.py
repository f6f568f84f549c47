"""A column whose name nearly is one that counts is told, and taken as text all the same."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pomona import FruitCloud, PomonaWarning, load_session
from pomona.cloud.near_names import near_names
from pomona.orchard import OrchardMap


def cloud_with(*names: str) -> FruitCloud:
    return FruitCloud(np.eye(3), extras=dict.fromkeys(names, ("1", "2", "3")))


@pytest.mark.parametrize(
    ("name", "known"),
    [
        *((name, "diameter_m") for name in ("diameter_mm", "diameter_cm", "diam_m", "diam_mm", "diam", "dia_mm")),
        *((name, "diameter_m") for name in ("Diameter", "DIAMETER_M", "diameter (mm)", "diamter_m", "diametre_m")),
        *(("ID", "id"), ("N_Views", "n_views"), ("nviews", "n_views"), ("Cxx", "cxx")),
    ],
)
def test_a_name_that_nearly_is_one_that_counts(name: str, known: str) -> None:
    assert list(near_names(cloud_with(name, "note"))) == [(name, known)]


@pytest.mark.parametrize(
    "name",
    [
        *("diameter_sigma_m", "diameter_model_units", "probability", "colour", "state", "tree", "row", "note", "label"),
        *("perimeter_m", "diagnosis", "media", "fruit", "identity", "views", "height_m", "size_mm", "rate_mm_per_day"),
    ],
)
def test_another_name_is_ones_own(name: str) -> None:
    assert list(near_names(cloud_with(name))) == []


def test_beside_the_column_that_counts_it_is_ones_own(full_cloud: FruitCloud) -> None:
    both = replace(full_cloud, extras={"diameter_mm": ("1",) * len(full_cloud)})
    assert list(near_names(both)) == []


@pytest.mark.parametrize("suffix", [".csv", ".ply"])
def test_a_map_takes_it_and_one_line_tells(pomona, here: Path, suffix: str) -> None:
    cloud = FruitCloud.read("map.csv")
    sizes = ("70",) * len(cloud)
    replace(cloud, diameters_m=None, extras={"diameter_mm": sizes}).write(f"visit{suffix}")
    code, printed, told = pomona("map", "add", "new.gpkg", f"visit{suffix}", "--date", "2024-08-01")
    assert (code, printed) == (0, f"visit: starts the map with {len(cloud)} fruits\n")
    said = f"visit{suffix}: found the column 'diameter_mm', which is kept as text; expected diameter_m, in metres,"
    assert told == f"pomona: warning: {said} for it to count\n"
    assert OrchardMap("new.gpkg").fruits().diameters_m is None


def test_nothing_is_told_of_what_is_named_as_it_should_be(here: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", PomonaWarning)
        assert load_session("map.csv", date="2024-08-01").name == "map"
