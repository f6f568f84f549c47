"""Which reader and writer a cloud's file has, and the unit of its numbers."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import csv_file, ply_file
from pomona.cloud.units import METRES_PER_UNIT, Unit
from pomona.errors import PomonaError, PomonaWarning

if TYPE_CHECKING:
    from pomona.cloud.fruit_cloud import FruitCloud

__all__ = [
    "PLAUSIBLE_DIAMETER_M",
    "check_places",
    "doubt_of_diameters",
    "doubt_of_places",
    "likely_unit",
    "look_at",
    "read_cloud",
    "vouch_for",
    "write_cloud",
]

MIN_SPACING_M = 0.005
"""Centres of two fruits cannot be nearer than a fruit is wide, and the smallest berries are 5 mm wide."""

MAX_SPACING_M = 5.0
"""A fruit has a neighbour on its tree, and trees are under 5 m; fruits 6 cm apart are 60 away in mm, 6 in cm."""

USUAL_SPACING_M = 0.06
"""The unit by which fruits are nearest to so far apart is the likeliest."""

COARSE = 0.5
"""A coordinate in steps of more than this part of the spacing says little of which fruit is which."""

FARTHEST_FRUIT_M = 10_000.0
"""From the middle of a visit: nobody films a longer row in one go, and one slip of a digit hides all else."""

PLAUSIBLE_DIAMETER_M = (0.005, 0.4)
"""From the smallest berry to the largest melon: a median outside speaks of a wrong unit."""

MOST_SPACINGS = 2.0
"""Median distances from a fruit to the next, as which fruits are wide at most: those of solid ones are a diameter."""

MIN_FRUITS = 5
"""Fewer have no median to speak of."""

NAMED: dict[Unit, str] = {"m": "metres", "cm": "centimetres", "mm": "millimetres"}

_looked_at: WeakSet[FruitCloud] = WeakSet()
"""Clouds whose places have been looked at: once is enough."""

SPACING_SAMPLE = 1000
"""Fruits asked for their neighbour: the median of 1000 is known to 2 % of rank, whatever the size of the cloud."""


def read_cloud(path: Path, unit: Unit, make: type[FruitCloud], *, is_checked: bool = True) -> FruitCloud:
    """Read `path` by its suffix; see `FruitCloud.read`, which says what to make of it.

    With `is_checked` places that cannot be those of fruits draw a warning.
    """
    if unit not in get_args(Unit):
        raise PomonaError(f"unit: found {unit!r}, expected one of {', '.join(get_args(Unit))}")
    suffix = path.suffix.lower()
    if suffix == ".gpkg":
        from pomona.store.stored_fruits import stored_cloud

        return stored_cloud(path, make, in_metres=unit != "free")
    if suffix not in (".csv", ".ply"):
        if path.is_dir():
            raise PomonaError(f"{path}: is a folder, expected a .csv, .ply or .gpkg file")
        raise PomonaError(f"{path}: found suffix {suffix!r}, expected .csv, .ply or .gpkg")
    cloud = csv_file.read(path, make) if suffix == ".csv" else ply_file.read(path, make)
    cloud = _in_metres(cloud, METRES_PER_UNIT[unit])
    if unit != "free" and is_checked:
        check_places(path, cloud.positions, unit=unit)
        vouch_for(cloud)
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


@dataclass(frozen=True)
class PlacesDoubt:
    """Why places cannot be those of fruits, and whether another unit would mend it."""

    found: str
    is_of_unit: bool


def doubt_of_places(positions: NDArray[np.float64]) -> PlacesDoubt | None:
    """Say why places, (N, 3) metres, cannot be those of fruits, None where they can.

    By the distance of neighbours, by one far from all others, or by numbers that have 32 bits alone and so go in
    steps as coarse as fruits are apart, as those of UTM do.
    """
    if len(positions) < MIN_FRUITS:
        return None
    spacing_m = _spacing_m(positions)
    reach_m = np.hypot.reduce(positions - np.median(positions, axis=0), axis=1)  # squares may overflow
    copies = len(positions) - len(np.unique(positions, axis=0))
    if spacing_m < MIN_SPACING_M and 2 * copies >= len(positions):
        found = f"{copies} of {len(positions)} fruits lie where another one does, to the last digit"
        return PlacesDoubt(f"{found}, expected each once", is_of_unit=False)
    if not MIN_SPACING_M <= spacing_m <= MAX_SPACING_M:
        found = f"neighbouring fruits are {spacing_m:.3g} m apart (median), expected {MIN_SPACING_M:g} to"
        return PlacesDoubt(f"{found} {MAX_SPACING_M:g} m", is_of_unit=True)
    if reach_m.max() > FARTHEST_FRUIT_M:
        found = f"row {reach_m.argmax()}: found a fruit {reach_m.max():.3g} m from the middle of all, expected at"
        return PlacesDoubt(f"{found} most {FARTHEST_FRUIT_M:g} m", is_of_unit=False)
    for axis, values in zip("xyz", positions.T, strict=True):
        if (step_m := _step_m(values)) > COARSE * spacing_m:
            found = f"{axis} goes in steps of {step_m:.3g} m, where neighbouring fruits are {spacing_m:.3g} m apart"
            found += " (median), expected finer ones: numbers as large as those of UTM lose their ends in 32 bits"
            return PlacesDoubt(found, is_of_unit=False)
    return None


def doubt_of_diameters(cloud: FruitCloud) -> str | None:
    """Say why the diameters of a cloud cannot be those of fruits that hang so, in metres; None where they can."""
    known_m = np.empty(0) if cloud.diameters_m is None else cloud.diameters_m[~np.isnan(cloud.diameters_m)]
    if not len(known_m):
        return None
    low_m, high_m = PLAUSIBLE_DIAMETER_M
    found = f"the median diameter is {(median_m := float(np.median(known_m))):.3g} m"
    if not low_m <= median_m <= high_m:
        return f"{found}, expected {low_m:g} to {high_m:g} m"
    if len(cloud) < MIN_FRUITS or median_m <= MOST_SPACINGS * (spacing_m := _spacing_m(cloud.positions)):
        return None
    return f"{found} and neighbouring fruits are {spacing_m:.3g} m apart, expected {MOST_SPACINGS:g} times that at most"


def check_places(name: str | Path, positions: NDArray[np.float64], *, unit: Unit = "m", remedy: str = "") -> None:
    """Warn when places, (N, 3) metres, cannot be those of fruits, see `doubt_of_places`.

    Parameters
    ----------
    name : str or Path
    positions : (N, 3) float64
    unit : {"m", "cm", "mm"}
        That they were in.
    remedy : str
        What to do where it is another unit; else how to read a file in the likeliest one.
    """
    if (doubt := doubt_of_places(positions)) is None:
        return
    text = f"{name}: {doubt.found}"
    if doubt.is_of_unit:
        likely = likely_unit(positions, unit)
        remedy = remedy or f"say so: --unit {likely}, or FruitCloud.read(path, unit='{likely}')"
        text += f"; if it is not in {NAMED[unit]} {remedy}"
    warnings.warn(text, PomonaWarning, stacklevel=4)


def likely_unit(positions: NDArray[np.float64], unit: Unit) -> Unit:
    """Return the other unit in which places, (N, 3) metres if read in `unit`, are likeliest those of fruits."""
    spacing = max(_spacing_m(positions), np.finfo(float).tiny) / METRES_PER_UNIT[unit]

    def off(other: Unit) -> float:
        return abs(float(np.log(spacing * METRES_PER_UNIT[other] / USUAL_SPACING_M)))

    return min((other for other in NAMED if other != unit), key=off)


def look_at(name: str, cloud: FruitCloud, remedy: str) -> None:
    """Check the places of a cloud, unless that was done before, as it is when a file is read."""
    if cloud not in _looked_at:
        vouch_for(cloud)
        check_places(name, cloud.positions, remedy=remedy)


def vouch_for(*clouds: FruitCloud) -> None:
    """Let `look_at` pass clouds, for their places have been looked at or made here."""
    _looked_at.update(clouds)


def _step_m(values: NDArray[np.float64]) -> float:
    """Return the step of 32 bits between the largest of numbers that all have no more, else 0."""
    with np.errstate(over="ignore"):  # what is too large for 32 bits is none of them
        short = values.astype(np.float32)
    return float(np.spacing(np.abs(short).max())) if np.array_equal(short, values) else 0.0


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
