"""The story of growth: sizes out of the map, each trusted by its share, curves weighed, every fruit told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, time
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona.growth.blocks import Block, block_counts, block_means, blocks_of
from pomona.growth.foretelling import Foretold, foretell
from pomona.growth.fruit_order import reckoned_order
from pomona.growth.harvest_day import harvest_after
from pomona.growth.measured import MeasuredFruits, measured_fruits, require_one_season, require_two_days
from pomona.growth.odd_visits import OddVisit, odd_visits
from pomona.growth.oddities import odd_fruits
from pomona.growth.season_clock import CALENDAR, DegreeDays, SeasonClock, read_temperatures
from pomona.growth.size_classes import FIVE_MM, class_counts, class_masses, rising_limits
from pomona.growth.size_table import SizeTable
from pomona.growth.trust import trust_in_sizes
from pomona.growth.weighing import WeighedCurve, weighed_curves

__all__ = ["SeasonGrowth", "grow_season", "growth_of"]


@dataclass(frozen=True, eq=False)
class SeasonGrowth:
    """How the fruits of a map grow.

    Attributes
    ----------
    fruits : MeasuredFruits
        N fruits, in order of their trees.
    curves : tuple of WeighedCurve
        Those that are believed most come first.
    blocks : tuple of Block
        All fruits, then each tree's.
    limits_mm : (C - 1,) float64
        Of the size classes.
    foretold : Foretold
        Sizes on the days of `days`, and rates on the last visit; `summaries` has ``blocks``, ``n_fruits`` of blocks,
        ``counts`` and ``masses_kg``.
    days : tuple of date
        Of the visits, and then the harvest where it was asked for.
    harvest : date or None
    odd : (N,) bool
        Fruits with a size that likelier does not belong to them, or that grow like no other.
    put_aside : (N, S) bool
        Those sizes.
    stopped : (N,) float64
        Probability of each fruit that it has stopped growing and hangs on.
    odd_visits : sequence of OddVisit
        Visits whose sizes are likely off together, none as a rule.
    """

    fruits: MeasuredFruits
    curves: tuple[WeighedCurve, ...]
    blocks: tuple[Block, ...]
    limits_mm: NDArray[np.float64]
    foretold: Foretold
    days: tuple[date, ...]
    harvest: date | None
    odd: NDArray[np.bool_]
    put_aside: NDArray[np.bool_]
    stopped: NDArray[np.float64]
    odd_visits: Sequence[OddVisit]

    @property
    def curve(self) -> WeighedCurve:
        """The curve that is believed most."""
        return self.curves[0]

    @property
    def is_told(self) -> NDArray[np.bool_]:
        """On which days each fruit has a size, (N, Q): always while it hangs, else until it was measured last."""
        measured = ~np.isnan(self.fruits.diameters_mm)
        until = measured.shape[1] - measured[:, ::-1].argmax(axis=1)
        return np.asarray(self.fruits.hanging[:, None] | (np.arange(len(self.days)) < until[:, None]))

    @property
    def is_growing(self) -> NDArray[np.bool_]:
        """Which fruits have a size and a rate now, on the day of the last visit, (N,)."""
        return np.asarray(self.is_told[:, len(self.fruits.days) - 1])


def grow_season(
    orchard: str | Path,
    *,
    harvest: date | str | None = None,
    temperature: str | Path | None = None,
    limits_mm: ArrayLike = FIVE_MM,
) -> SeasonGrowth:
    """Tell the growth of every fruit of a map.

    Parameters
    ----------
    orchard : str or Path
        The map (.gpkg).
    harvest : date or str, optional
        Day to foretell, after the last visit; as text 2024-09-10.
    temperature : str or Path, optional
        CSV with ``date,mean_c`` or ``date,min_c,max_c``: degree days are tried beside days.
    limits_mm : (C - 1,) float64
        Of the size classes, rising.

    Raises
    ------
    PomonaError
        When the map has sizes of one day only or of several seasons, the harvest is no day, lies before the last visit
        or in another season, the limits do not rise, or a file is wrong.
    """
    fruits = measured_fruits(orchard)
    require_two_days(fruits)
    require_one_season(fruits)
    return growth_of(fruits, harvest=harvest, clocks=_clocks(fruits, temperature), limits_mm=limits_mm)


def growth_of(
    fruits: MeasuredFruits,
    *,
    harvest: date | str | None = None,
    clocks: Sequence[SeasonClock] = (CALENDAR,),
    limits_mm: ArrayLike = FIVE_MM,
) -> SeasonGrowth:
    """Tell the growth of fruits whose sizes are at hand; see `grow_season`."""
    day, limits = harvest_after(fruits.days[-1], harvest), rising_limits(limits_mm)
    order, trees = reckoned_order(fruits)
    rows, sizes_mm, moments = np.argsort(order), fruits.diameters_mm[order], fruits.moments
    trust = trust_in_sizes(SizeTable.of(sizes_mm, trees, CALENDAR.times(moments)), fruits.fruit_chances[order])
    curves = weighed_curves(sizes_mm, trees, trust.in_curve, moments, clocks)
    aside = trust.put_aside
    odd = aside.any(axis=1) | odd_fruits(curves[0].table, curves[0].fitted)
    wanted = [*moments, *([max(moments[-1], datetime.combine(day, time()))] if day else [])]
    blocks = blocks_of(fruits)
    foretold = foretell(
        curves,
        wanted,
        n_visits=len(moments),
        trust=trust,
        rows=rows,
        hang_chances=fruits.hang_chances,
        summaries={
            "blocks": block_means(blocks),
            "n_fruits": block_counts(blocks),
            "counts": class_counts(limits),
            "masses_kg": class_masses(limits),
        },
    )
    days = tuple(moment.date() for moment in wanted)
    off = odd_visits(curves[0].fitted, len(moments))
    return SeasonGrowth(
        fruits, curves, blocks, limits, foretold, days, day, odd[rows], aside[rows], trust.stopped[rows], off
    )


def _clocks(fruits: MeasuredFruits, temperature: str | Path | None) -> tuple[SeasonClock, ...]:
    if temperature is None:
        return (CALENDAR,)
    means_c = read_temperatures(Path(temperature), fruits.days)
    return (CALENDAR, DegreeDays(means_c, fruits.moments[0], fruits.moments[-1]))
