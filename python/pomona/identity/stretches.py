"""Stretches of a row that a visit without cameras went by and found empty: grubbed up, or picked clean."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["LIKELY", "FoundAround", "emptied_stretches", "went_by"]

AT_EACH_END = 3
"""Fruits at the height and depth of a gap that a visit has before it, and behind it, when it went by."""

MUCH_LONGER = 2.0
"""How far the fruits of a row spread along it, against across, for it to have a direction."""

STRIPPED = 0.02
"""Beforehand, that what hung in a gap was taken."""

USUAL_SHARE = 0.15
"""Of a visit's length: mean of what is stripped where single trees are grubbed up, exponential."""

BY_TREES = 0.25
"""How often it is single trees. Else it is any share alike: pickers go along a row as far as the day lets them."""

LEFT_OUT = 0.02
"""Beforehand, that a visit is of two pieces and left out what is between: any share of its length, alike."""

HIDE_TOGETHER = 2.0
"""Fruits that leaves hide as if they were one."""

LIKELY = 0.5
"""Probability from which a visit came by an empty stretch."""


@dataclass(frozen=True, eq=False)
class FoundAround:
    """What one visit found around the places of all fruits.

    Attributes
    ----------
    fruits : (N, 3) float64
        Its own, in the map, metres.
    places : (K, 3) float64
        Where each fruit of the map hangs on that day.
    reach_m : (K,) float64
        How near to a place a visit that looked there has three fruits.
    is_near : (K,) bool
        Whether it has.
    is_asked : bool
        No cameras say where it looked.
    """

    fruits: NDArray[np.float64]
    places: NDArray[np.float64]
    reach_m: NDArray[np.float64]
    is_near: NDArray[np.bool_]
    is_asked: bool


@dataclass(frozen=True, eq=False)
class _Gap:
    """Between the fruits of a visit at the height and depth of a place: before it and behind it along the row.

    Attributes
    ----------
    place : int
        Number of the fruit that hangs there.
    share : float
        Of the visit's length.
    holds : (K,) bool
        The fruits of the map that hang in it.
    """

    place: int
    share: float
    holds: NDArray[np.bool_]


def emptied_stretches(
    visits: Sequence[FoundAround], seen: NDArray[np.bool_], days: NDArray[np.float64]
) -> NDArray[np.float64]:
    r"""Return the probability, (K, V), that what hung about a fruit was taken before a visit, which came by.

    A visit with fruits of one height and depth on both sides of a gap went by, or is of two pieces. With $L$ the share
    of its length that the gap takes and $n$ the fruits in it that were seen last, the odds that they were taken are

    $$\frac{.02\, (.75 + .25\, e^{-L / .15} / .15)}{\prod .02 + m^{n / 2}}$$

    against that each visit since left out this very stretch, or that leaves hide all of it, with $m$ the share of
    other fruits that the visit misses. Fruits do not come back: of the visits before one that has three fruits there
    nothing is said, nor of one on the same date. Of what was not asked it is 0.

    Parameters
    ----------
    visits
        In the order of their days.
    seen : (K, V) bool
    days : (V,) float64
    """
    is_near = seen | np.stack([visit.is_near for visit in visits], axis=1)
    rows = [_along_row(visit.fruits) if visit.is_asked else None for visit in visits]
    dates = np.floor(days)
    missed = _shares_missed(seen, is_near)
    last = len(visits) - 1 - is_near[:, ::-1].argmax(axis=1)
    share, left_out, hidden = np.zeros(len(seen)), np.ones(len(seen)), np.ones(len(seen))
    gaps: list[list[_Gap]] = []
    for number, (visit, along) in enumerate(zip(visits, rows, strict=True)):
        since = (last < number) & (dates[number] > dates[last])
        gaps.append([] if along is None else list(_gaps(visit, along, since)))
        for gap in gaps[-1]:
            n_inside = np.count_nonzero(gap.holds & seen[:, last[gap.place]])
            share[gap.place] = max(share[gap.place], gap.share)
            left_out[gap.place] *= LEFT_OUT
            hidden[gap.place] = min(hidden[gap.place], missed[number] ** (n_inside / HIDE_TOGETHER))
    taken = STRIPPED * (1.0 - BY_TREES + BY_TREES * np.exp(-share / USUAL_SHARE) / USUAL_SHARE)
    chances = taken / (taken + left_out + hidden)
    # Few fruits that leaves may hide at once are no stretch.
    chances = np.where((chances > LIKELY) | (hidden < left_out), chances, 0.0)
    told = np.zeros(seen.shape)
    last_seen = len(visits) - 1 - seen[:, ::-1].argmax(axis=1)
    for number, (visit, along) in enumerate(zip(visits, rows, strict=True)):
        inner = np.array([gap.place for gap in gaps[number]], np.int64)
        told[inner, number] = chances[inner]
        if along is None or not (told[:, number] > LIKELY).any():
            continue
        # At the ends of the gap the fruits of the next tree are near, and what was missed there may be one of them.
        beside = is_near[:, number] & (last_seen < number) & (dates[number] > dates[last_seen])
        inner_chances = told[:, number].copy()
        for gap in _gaps(visit, along, beside):
            told[gap.place, number] = inner_chances[gap.holds].max(initial=0.0) / (1.0 + missed[number])
    return told


def went_by(visit: FoundAround, at_each_end: int = AT_EACH_END) -> NDArray[np.bool_]:
    """Tell which places, (K,), a visit went by for sure: cameras say so, or it has so many fruits before and behind.

    Beyond its last fruits along a row it may have looked, or ended.
    """
    if not visit.is_asked or len(visit.fruits) < AT_EACH_END:
        return np.ones(len(visit.places), bool)
    # All fruits of the map say which way the row goes: half of a short one is as high as long.
    along = _along_row(visit.places)
    along = _along_row(visit.fruits) if along is None else along
    if along is None:
        return np.ones(len(visit.places), bool)
    own_m, places_m = np.sort(visit.fruits @ along), visit.places @ along
    return np.asarray((places_m > own_m[at_each_end - 1]) & (places_m < own_m[-at_each_end]))


def _along_row(fruits: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the direction of a row, (3,); None where its fruits spread as far across."""
    if len(fruits) <= 2 * AT_EACH_END:
        return None
    _, spreads, axes = np.linalg.svd(fruits - fruits.mean(axis=0), full_matrices=False)
    return np.asarray(axes[0]) if spreads[0] >= MUCH_LONGER * spreads[1] else None


def _gaps(visit: FoundAround, along: NDArray[np.float64], asked: NDArray[np.bool_]) -> Iterator[_Gap]:
    """Find the gaps of a visit that hold places, of those with enough fruits at either end."""
    own_m, places_m = visit.fruits @ along, visit.places @ along
    first_m, last_m = own_m.min(initial=np.inf), own_m.max(initial=-np.inf)
    for place in np.flatnonzero(asked & (places_m > first_m) & (places_m < last_m)).tolist():
        about = own_m[_across_m(visit.fruits - visit.places[place], along) <= visit.reach_m[place]]
        before, behind = about[about < places_m[place]], about[about >= places_m[place]]
        if min(len(before), len(behind)) < AT_EACH_END:
            continue
        begin_m, end_m = before.max(), behind.min()
        within = (places_m > begin_m) & (places_m < end_m)
        within[within] = _across_m(visit.places[within] - visit.places[place], along) <= visit.reach_m[place]
        yield _Gap(place, float((end_m - begin_m) / (last_m - first_m)), within)


def _across_m(offsets: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(offsets - np.outer(offsets @ along, along), axis=1))


def _shares_missed(seen: NDArray[np.bool_], is_near: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the share of the fruits of other visits that each visit missed where it looked, (V,)."""
    of_others = is_near & (seen.sum(axis=1, keepdims=True) > seen)
    return np.asarray((of_others & ~seen).sum(axis=0) / np.maximum(of_others.sum(axis=0), 1))
