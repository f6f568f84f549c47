"""What a map knows of the sizes of its fruits: who was measured when, on which tree, in which state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.growth.bearing_trees import BearingTrees, bearing_trees
from pomona.growth.whole_fruits import whole_fruits
from pomona.identity import SEASON_DAYS, seasons_of
from pomona.orchard import Observations, OrchardMap, Visit
from pomona.orchard.hanging import are_things, fruit_chances, hang_chances, may_hang

__all__ = ["MeasuredFruits", "measured_fruits", "require_one_season", "require_two_days"]

SIZES_MM = (1.0, 1000.0)
"""No fruit is smaller or larger: what says so is no measurement."""

_YEARS = (1900, 2199)
"""Of recordings: another year is a slip of the pen or of a clock, and pictures have no calendar for the outermost."""


@dataclass(frozen=True, eq=False)
class MeasuredFruits:
    """Diameters of N fruits on S visits, in order of trees and ids.

    Attributes
    ----------
    path : Path
        The map.
    cloud : FruitCloud
        The N fruits, where they were last seen, with the map's ids.
    ids : (N,) int64
        The same ids as numbers.
    trees : BearingTrees
        Tree of each fruit.
    sessions : tuple of S str
    moments : tuple of S datetime
        When each visit was, ascending.
    diameters_mm : (N, S) float64
        NaN where a visit did not measure the fruit.
    labels : tuple of N tuples of S str or None
        The sessions' own names of the fruits.
    days_without_sizes : tuple of date
        Of visits that measured no fruit, ascending.
    parts : (N,) int64
        Number of the part of the map that each is of, from 1, as `Visit.part`; empty where there is one.
    left_out : mapping of int to date
        Parts of the map that nobody visited in its last season, and when they were visited last.
    unmeasured : mapping of str to float
        How many are expected to hang that no visit measured, by tree: none of the N.
    """

    path: Path
    cloud: FruitCloud
    ids: NDArray[np.int64]
    trees: BearingTrees
    sessions: tuple[str, ...]
    moments: tuple[datetime, ...]
    diameters_mm: NDArray[np.float64]
    labels: tuple[tuple[str | None, ...], ...]
    days_without_sizes: tuple[date, ...] = ()
    unmeasured: Mapping[str, float] = field(default_factory=dict)
    parts: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    left_out: Mapping[int, date] = field(default_factory=dict)

    @property
    def days(self) -> tuple[date, ...]:
        """Day of each visit, (S,)."""
        return tuple(moment.date() for moment in self.moments)

    @property
    def n_unmeasured(self) -> int:
        """How many are expected to hang that no visit measured, as a whole number."""
        return whole_fruits(sum(self.unmeasured.values()))

    @property
    def hanging(self) -> NDArray[np.bool_]:
        """Which fruits hang for all that the map knows, (N,); all, once none does: the season is looked back at."""
        hanging = may_hang(self.cloud) & ~are_things(self.cloud)
        return hanging if hanging.any() else np.ones(len(self.ids), dtype=bool)

    @property
    def fruit_chances(self) -> NDArray[np.float64]:
        """Probability of each that it is a fruit, (N,)."""
        return fruit_chances(self.cloud)

    @property
    def hang_chances(self) -> NDArray[np.float64]:
        """Probability of each that it is a fruit and hangs, (N,); once none hangs, that it was one."""
        chances = hang_chances(self.cloud)
        if may_hang(self.cloud).any() and chances.any():
            return chances
        return hang_chances(replace(self.cloud, extras={**self.cloud.extras, "state": ("",) * len(chances)}))

    @property
    def n_days(self) -> NDArray[np.int64]:
        """On how many days each fruit was measured, (N,)."""
        days = np.unique(np.array([day.toordinal() for day in self.days]), return_inverse=True)[1]
        counts = [len(set(days[seen].tolist())) for seen in ~np.isnan(self.diameters_mm)]
        return np.array(counts, dtype=np.int64)


def measured_fruits(path: str | Path) -> MeasuredFruits:
    """Read the sizes of a map's fruits of its last season; visits and fruits without any diameter are left out.

    Raises
    ------
    PomonaError
        When the file is no map or session, or knows no diameter at all.
    """
    orchard = OrchardMap(path)
    if orchard.kind != "map":
        raise PomonaError(f"{path}: found a session, expected a map (.gpkg), which `pomona map add` makes of sessions")
    all_visits = orchard.visits()
    visits = _of_last_season(all_visits)
    names = tuple(visit.name for visit in visits)
    seen = orchard.observations().of_sessions(names)
    everything = orchard.fruits()
    in_season = np.isin(np.array(list(map(int, everything.ids or ())), dtype=np.int64), seen.fruit_ids)
    # Where trees stand fruits of all seasons tell.
    trees = bearing_trees(everything).select(np.flatnonzero(in_season))
    cloud = everything.select(in_season)
    ids = np.array(list(map(int, cloud.ids or ())), dtype=np.int64)
    diameters_mm, labels = _table(ids, names, seen)
    known = ~np.isnan(diameters_mm)
    if not known.any():
        raise PomonaError(f"{path}: found no diameters, expected sessions that measured them")
    measured = known.any(axis=0)
    fruits, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(measured)
    # Visits of one moment by their names: the map has them in the order in which they were added.
    moments = [datetime.fromisoformat(visit.date) for visit in visits]
    without = {moments[column].date() for column in np.flatnonzero(~measured).tolist()}
    columns = np.array(sorted(columns.tolist(), key=lambda column: (moments[column], names[column])))
    fruits = fruits[np.argsort(trees.numbers[fruits], kind="stable")]
    return MeasuredFruits(
        path=Path(path),
        cloud=cloud.select(fruits),
        ids=ids[fruits],
        trees=trees.select(fruits),
        sessions=tuple(names[column] for column in columns),
        moments=tuple(moments[column] for column in columns),
        diameters_mm=diameters_mm[np.ix_(fruits, columns)],
        labels=tuple(tuple(labels[fruit, column] for column in columns) for fruit in fruits),
        days_without_sizes=tuple(sorted(without)),
        unmeasured=_unmeasured(cloud, trees, fruits),
        parts=everything.parts[in_season][fruits] + 1,
        left_out=_left_out(all_visits, visits),
    )


def _of_last_season(visits: Sequence[Visit]) -> list[Visit]:
    """Return the visits after the last winter, in their order."""
    ordered = sorted(visits, key=lambda visit: datetime.fromisoformat(visit.date))
    days = np.array([datetime.fromisoformat(visit.date).toordinal() for visit in ordered], np.float64)
    of_season = {visit.name for visit in ordered[seasons_of(days)[-1]]}
    return [visit for visit in visits if visit.name in of_season]


def _left_out(visits: Sequence[Visit], of_season: Sequence[Visit]) -> dict[int, date]:
    """Return the parts of which none of the visits is of the season, and the day of the last of each."""
    told = {visit.part for visit in of_season}
    last = {visit.part: datetime.fromisoformat(visit.date).date() for visit in visits}
    return {part: day for part, day in last.items() if part not in told}


def _unmeasured(cloud: FruitCloud, trees: BearingTrees, measured: NDArray[np.int64]) -> dict[str, float]:
    """Expect how many of each tree hang and are none of those that were measured, (N,) rows."""
    chances = hang_chances(cloud)
    chances[measured] = 0.0
    counts = np.bincount(trees.numbers, weights=chances, minlength=len(trees.names)).tolist()
    return {name: count for name, count in zip(trees.names, counts, strict=True) if count > 0.0}


def _table(
    ids: NDArray[np.int64], names: tuple[str, ...], seen: Observations
) -> tuple[NDArray[np.float64], NDArray[np.object_]]:
    """Give diameters in mm and labels, (N, S), of a long table."""
    row_of = {fruit_id: row for row, fruit_id in enumerate(ids.tolist())}
    column_of = {name: column for column, name in enumerate(names)}
    rows = [row_of[fruit_id] for fruit_id in seen.fruit_ids.tolist()]
    columns = [column_of[name] for name in seen.sessions]
    diameters_mm = np.full((len(ids), len(names)), np.nan)
    labels = np.full((len(ids), len(names)), None, dtype=object)
    low, high = SIZES_MM
    sizes_mm = 1000.0 * seen.diameters_m
    # Comparisons with NaN are false, so what is unknown stays so.
    diameters_mm[rows, columns] = np.where((sizes_mm >= low) & (sizes_mm <= high), sizes_mm, np.nan)
    labels[rows, columns] = seen.labels
    return diameters_mm, labels


def require_two_days(fruits: MeasuredFruits) -> None:
    """Refuse sizes of a single day, of which no growth can be told.

    Raises
    ------
    PomonaError
    """
    if len(set(fruits.days)) < 2:
        raise PomonaError(
            f"{fruits.path}: found diameters of one day, {fruits.days[0]}, expected two or more: add another visit"
        )


def require_one_season(fruits: MeasuredFruits) -> None:
    """Refuse visits of several seasons, which no curve joins, and days that are none of recordings.

    Raises
    ------
    PomonaError
    """
    first, last = fruits.days[0], fruits.days[-1]
    odd = next((day for day in (first, last) if not _YEARS[0] <= day.year <= _YEARS[1]), None)
    if odd is not None:
        raise PomonaError(f"{fruits.path}: found a visit on {odd}, expected a year from {_YEARS[0]} to {_YEARS[1]}")
    if (last - first).days > SEASON_DAYS:
        raise PomonaError(
            f"{fruits.path}: found visits from {first} to {last}, expected those of one season, at most {SEASON_DAYS} "
            "days apart"
        )
