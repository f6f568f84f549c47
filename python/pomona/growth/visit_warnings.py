"""What a user of growth must know of the visits: those without sizes, whose sizes are off, in an order fruits deny."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import date
from itertools import pairwise

import numpy as np

from pomona.growth.measured import MeasuredFruits
from pomona.growth.season_growth import SeasonGrowth
from pomona.growth.whole_fruits import whole_fruits

__all__ = ["called", "of_late_visits", "of_visits"]

_SHRUNK, _LEAST = 0.9, 10
"""Size of a fruit, in the middle of so many, against the visit before, from which on it is told: scales of visits err
by 2 %, and fruits lose less than that on a dry day."""

_SLOWER, _LESS = 0.5, 0.07
"""Share of the growth up to the last visit that curves tell, below which fruits may have stopped, and what lacks of its
logarithm at least: two visits of which each is off by 2 % seldom hide as much."""

_OFF_CURVE = 0.3
"""Logarithm of the scale of a visit from which on it is the curve that is wrong: no camera is off by a third."""


_BEYOND, _HELD_DAYS = 0.05, 3
"""Share of what hangs that lies beyond the last visit from which on it is told, and days for which it holds: a row may
be recorded on two."""


def of_visits(growth: SeasonGrowth) -> list[str]:
    """Say in a line each what is wrong with visits."""
    fruits = growth.fruits
    likely = [odd.visit for odd in growth.odd_visits if odd.probability > 0.5]
    off = [
        f"sizes of {called(fruits, odd.visit)} {'are likely' if odd.visit in likely else 'may be'} off together: "
        f"{100 * (odd.scale - 1):+.0f} % against the other visits (probability {odd.probability:.2f}); its unit, its "
        "camera, its date?"
        for odd in growth.odd_visits
    ]
    late = of_late_visits(fruits, "growth is told")
    left_out = [
        f"part {part} of the map was visited on {day} last, in a season before: what is told is of the others"
        for part, day in fruits.left_out.items()
    ]
    of_sizes = [*(off or _of_curve(growth)), *_of_still(growth), *_of_shrunk(fruits, likely)]
    return [*left_out, *late, *of_sizes, *_of_unseen(fruits)]


def _of_curve(growth: SeasonGrowth) -> list[str]:
    """Say that the sizes of a visit lie far from the curves, if so: that of the whole row suits none of its parts."""
    beside = np.log(growth.foretold.scales)
    farthest = int(np.abs(beside).argmax())
    if abs(beside[farthest]) < _OFF_CURVE:
        return []
    day, percent = called(growth.fruits, farthest), 100 * np.expm1(beside[farthest])
    return [
        f"sizes of {day} lie {percent:+.0f} % beside the curves, more than a camera errs: sizes and rates are not to "
        "be trusted; has part of the row stopped growing, or is it of another sort?"
    ]


def _of_still(growth: SeasonGrowth) -> list[str]:
    """Say that fruits hardly grew up to the last visit where the curves go on, if so; those apart that have stopped."""
    fruits, last = growth.fruits, len(growth.fruits.days) - 1
    before = max((visit for visit, day in enumerate(fruits.days) if day < fruits.days[last]), default=last)
    goes_on = np.nan_to_num(growth.stopped) < 0.5
    grown = np.log(fruits.diameters_mm[goes_on, last] / fruits.diameters_mm[goes_on, before])
    told = np.log(growth.foretold.sizes_mm[goes_on, last] / growth.foretold.sizes_mm[goes_on, before])
    both = ~np.isnan(grown)
    if before == last or both.sum() < _LEAST:
        return []
    by, by_curves = float(np.median(grown[both])), float(np.median(told[both]))
    if by > min(_SLOWER * by_curves, by_curves - _LESS):
        return []
    return [
        f"fruits grew by {100 * np.expm1(by):+.0f} % from {called(fruits, before)} to {called(fruits, last)} where the "
        f"curves say {100 * np.expm1(by_curves):+.0f} %: have they stopped? what is foretold has them go on"
    ]


def of_late_visits(fruits: MeasuredFruits, told: str) -> list[str]:
    """Say that the last visits have no sizes, if so, and of which day something is `told`."""
    last = fruits.days[-1]
    later = [str(day) for day in fruits.days_without_sizes if day > last]
    return [f"no sizes on {', '.join(later)}, {told} of {last}"] if later else []


def _of_shrunk(fruits: MeasuredFruits, off: Sequence[int]) -> list[str]:
    """Say where fruits are smaller than on the visit before: growth has an order, and dates can be mixed up.

    Not of visits that are likely `off`, which says why.
    """
    lines = []
    for before, after in pairwise(range(len(fruits.moments))):
        ratios = fruits.diameters_mm[:, after] / fruits.diameters_mm[:, before]
        ratios = ratios[~np.isnan(ratios)]
        if before in off or after in off or len(ratios) < _LEAST:
            continue
        if (ratio := float(np.median(ratios))) < _SHRUNK:
            lines.append(
                f"fruits are {100 * (1 - ratio):.0f} % smaller on {called(fruits, after)} than on "
                f"{called(fruits, before)} ({len(ratios)} in both), and none shrinks; are both dates right?"
            )
    return lines


def _of_unseen(fruits: MeasuredFruits) -> Iterator[str]:
    """Say how many of a part count as they did, for its last visit ended before: nobody knows whether they were picked.

    Those were seen whenever somebody looked, and not on the last day of the part.
    """
    columns = fruits.cloud.extras
    days = np.array([date.fromisoformat(day[:10]).toordinal() for day in columns["last_seen"]])
    is_seen = np.isin(columns["state"], ("seen", "new"))
    parts = fruits.parts if len(fruits.parts) else np.ones_like(days)
    for part in np.unique(parts):
        chances = np.where(parts == part, fruits.hang_chances, 0.0)
        last = days[parts == part].max()
        beyond = is_seen & (chances > 0.0) & (days < last - _HELD_DAYS)
        n_hang, n_beyond = whole_fruits(chances.sum()), whole_fruits(chances[beyond].sum())
        if n_beyond >= max(_LEAST, _BEYOND * n_hang):
            before, _ = Counter(days[beyond].tolist()).most_common(1)[0]
            seen_on, as_on = map(date.fromordinal, (last, before))
            yield (
                f"{n_beyond} of {n_hang} fruits hang beyond what was seen on {seen_on}: they count as on {as_on}, "
                "picked or not"
            )


def called(fruits: MeasuredFruits, visit: int) -> str:
    """Call a visit by its day, and by its session where the day had several."""
    day = fruits.days[visit]
    return f"{day}" if fruits.days.count(day) == 1 else f"{day} {fruits.sessions[visit]}"
