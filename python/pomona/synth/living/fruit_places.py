"""Where fruits hang: in clusters under the tips of spurs, with room beside one another and the wood when full grown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from pomona.errors import PomonaError
from pomona.synth.living.axis_growth import unit
from pomona.synth.living.contact import WoodPoints, rods_as_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pomona.synth.living.design import RowDesign
    from pomona.synth.living.spurs import Spurs
    from pomona.synth.living.wood import WoodAxes
    from pomona.synth.row_geometry import Limbs

__all__ = ["FruitPlaces", "hang_beside", "hang_fruits"]

_STALKS_M, _STALKS_IN_CLUSTER_M = (0.014, 0.032), (0.018, 0.045)
_LOWEST_SPUR_M = 0.35
_BEARING_IN_LIGHT = 2.5
"""Log-odds of a spur at the tree's face to bear against one at its middle: flower buds form where there is light."""

_ROUNDS, _ROUNDS_ON_ITS_SPUR = 200, 60


@dataclass(frozen=True, eq=False)
class FruitPlaces:
    """Places of full-grown fruits on unbent wood.

    Attributes
    ----------
    spurs : (F,) int64
    hangs : (F, 3)
        From the spur's tip to the fruit.
    stalks_m : (F,)
    centres_m : (F, 3)
    """

    spurs: NDArray[np.int64]
    hangs: NDArray[np.float64]
    stalks_m: NDArray[np.float64]
    centres_m: NDArray[np.float64]


def hang_fruits(
    rng: np.random.Generator,
    design: RowDesign,
    wood: WoodAxes,
    spurs: Spurs,
    trees: NDArray[np.int64],
    diameters_m: NDArray[np.float64],
) -> FruitPlaces:
    """Find a place for every fruit, (F,) trees and diameters.

    All that have none yet propose one in each round; what is in the way of the wood, of a placed fruit or of an
    earlier proposal tries again, after some rounds on another spur.

    Raises
    ------
    PomonaError
        When fruits are left over.
    """
    tips = spurs.roots(wood.nodes_m) + spurs.offsets_m
    high = np.flatnonzero(tips[:, 2] > _LOWEST_SPUR_M)
    of_tree = [high[spurs.trees[high] == tree] for tree in range(design.n_trees)]
    bearing = _BEARING_IN_LIGHT * np.minimum(np.abs(tips[:, 1]) / design.training.depth_m, 1.0)
    on, slots, alone = _clusters(rng, design, of_tree, bearing, trees)
    heights = design.apple.height_share * diameters_m
    n = len(trees)
    found = FruitPlaces(on, np.zeros((n, 3)), np.zeros(n), np.full((n, 3), np.nan))
    rods = WoodPoints(wood.nodes_m, wood.radii_m)
    open_ = np.arange(n)
    for round_ in range(_ROUNDS):
        if len(open_) == 0:
            return found
        if round_ >= _ROUNDS_ON_ITS_SPUR:
            on[open_] = [int(rng.choice(of_tree[tree])) for tree in trees[open_]]
            slots[open_] = rng.uniform(0.0, 2.0 * np.pi, len(open_))
        hangs, stalks = _proposed(rng, slots[open_], alone[open_])
        centres = tips[on[open_]] + hangs * (stalks + heights[open_] / 2.0)[:, None]
        free = _clear_of([rods], centres, diameters_m[open_] / 2.0)
        free &= _clear_of_fruits(centres, diameters_m[open_] / 2.0, found.centres_m, diameters_m / 2.0, free)
        placed = open_[free]
        found.hangs[placed], found.stalks_m[placed], found.centres_m[placed] = hangs[free], stalks[free], centres[free]
        open_ = open_[~free]
    tree = int(trees[open_[0]])
    wanted = int((trees == tree).sum())
    room = wanted - int((trees[open_] == tree).sum())
    raise PomonaError(f"fruits_per_tree: tree {tree} has room for {room} of {wanted} fruits, expected fewer")


def hang_beside(
    rng: np.random.Generator,
    design: RowDesign,
    wood: WoodAxes,
    spurs: Spurs,
    places: FruitPlaces,
    diameters_m: NDArray[np.float64],
    supports: Limbs,
) -> FruitPlaces:
    """Hang fruits that stand in posts or wires otherwise on their own spurs, with a chance of its own.

    All others stay as they are, and so does what follows from the spurs. A fruit that finds no such place stays too: it
    is pushed aside on the day.
    """
    posts = rods_as_points(supports)
    in_the_way = [WoodPoints(wood.nodes_m, wood.radii_m), *posts]
    radii, heights = diameters_m / 2.0, design.apple.height_share * diameters_m
    tips = spurs.roots(wood.nodes_m) + spurs.offsets_m
    alone = np.bincount(places.spurs, minlength=len(spurs))[places.spurs] == 1
    hangs, stalks, centres = places.hangs.copy(), places.stalks_m.copy(), places.centres_m.copy()
    open_ = np.flatnonzero(~_clear_of(posts, centres, radii))
    centres[open_] = np.nan
    for _ in range(_ROUNDS):
        if len(open_) == 0:
            break
        proposed, lengths = _proposed(rng, rng.uniform(0.0, 2.0 * np.pi, len(open_)), alone[open_])
        at = tips[places.spurs[open_]] + proposed * (lengths + heights[open_] / 2.0)[:, None]
        free = _clear_of(in_the_way, at, radii[open_])
        free &= _clear_of_fruits(at, radii[open_], centres, radii, free)
        placed = open_[free]
        hangs[placed], stalks[placed], centres[placed] = proposed[free], lengths[free], at[free]
        open_ = open_[~free]
    centres[open_] = places.centres_m[open_]
    return FruitPlaces(places.spurs, hangs, stalks, centres)


def _clusters(
    rng: np.random.Generator,
    design: RowDesign,
    of_tree: list[NDArray[np.int64]],
    bearing: NDArray[np.float64],
    trees: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Spur of each fruit, its azimuth in its cluster, whether it is alone; no spur twice before all once.

    `bearing`, (S,), are log-odds of a spur to bear: sorted with Gumbel's noise they are drawn without replacement.
    """
    on, azimuths, alone = np.empty(len(trees), np.int64), np.empty(len(trees)), np.empty(len(trees), bool)
    for tree, spurs in enumerate(of_tree):
        fruits = np.flatnonzero(trees == tree)
        if len(fruits) and len(spurs) == 0:
            raise PomonaError(f"spurs_per_tree: tree {tree} has none high enough, expected more")
        sizes = 1 + rng.choice(len(design.cluster_sizes), len(fruits), p=design.cluster_sizes)
        cluster = np.repeat(np.arange(len(fruits)), sizes)[: len(fruits)]
        number = np.arange(len(fruits)) - np.searchsorted(cluster, cluster)
        order = spurs[np.argsort(-bearing[spurs] - rng.gumbel(size=len(spurs)))]
        on[fruits] = order[cluster % max(len(order), 1)] if len(fruits) else 0
        alone[fruits] = sizes[cluster] == 1 if len(fruits) else True
        start = rng.uniform(0.0, 2.0 * np.pi, len(fruits) + 1)
        azimuths[fruits] = start[cluster] + 2.0 * np.pi * number / sizes[cluster] if len(fruits) else 0.0
    return on, azimuths, alone


def _proposed(
    rng: np.random.Generator, azimuths: NDArray[np.float64], alone: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions in which fruits hang, and lengths of stalks: those of a cluster push one another up."""
    n = len(azimuths)
    tilt = np.where(alone, np.abs(rng.normal(0.0, 0.4, n)), rng.uniform(0.2, 1.5, n))
    azimuth = azimuths + rng.normal(0.0, 0.5, n)
    level = np.sin(tilt)
    hangs = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -np.cos(tilt)], axis=1)
    return unit(hangs), np.where(alone, rng.uniform(*_STALKS_M, n), rng.uniform(*_STALKS_IN_CLUSTER_M, n))


def _clear_of(
    in_the_way: Sequence[WoodPoints], centres: NDArray[np.float64], radii: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether balls are clear of wood."""
    clear = np.ones(len(centres), bool)
    for each in in_the_way if len(centres) else ():
        clear &= each.depths_m(centres, radii).max(axis=1) <= 0.0
    return clear


def _clear_of_fruits(
    centres: NDArray[np.float64],
    radii: NDArray[np.float64],
    placed: NDArray[np.float64],
    placed_radii: NDArray[np.float64],
    in_play: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Whether proposals are clear of placed fruits and of earlier proposals that are in play."""
    clear = in_play.copy()
    hung = np.flatnonzero(np.isfinite(placed[:, 0]))
    all_centres = np.concatenate([placed[hung], centres])
    all_radii = np.concatenate([placed_radii[hung], radii])
    pairs = cKDTree(all_centres).query_pairs(2.0 * float(all_radii.max()), output_type="ndarray")
    gaps = np.linalg.norm(all_centres[pairs[:, 0]] - all_centres[pairs[:, 1]], axis=1)
    close = pairs[gaps < all_radii[pairs].sum(axis=1)]
    close = close[np.lexsort((close[:, 0], close[:, 1]))] - len(hung)
    for first, second in close[close[:, 1] >= 0]:
        clear[second] &= first >= 0 and not clear[first]
    return clear
