"""Where fruits hang: in clusters under the tips of spurs, as big as at the harvest beside one another and the wood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from pomona.errors import PomonaError
from pomona.synth.living.axis_growth import unit
from pomona.synth.living.wood import NODES, along_axes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.design import RowDesign
    from pomona.synth.living.spurs import Spurs
    from pomona.synth.living.wood import WoodAxes

__all__ = ["FruitPlaces", "hang_fruits"]

_STALKS_M = (0.014, 0.032)
_LOWEST_SPUR_M = 0.35
_ROUNDS, _ROUNDS_ON_ITS_SPUR = 240, 10
_WOOD_POINTS = 3 * NODES
"""Of an axis, at which fruits keep clear of it."""


@dataclass(frozen=True, eq=False)
class FruitPlaces:
    """Places of fruits at the harvest on unbent wood.

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
    on, slots = _clusters(rng, design, of_tree, trees)
    heights = design.apple.height_share * diameters_m
    n = len(trees)
    found = FruitPlaces(on, np.zeros((n, 3)), np.zeros(n), np.full((n, 3), np.nan))
    points, radii = _wood_points(wood)
    wood_tree = cKDTree(points)
    open_ = np.arange(n)
    for round_ in range(_ROUNDS):
        if len(open_) == 0:
            return found
        if round_ >= _ROUNDS_ON_ITS_SPUR:
            on[open_] = [int(rng.choice(of_tree[tree])) for tree in trees[open_]]
            slots[open_] = rng.uniform(0.0, 2.0 * np.pi, len(open_))
        hangs, stalks = _proposed(rng, slots[open_])
        centres = tips[on[open_]] + hangs * (stalks + heights[open_] / 2.0)[:, None]
        free = _clear_of_wood(wood_tree, points, radii, centres, diameters_m[open_] / 2.0)
        free &= _clear_of_fruits(centres, diameters_m[open_] / 2.0, found.centres_m, diameters_m / 2.0, free)
        placed = open_[free]
        found.hangs[placed], found.stalks_m[placed], found.centres_m[placed] = hangs[free], stalks[free], centres[free]
        open_ = open_[~free]
    tree = int(trees[open_[0]])
    wanted = int((trees == tree).sum())
    room = wanted - int((trees[open_] == tree).sum())
    raise PomonaError(f"fruits_per_tree: tree {tree} has room for {room} of {wanted} fruits, expected fewer")


def _clusters(
    rng: np.random.Generator, design: RowDesign, of_tree: list[NDArray[np.int64]], trees: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Spur of each fruit, and its azimuth in its cluster; spurs are taken once before any is taken twice."""
    on, azimuths = np.empty(len(trees), np.int64), np.empty(len(trees))
    for tree, spurs in enumerate(of_tree):
        fruits = np.flatnonzero(trees == tree)
        if len(fruits) and len(spurs) == 0:
            raise PomonaError(f"spurs_per_tree: tree {tree} has none high enough, expected more")
        sizes = 1 + rng.choice(len(design.cluster_sizes), len(fruits), p=design.cluster_sizes)
        cluster = np.repeat(np.arange(len(fruits)), sizes)[: len(fruits)]
        number = np.arange(len(fruits)) - np.searchsorted(cluster, cluster)
        order = rng.permutation(spurs)
        on[fruits] = order[cluster % max(len(order), 1)] if len(fruits) else 0
        start = rng.uniform(0.0, 2.0 * np.pi, len(fruits) + 1)
        azimuths[fruits] = start[cluster] + 2.0 * np.pi * number / sizes[cluster] if len(fruits) else 0.0
    return on, azimuths


def _proposed(
    rng: np.random.Generator, azimuths: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions in which fruits hang, mostly down, and lengths of stalks."""
    n = len(azimuths)
    tilt = np.abs(rng.normal(0.35, 0.35, n)).clip(0.0, 1.4)
    azimuth = azimuths + rng.normal(0.0, 0.5, n)
    level = np.sin(tilt)
    hangs = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -np.cos(tilt)], axis=1)
    return unit(hangs), rng.uniform(*_STALKS_M, n)


def _wood_points(wood: WoodAxes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    axes = np.repeat(np.arange(len(wood)), _WOOD_POINTS)
    places = np.tile(np.linspace(0.0, 1.0, _WOOD_POINTS), len(wood))
    return along_axes(wood.nodes_m, axes, places), along_axes(wood.radii_m, axes, places)


def _clear_of_wood(
    wood_tree: cKDTree,
    points: NDArray[np.float64],
    radii: NDArray[np.float64],
    centres: NDArray[np.float64],
    fruit_radii: NDArray[np.float64],
) -> NDArray[np.bool_]:
    near = min(8, len(points))
    gaps, which = wood_tree.query(centres, k=near)
    return np.asarray((gaps >= fruit_radii[:, None] + radii[which]).all(axis=1))


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
