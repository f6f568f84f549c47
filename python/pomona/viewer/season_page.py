"""What the page is told of a map: one document, the same for the server and for the report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import __version__
from pomona.errors import PomonaError
from pomona.growth.bearing_trees import bearing_trees
from pomona.growth.measured import measured_fruits, require_one_season
from pomona.growth.season_growth import grow_season
from pomona.growth.size_classes import FIVE_MM
from pomona.growth.visit_warnings import of_late_visits, of_visits
from pomona.orchard import OrchardMap
from pomona.viewer.row_frame import Vertical
from pomona.viewer.told_calipers import calipers_told
from pomona.viewer.told_crops import crops_inside
from pomona.viewer.told_fruits import FruitsTold, trees_told
from pomona.viewer.told_growth import growth_told
from pomona.viewer.told_sizes import sizes_told
from pomona.viewer.told_thinning import thinning_told

__all__ = ["Warn", "Wishes", "season_document", "unheard"]

CropsTold = Callable[[Path, FruitsTold], dict[str, Any] | None]
Warn = Callable[[str], None]

FORMAT = 2
"""Of the document; the page says so when it is another."""


@dataclass(frozen=True, eq=False)
class Wishes:
    """What is asked of the page besides the map.

    Attributes
    ----------
    harvest : date or None
        Day to foretell.
    temperature, calipers : Path or None
        Tables as `pomona growth` and `pomona validate` take them.
    limits_mm : (C - 1,) float64
        Of the size classes.
    target : int or None
        Fruits that a tree shall keep.
    pack_kg : float
        Kilograms that a pack holds.
    up : (3,) float64 or None
        The vertical in the map; without, what the map knows of it, else a guess by its shape.
    """

    harvest: date | None = None
    temperature: Path | None = None
    calipers: Path | None = None
    limits_mm: NDArray[np.float64] = field(default_factory=FIVE_MM.copy)
    target: int | None = None
    pack_kg: float = 13.0
    up: NDArray[np.float64] | None = None


def unheard(_line: str) -> None:
    """Let a warning pass."""


def season_document(
    path: Path, wishes: Wishes, crops: CropsTold = crops_inside, warn: Warn = unheard
) -> dict[str, Any]:
    """Tell a map as plain values for JSON; the same map and wishes give the same document.

    Parameters
    ----------
    path : Path
        The map.
    wishes : Wishes
    crops : callable
        Tells where the small pictures of fruits are, in the document otherwise.
    warn : callable
        Takes a line on what is wrong with visits.

    Raises
    ------
    PomonaError
        When the file is no map, has no fruits, or a table that was given is wrong. What a map cannot tell, as growth of
        one visit, is told as the reason why not.
    """
    orchard = OrchardMap(path)
    if orchard.kind != "map":
        raise PomonaError(f"{path}: found a session, expected a map (.gpkg), which `pomona map add` makes of sessions")
    cloud, visits = orchard.fruits(), orchard.visits()
    if not len(cloud):
        raise PomonaError(f"{path}: found no fruits, expected a map with some")
    trees = bearing_trees(cloud)
    vertical = Vertical.of(path, cloud, wishes.up)
    fruits = FruitsTold.of(cloud, trees.numbers, vertical.up)
    return {
        "format": FORMAT,
        "program": f"pomona {__version__}",
        "name": path.name,
        "visits": [{"name": v.name, "date": v.date, "n_fruits": v.n_fruits, "n_matched": v.n_matched} for v in visits],
        "is_vertical_guessed": vertical.is_guess,
        "map_from_page": np.linalg.inv(fruits.page_from_map).tolist(),
        "trees": trees_told(fruits, trees),
        "fruits": fruits.as_columns(),
        "sights": fruits.sights(orchard.observations(), [visit.name for visit in visits]),
        "harvest": None if wishes.harvest is None else wishes.harvest.isoformat(),
        **_grown(path, wishes, fruits, warn),
        "calipers": calipers_told(path, wishes.calipers, fruits),
        "crops": crops(path, fruits),
    }


def _grown(path: Path, wishes: Wishes, fruits: FruitsTold, warn: Warn) -> Mapping[str, Any]:
    """Tell growth and what follows from it; of a map that cannot have any, why."""
    try:
        measured = measured_fruits(path)
    except PomonaError as reason:
        return _no_growth(_by_name(reason, path), None)
    sizes = sizes_told(measured, wishes.limits_mm, wishes.pack_kg)
    late = of_late_visits(measured, "sizes are")
    try:
        require_one_season(measured)
    except PomonaError as reason:
        _each(warn, late)
        return _no_growth(_by_name(reason, path), sizes)
    if len(set(measured.days)) < 2:
        _each(warn, late)
        return _no_growth(f"sizes of one day only, {measured.days[0]}: add another visit", sizes)
    growth = grow_season(path, harvest=wishes.harvest, temperature=wishes.temperature, limits_mm=wishes.limits_mm)
    _each(warn, of_visits(growth))
    return {
        "growth": growth_told(growth, fruits, wishes.pack_kg),
        "thinning": thinning_told(growth, fruits, wishes.target),
        "no_growth": None,
        "sizes": None,
    }


def _each(warn: Warn, lines: Sequence[str]) -> None:
    for line in lines:
        warn(line)


def _by_name(reason: PomonaError, path: Path) -> str:
    """Say what is wrong with a map by the name of its file: where that lies is nobody's business who reads a report."""
    return str(reason).replace(str(path), path.name)


def _no_growth(reason: str, sizes: list[dict[str, Any]] | None) -> Mapping[str, Any]:
    return {"growth": None, "thinning": None, "no_growth": reason, "sizes": sizes}
