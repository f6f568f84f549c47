"""The story of growth: sizes out of the map, a curve chosen, what is odd put aside, every fruit told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.growth.blocks import Block, block_means, blocks_of
from pomona.growth.foretelling import Foretold, foretell
from pomona.growth.measured import MeasuredFruits, measured_fruits, require_two_days
from pomona.growth.oddities import odd_fruits, odd_measurements
from pomona.growth.season_clock import CALENDAR, DegreeDays, SeasonClock, read_temperatures
from pomona.growth.size_classes import FIVE_MM, class_counts, class_masses
from pomona.growth.size_table import SizeTable
from pomona.growth.weighing import WeighedCurve, weighed_curves

__all__ = ["SeasonGrowth", "grow_season", "growth_of"]

SEASON_DAYS = 200
"""From bloom to the last harvest: a later day is one of another season, of which these curves know nothing."""


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
        Sizes on the days of `days`, and rates on the last visit; `summaries` has ``blocks``, ``counts`` and
        ``masses_kg``.
    days : tuple of date
        Of the visits, and then the harvest where it was asked for.
    harvest : date or None
    odd : (N,) bool
        Fruits with a size that does not belong to them, or that grow like no other.
    put_aside : (N, S) bool
        Those sizes.
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
    harvest: date | None = None,
    temperature: str | Path | None = None,
    limits_mm: NDArray[np.float64] = FIVE_MM,
) -> SeasonGrowth:
    """Tell the growth of every fruit of a map.

    Parameters
    ----------
    orchard : str or Path
        The map (.gpkg).
    harvest : date, optional
        Day to foretell, after the last visit.
    temperature : str or Path, optional
        CSV with ``date,mean_c`` or ``date,min_c,max_c``: degree days are tried beside days.
    limits_mm : (C - 1,) float64
        Of the size classes, rising.

    Raises
    ------
    PomonaError
        When the map has sizes of one day only, the harvest lies before the last visit or in another season, or a file
        is wrong.
    """
    fruits = measured_fruits(orchard)
    require_two_days(fruits)
    return growth_of(fruits, harvest=harvest, clocks=_clocks(fruits, temperature), limits_mm=limits_mm)


def growth_of(
    fruits: MeasuredFruits,
    *,
    harvest: date | None = None,
    clocks: Sequence[SeasonClock] = (CALENDAR,),
    limits_mm: NDArray[np.float64] = FIVE_MM,
) -> SeasonGrowth:
    """Tell the growth of fruits whose sizes are at hand; see `grow_season`."""
    if harvest is not None and harvest < fruits.days[-1]:
        raise PomonaError(f"--harvest: found {harvest}, expected the last visit's day or later: {fruits.days[-1]}")
    if harvest is not None and (harvest - fruits.days[-1]).days > SEASON_DAYS:
        raise PomonaError(
            f"--harvest: found {harvest}, expected a day of the same season, at most {SEASON_DAYS} days after the last "
            f"visit: {fruits.days[-1]}"
        )
    moments, trees = fruits.moments, fruits.trees.numbers
    put_aside = odd_measurements(SizeTable.of(fruits.diameters_mm, trees, CALENDAR.times(moments)))
    kept_mm = np.where(put_aside, np.nan, fruits.diameters_mm)
    curves = weighed_curves(kept_mm, trees, moments, clocks)
    odd = put_aside.any(axis=1) | odd_fruits(curves[0].table, curves[0].fitted)
    wanted = [*moments, *([max(moments[-1], datetime.combine(harvest, time()))] if harvest else [])]
    blocks = blocks_of(fruits)
    foretold = foretell(
        curves,
        wanted,
        n_visits=len(moments),
        summaries={
            "blocks": block_means(blocks),
            "counts": class_counts(limits_mm, fruits.hanging),
            "masses_kg": class_masses(limits_mm, fruits.hanging),
        },
    )
    days = tuple(moment.date() for moment in wanted)
    return SeasonGrowth(fruits, curves, blocks, limits_mm, foretold, days, harvest, odd, put_aside)


def _clocks(fruits: MeasuredFruits, temperature: str | Path | None) -> tuple[SeasonClock, ...]:
    if temperature is None:
        return (CALENDAR,)
    means_c = read_temperatures(Path(temperature), fruits.days)
    return (CALENDAR, DegreeDays(means_c, fruits.moments[0], fruits.moments[-1]))
