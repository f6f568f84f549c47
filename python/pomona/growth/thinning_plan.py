"""Which fruits to thin: who drops by itself, how many stay, and which of the clusters bear the rest too many."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.growth.clusters import clusters_of
from pomona.growth.fruit_drop import LARGEST_FRUITLET_MM, FruitDrop, MeasuredRates, drop_of
from pomona.growth.measured import MeasuredFruits
from pomona.growth.season_clock import CALENDAR
from pomona.growth.season_growth import SeasonGrowth
from pomona.growth.trust import OFF_BY
from pomona.growth.whole_fruits import whole_fruits

__all__ = ["ThinningPlan", "are_fruitlets", "plan_thinning", "rates_are_known"]

KEEP, DROPS, THIN = "keep", "drops", "thin"

_NOISE_SPREAD = 0.6
"""Standard deviation of the logarithm of the noise, around the season's: that one swells with fruits that drop."""


@dataclass(frozen=True, eq=False)
class ThinningPlan:
    """What becomes of the hanging fruits.

    How many hang on a tree is an expectation, the sum of probabilities; also what is likelier gone, and what no visit
    measured, has its share in it, though none of these is thinned.

    Attributes
    ----------
    rows : (M,) int64
        The hanging fruits among those of the growth.
    clusters, cluster_sizes : (M,) int64
        Cluster of each, and how many hang in it.
    sizes_mm, rates_mm_per_day : (M,) float64
        At the last visit, and between the last two days as measured; NaN for a fruit that one of them did not measure.
    drop : FruitDrop
        Of the M fruits. Where they are no fruitlets any more (`are_fruitlets`), no probability is known; where the two
        days are too close (`FruitDrop.is_told`), none is foretold to drop.
    n_days : float
        Between the last two days.
    places : (M,) float64
        Place of each among as many as are expected to stay on its tree, from 1: a target of so many thins what has a
        higher place. 0 for what no target thins, as it hangs on no tree or beyond those in the order of thinning, and
        NaN for what drops.
    actions : tuple of M str
        `keep`, `drops` or `thin`.
    hang_chances : (M,) float64
        That each is a fruit and hangs.
    n_on_trees : (T,) float64
        How many are expected to hang on each tree of the growth.
    """

    rows: NDArray[np.int64]
    clusters: NDArray[np.int64]
    cluster_sizes: NDArray[np.int64]
    sizes_mm: NDArray[np.float64]
    rates_mm_per_day: NDArray[np.float64]
    drop: FruitDrop
    n_days: float
    places: NDArray[np.float64]
    actions: tuple[str, ...]
    hang_chances: NDArray[np.float64]
    n_on_trees: NDArray[np.float64]

    @property
    def days_to_wait(self) -> int:
        """How many days must lie between two visits that are to tell who will drop, measured and grown as these."""
        return int(np.ceil(self.n_days * self.drop.sigma_mm_per_day / self.drop.wanted_mm_per_day))


def plan_thinning(growth: SeasonGrowth, target_per_tree: int | None = None) -> ThinningPlan:
    """Plan the thinning of all trees.

    Parameters
    ----------
    growth : SeasonGrowth
    target_per_tree : int, optional
        Fruits that a tree shall keep; without, none is thinned.

    Raises
    ------
    PomonaError
        When no fruit was measured on both of the last two days, or there is a target for each tree and none is known.
    """
    fruits = growth.fruits
    if target_per_tree is not None and not any(fruits.trees.names):
        raise PomonaError(
            f"{fruits.path}: found no trees, expected those that shall keep {target_per_tree} each: in its rows none "
            "can be told, `pomona map trees` takes them with --trees FILE or parts rows with --segments METRES"
        )
    rows = np.flatnonzero(fruits.hanging)
    if not rates_are_known(growth):
        raise PomonaError(f"{fruits.path}: found no fruit that was measured on both of the last two days of visits")
    rates, n_days = _rates(growth)
    measured = rates.mm_per_day[rows]
    drop = drop_of(replace(rates, mm_per_day=measured, per_mm=rates.per_mm[rows]))
    if not are_fruitlets(growth):
        drop = replace(drop, probabilities=np.full(len(rows), np.nan), share=0.0)
    clusters = clusters_of(fruits.cloud.positions[rows])
    sizes_mm = growth.foretold.sizes_mm[rows, len(fruits.days) - 1]
    drops = (np.nan_to_num(drop.probabilities) > 0.5) & drop.is_told
    places, chances = np.full(len(rows), np.nan), fruits.hang_chances[rows]
    n_on_trees = _expected_on_trees(fruits)
    for tree, name in enumerate(fruits.trees.names):
        of_tree = np.flatnonzero((fruits.trees.numbers[rows] == tree) & ~drops)
        if not name:
            places[of_tree] = 0.0
            continue
        given_first = _order_of_thinning(of_tree, clusters, sizes_mm)
        dropping = chances[drops & (fruits.trees.numbers[rows] == tree)].sum()
        stay = whole_fruits(n_on_trees[tree]) - whole_fruits(dropping)
        places[given_first] = np.maximum(stay - np.arange(len(given_first)), 0)
    thin = np.zeros(len(rows), dtype=bool) if target_per_tree is None else places > target_per_tree
    actions = tuple(DROPS if gone else THIN if taken else KEEP for gone, taken in zip(drops, thin, strict=True))
    in_cluster = np.bincount(clusters)[clusters]
    return ThinningPlan(
        rows, clusters, in_cluster, sizes_mm, measured, drop, n_days, places, actions, chances, n_on_trees
    )


def _expected_on_trees(fruits: MeasuredFruits) -> NDArray[np.float64]:
    """How many are expected to hang on each tree, (T,), with what no visit measured."""
    names, numbers = fruits.trees.names, fruits.trees.numbers
    measured = np.bincount(numbers, weights=fruits.hang_chances, minlength=len(names))
    return np.asarray(measured + [fruits.unmeasured.get(name, 0.0) for name in names])


def are_fruitlets(growth: SeasonGrowth) -> bool:
    """Tell whether the growth-rate rule is for fruits of this size: in their middle, on the last day."""
    sizes_mm = growth.foretold.sizes_mm[growth.fruits.hanging, len(growth.fruits.days) - 1]
    return bool(np.nanmedian(sizes_mm) <= LARGEST_FRUITLET_MM)


def rates_are_known(growth: SeasonGrowth) -> bool:
    """Tell whether any hanging fruit was measured on both of the last two days, as `plan_thinning` needs."""
    return not bool(np.isnan(_rates(growth)[0].mm_per_day[growth.fruits.hanging]).all())


def _rates(growth: SeasonGrowth) -> tuple[MeasuredRates, float]:
    """Growth between the last two days as it was measured, how it may be off, and the days between.

    The last two of each part of the map, for rows are walked on days of their own; the days between are their mean.
    The scales that the season's fit gives the visits are not taken out of it: fruits that drop are none of the curve's,
    and what they lack of it would be put down to the visit.
    """
    fruits, shape = growth.fruits, growth.curve.fitted.likeliest
    parts = fruits.parts if len(fruits.parts) else np.zeros(len(fruits.ids), np.int64)
    told = np.full((5, len(parts)), np.nan)
    for part in np.unique(parts).tolist():
        own = np.flatnonzero(parts == part)
        told[:, own] = _growth_of(fruits, own)
    mm_per_day, per_mm, *of_parts = told
    known = ~np.isnan(told[2])
    n_days, of_visits, size_mm = (float(each[known].mean()) if known.any() else np.nan for each in of_parts)
    rates = MeasuredRates(
        mm_per_day,
        np.where(known, per_mm, 1.0),
        noise_mm=(shape.noise_mm, _NOISE_SPREAD),
        shared_mm_per_day=shape.visit_spread * size_mm * of_visits / n_days,
        off_mm_per_day=OFF_BY * size_mm / n_days,
    )
    return rates, n_days


def _growth_of(fruits: MeasuredFruits, own: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return of fruits that were visited together, (n,) rows, what their last two days say, (5, n); NaN after one day.

    Rates, and what noise of a millimetre does to each; then of all the days between, the root of what the visits count,
    and the size in the middle.
    """
    sizes_mm = fruits.diameters_mm[own]
    by_day: dict[date, list[int]] = {}
    for visit in np.flatnonzero(~np.isnan(sizes_mm).all(axis=0)).tolist():
        by_day.setdefault(fruits.days[visit], []).append(visit)
    if len(by_day) < 2:
        return np.full((5, len(own)), np.nan)
    columns = [by_day[day] for day in sorted(by_day)[-2:]]
    (before_mm, n_before), (last_mm, n_last) = (_mean_of(sizes_mm[:, of_day]) for of_day in columns)
    before, last = (CALENDAR.times([fruits.moments[visit] for visit in of_day]).mean() for of_day in columns)
    n_days = float(last - before)
    noise = np.sqrt(1.0 / np.maximum(n_before, 1) + 1.0 / np.maximum(n_last, 1)) / n_days
    of_visits = np.sqrt(sum(1.0 / len(of_day) for of_day in columns))
    size_mm = float(np.nanmedian(sizes_mm[:, list(chain(*columns))]))
    of_all = np.tile([[n_days], [of_visits], [size_mm]], len(own))
    return np.vstack([(last_mm - before_mm) / n_days, noise, of_all])


def _mean_of(sizes_mm: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Mean of each row, NaN where there is nothing, and of how many."""
    known = ~np.isnan(sizes_mm)
    counts = known.sum(axis=1)
    return np.asarray(np.where(known, sizes_mm, 0.0).sum(axis=1) / np.where(counts, counts, np.nan)), counts


def _order_of_thinning(
    fruits: NDArray[np.int64], clusters: NDArray[np.int64], sizes_mm: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Put the fruits of a tree in the order in which it gives them: out of the fullest clusters, the smallest first."""
    ordered = fruits[np.lexsort((-sizes_mm[fruits], clusters[fruits]))]
    starts = np.flatnonzero(np.diff(clusters[ordered], prepend=-1))
    # 0 is the largest fruit of its cluster: the higher the place, the fuller is the cluster that it leaves.
    place = np.arange(len(ordered)) - np.repeat(starts, np.diff(starts, append=len(ordered)))
    return ordered[np.lexsort((sizes_mm[ordered], -place))]
