"""Which diameter of the map belongs to which one by hand: the same fruit, the same day or the days around it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from pomona.errors import PomonaError
from pomona.growth.caliper_file import Measurement
from pomona.growth.measured import MeasuredFruits
from pomona.reading import shown

__all__ = ["CaliperPair", "pair_with_calipers"]

NEAREST_DAYS = 3
"""A diameter by hand holds so many days around its own: a fruit grows by 1 mm in them, at most by 2."""

BETWEEN_DAYS = 21
"""Between two days by hand that are no further apart, growth is a line."""

ANEW = 0.5
"""Names that stand for different fruits in different sessions, of those in several, from which on sessions number anew:
of names that stay, as many do as identities are wrong, some in a hundred."""

FEWEST_ANEW = 3
"""Such names below which they are fruits that the map split."""

Series = dict[int, float]
"""Diameters in mm by day."""


@dataclass(frozen=True)
class CaliperPair:
    """A diameter of the map beside one by hand.

    Attributes
    ----------
    fruit_id : int
        Of the map.
    name : str
        As the table calls it.
    session : str
    day : date
        Of the visit.
    measured_mm, caliper_mm : float
    """

    fruit_id: int
    name: str
    session: str
    day: date
    measured_mm: float
    caliper_mm: float


def pair_with_calipers(
    fruits: MeasuredFruits, measurements: Sequence[Measurement], path: Path
) -> tuple[list[CaliperPair], list[str]]:
    """Put diameters beside those by hand.

    Returns
    -------
    pairs : list of CaliperPair
    unseen : list of str
        Names in the table of which the map has no diameter.

    Raises
    ------
    PomonaError
        When a number is none of the map's fruits, no name is one of its sessions', sessions call different fruits by
        one name, days are missing that are needed, or no visit near measured any.
    """
    if any(one.day is None for one in measurements) and len(set(fruits.days)) > 1:
        raise PomonaError(f"{path}: found no column date, expected one: {fruits.path} has visits on several days")
    by_name: dict[str, Series] = defaultdict(dict)
    for one in measurements:
        by_name[one.name][(one.day or fruits.days[0]).toordinal()] = one.diameter_mm
    if measurements[0].is_number:
        cells = _cells_by_number(fruits, measurements)
    else:
        cells = _cells_by_label(fruits, set(by_name), path)
    pairs = []
    for name, row, column in cells:
        caliper_mm = _on_day(by_name[name], fruits.days[column].toordinal())
        measured_mm = float(fruits.diameters_mm[row, column])
        if caliper_mm is not None and not np.isnan(measured_mm):
            about = int(fruits.ids[row]), name, fruits.sessions[column], fruits.days[column]
            pairs.append(CaliperPair(*about, measured_mm, caliper_mm))
    if not pairs:
        near = f"within {NEAREST_DAYS} days of a visit of {fruits.path} that measured the fruit"
        raise PomonaError(f"{path}: found no diameter {near}, expected one")
    unseen = sorted(set(by_name) - {pair.name for pair in pairs})
    return pairs, unseen


def _cells_by_number(fruits: MeasuredFruits, measurements: Sequence[Measurement]) -> list[tuple[str, int, int]]:
    row_of = {str(fruit_id): row for row, fruit_id in enumerate(fruits.ids.tolist())}
    for one in measurements:
        if one.name not in row_of:
            found = f"{one.where}: fruit_id: found {shown(one.name)}"
            raise PomonaError(f"{found}, expected the number of a fruit with diameters in {fruits.path}")
    names = dict.fromkeys(one.name for one in measurements)
    return [(name, row_of[name], column) for name in names for column in range(len(fruits.days))]


def _cells_by_label(fruits: MeasuredFruits, names: set[str], path: Path) -> list[tuple[str, int, int]]:
    cells = [
        (label, row, column)
        for row, labels in enumerate(fruits.labels)
        for column, label in enumerate(labels)
        if label is not None and label in names
    ]
    if not cells:
        some = ", ".join(map(shown, sorted(names)[:3]))
        raise PomonaError(
            f"{path}: found the fruits {some}, expected names that sessions of {fruits.path} have, or a column "
            "fruit_id with the map's numbers"
        )
    _require_names_that_stay(fruits, cells, path)
    return cells


def _require_names_that_stay(fruits: MeasuredFruits, cells: Sequence[tuple[str, int, int]], path: Path) -> None:
    rows: dict[str, list[int]] = defaultdict(list)
    for label, row, _ in cells:
        rows[label].append(row)
    several = [set(of_label) for of_label in rows.values() if len(of_label) > 1]
    n_anew = sum(len(of_label) > 1 for of_label in several)
    if n_anew >= max(FEWEST_ANEW, ANEW * len(several)):
        raise PomonaError(
            f"{path}: found names of which {n_anew} of {len(several)} are different fruits in different sessions of "
            f"{fruits.path}, expected one name for each fruit, or a column fruit_id with the map's numbers"
        )


def _on_day(series: Series, day: int) -> float | None:
    """Diameter by hand on a day: between two days, or of the nearest; None where both are too far."""
    days = sorted(series)
    before, after = [at for at in days if at <= day], [at for at in days if at >= day]
    if before and after and after[0] - before[-1] <= BETWEEN_DAYS:
        return float(np.interp(day, days, [series[at] for at in days]))
    nearest = min(days, key=lambda at: abs(at - day))
    return series[nearest] if abs(nearest - day) <= NEAREST_DAYS else None
