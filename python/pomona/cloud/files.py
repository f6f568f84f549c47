"""Which reader and writer a cloud's file has, and the unit of its numbers."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import csv_file, ply_file
from pomona.cloud.units import METRES_PER_UNIT, Unit
from pomona.errors import PomonaError, PomonaWarning

if TYPE_CHECKING:
    from pomona.cloud.fruit_cloud import FruitCloud

__all__ = ["PLAUSIBLE_DIAMETER_M", "check_places", "read_cloud", "write_cloud"]

MIN_SPACING_M = 0.005
"""Centres of two fruits cannot be nearer than a fruit is wide, and the smallest berries are 5 mm wide."""

MAX_SPACING_M = 5.0
"""A fruit has a neighbour on its tree, and trees are under 5 m; fruits 6 cm apart are 60 away in mm, 6 in cm."""

FARTHEST_FRUIT_M = 10_000.0
"""From the middle of a visit: nobody films a longer row in one go, and one slip of a digit hides all else."""

PLAUSIBLE_DIAMETER_M = (0.005, 0.4)
"""From the smallest berry to the largest melon: a median outside speaks of a wrong unit."""

MIN_FRUITS = 5
"""Fewer have no median to speak of."""

SPACING_SAMPLE = 1000
"""Fruits asked for their neighbour: the median of 1000 is known to 2 % of rank, whatever the size of the cloud."""


def read_cloud(path: Path, unit: Unit, make: type[FruitCloud]) -> FruitCloud:
    """Read `path` by its suffix; see `FruitCloud.read`, which says what to make of it."""
    if unit not in get_args(Unit):
        raise PomonaError(f"unit: found {unit!r}, expected one of {', '.join(get_args(Unit))}")
    suffix = path.suffix.lower()
    if suffix == ".gpkg":
        from pomona.store.stored_fruits import stored_cloud

        return stored_cloud(path, make, in_metres=unit != "free")
    if suffix not in (".csv", ".ply"):
        raise PomonaError(f"{path}: found suffix {suffix!r}, expected .csv, .ply or .gpkg")
    cloud = csv_file.read(path, make) if suffix == ".csv" else ply_file.read(path, make)
    cloud = _in_metres(cloud, METRES_PER_UNIT[unit])
    if unit != "free":
        check_places(path, cloud.positions)
    return cloud


def write_cloud(path: Path, cloud: FruitCloud) -> None:
    """Write `cloud` to `path` by its suffix; see `FruitCloud.write`."""
    suffix = path.suffix.lower()
    if suffix == ".csv":
        csv_file.write(path, cloud)
    elif suffix == ".ply":
        ply_file.write(path, cloud)
    elif suffix == ".gpkg":
        raise PomonaError(f"{path}: a session has a name and a date, write it with pomona.orchard.write_session")
    else:
        raise PomonaError(f"{path}: found suffix {suffix!r}, expected .csv or .ply")


def check_places(
    name: str | Path,
    positions: NDArray[np.float64],
    *,
    remedy: str = "say so: --unit mm, or FruitCloud.read(path, unit='mm')",
) -> None:
    """Warn when places, (N, 3) metres, cannot be those of fruits: by their neighbours, or one far from all others."""
    if len(positions) < MIN_FRUITS:
        return
    spacing_m = _spacing_m(positions)
    reach_m = np.hypot.reduce(positions - np.median(positions, axis=0), axis=1)  # squares may overflow
    if not MIN_SPACING_M <= spacing_m <= MAX_SPACING_M:
        warnings.warn(
            f"{name}: neighbouring fruits are {spacing_m:.3g} m apart (median), expected {MIN_SPACING_M:g} to "
            f"{MAX_SPACING_M:g} m; if it is not in metres {remedy}",
            PomonaWarning,
            stacklevel=4,
        )
    elif reach_m.max() > FARTHEST_FRUIT_M:
        warnings.warn(
            f"{name}: row {reach_m.argmax()}: found a fruit {reach_m.max():.3g} m from the middle of all, expected at "
            f"most {FARTHEST_FRUIT_M:g} m",
            PomonaWarning,
            stacklevel=4,
        )


def _spacing_m(positions: NDArray[np.float64]) -> float:
    """Return the median distance of a fruit from its next."""
    from scipy.spatial import cKDTree

    sample = positions[:: -(-len(positions) // SPACING_SAMPLE)]
    tree = cKDTree(positions, balanced_tree=False, compact_nodes=False)
    distances_m, _ = tree.query(sample, k=[2])  # the first neighbour is the fruit itself
    return float(np.median(distances_m))


def _in_metres(cloud: FruitCloud, metres: float) -> FruitCloud:
    """Scale positions and covariances; ``diameter_m`` carries its unit in its name and is left alone."""
    if metres == 1.0:
        return cloud
    covariances = None if cloud.covariances is None else cloud.covariances * metres**2
    return replace(cloud, positions=cloud.positions * metres, covariances=covariances)
