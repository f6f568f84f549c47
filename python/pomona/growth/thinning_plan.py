"""Which fruits to thin: who drops by itself, how many stay, and which of the clusters bear the rest too many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.growth.clusters import clusters_of
from pomona.growth.fruit_drop import LARGEST_FRUITLET_MM, FruitDrop, drop_of
from pomona.growth.season_clock import CALENDAR
from pomona.growth.season_growth import SeasonGrowth

__all__ = ["ThinningPlan", "are_fruitlets", "plan_thinning", "rates_are_known"]

KEEP, DROPS, THIN = "keep", "drops", "thin"


@dataclass(frozen=True, eq=False)
class ThinningPlan:
    """What becomes of the hanging fruits.

    Attributes
    ----------
    rows : (M,) int64
        The hanging fruits among those of the growth.
    clusters, cluster_sizes : (M,) int64
        Cluster of each, and how many hang in it.
    sizes_mm, rates_mm_per_day : (M,) float64
        At the last visit, and between the last two days; NaN for a fruit that one of them did not measure.
    drop : FruitDrop
        Of the M fruits. Where they are no fruitlets any more (`are_fruitlets`), no probability is known.
    places : (M,) float64
        Place of each among those that stay on its tree, from 1: a target of so many thins what has a higher place. 0
        for what hangs on no tree, which no target thins, and NaN for what drops.
    actions : tuple of M str
        `keep`, `drops` or `thin`.
    """

    rows: NDArray[np.int64]
    clusters: NDArray[np.int64]
    cluster_sizes: NDArray[np.int64]
    sizes_mm: NDArray[np.float64]
    rates_mm_per_day: NDArray[np.float64]
    drop: FruitDrop
    places: NDArray[np.float64]
    actions: tuple[str, ...]


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
    rates, noise = _rates(growth)
    if not rates_are_known(growth):
        raise PomonaError(f"{fruits.path}: found no fruit that was measured on both of the last two days of visits")
    drop = drop_of(rates[rows], noise)
    if not are_fruitlets(growth):
        drop = FruitDrop(np.full(len(rows), np.nan), drop.fast_mm_per_day, 0.0)
    clusters = clusters_of(fruits.cloud.positions[rows])
    sizes_mm = growth.foretold.sizes_mm[rows, len(fruits.days) - 1]
    drops = np.nan_to_num(drop.probabilities) > 0.5
    places = np.full(len(rows), np.nan)
    for tree, name in enumerate(fruits.trees.names):
        of_tree = np.flatnonzero((fruits.trees.numbers[rows] == tree) & ~drops)
        if not name:
            places[of_tree] = 0.0
            continue
        given_first = _order_of_thinning(of_tree, clusters, sizes_mm)
        places[given_first] = np.arange(len(of_tree), 0, -1)
    thin = np.zeros(len(rows), dtype=bool) if target_per_tree is None else places > target_per_tree
    actions = tuple(DROPS if gone else THIN if taken else KEEP for gone, taken in zip(drops, thin, strict=True))
    return ThinningPlan(rows, clusters, np.bincount(clusters)[clusters], sizes_mm, rates[rows], drop, places, actions)


def are_fruitlets(growth: SeasonGrowth) -> bool:
    """Tell whether the growth-rate rule is for fruits of this size: in their middle, on the last day."""
    sizes_mm = growth.foretold.sizes_mm[growth.fruits.hanging, len(growth.fruits.days) - 1]
    return bool(np.nanmedian(sizes_mm) <= LARGEST_FRUITLET_MM)


def rates_are_known(growth: SeasonGrowth) -> bool:
    """Tell whether any hanging fruit was measured on both of the last two days, as `plan_thinning` needs."""
    return not bool(np.isnan(_rates(growth)[0][growth.fruits.hanging]).all())


def _rates(growth: SeasonGrowth) -> tuple[NDArray[np.float64], float]:
    """Growth between the last two days, the errors that visits share taken out, and its noise, mm a day."""
    fruits = growth.fruits
    before, last = sorted(set(fruits.days))[-2:]
    days = np.array(fruits.days)
    corrected = fruits.diameters_mm / growth.foretold.scales
    sizes = [_mean_of(corrected[:, np.flatnonzero(days == day)]) for day in (before, last)]
    moments = [
        CALENDAR.times([moment for moment in fruits.moments if moment.date() == day]).mean() for day in (before, last)
    ]
    n_days = float(moments[1] - moments[0])
    return (sizes[1] - sizes[0]) / n_days, float(np.sqrt(2.0) * growth.curve.fitted.likeliest.noise_mm / n_days)


def _mean_of(sizes_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of each row, NaN where there is nothing."""
    known = ~np.isnan(sizes_mm)
    return np.asarray(
        np.where(known, sizes_mm, 0.0).sum(axis=1) / np.where(known.any(axis=1), known.sum(axis=1), np.nan)
    )


def _order_of_thinning(
    fruits: NDArray[np.int64], clusters: NDArray[np.int64], sizes_mm: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Put the fruits of a tree in the order in which it gives them: out of the fullest clusters, the smallest first."""
    ordered = fruits[np.lexsort((-sizes_mm[fruits], clusters[fruits]))]
    starts = np.flatnonzero(np.diff(clusters[ordered], prepend=-1))
    # 0 is the largest fruit of its cluster: the higher the place, the fuller is the cluster that it leaves.
    place = np.arange(len(ordered)) - np.repeat(starts, np.diff(starts, append=len(ordered)))
    return ordered[np.lexsort((sizes_mm[ordered], -place))]
