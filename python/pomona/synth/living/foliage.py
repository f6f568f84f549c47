"""Leaves: rosettes around the tips of spurs, and leaves in a spiral along the shoots, all turned to the light."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.axis_growth import perpendiculars, unit
from pomona.synth.living.training_systems import GOLDEN_ANGLE_RAD
from pomona.synth.living.wood import along_axes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.design import RowDesign
    from pomona.synth.living.spurs import Spurs
    from pomona.synth.living.wood import WoodAxes

__all__ = ["Foliage", "grow_leaves"]

_PETIOLES_M = (0.012, 0.035)
_WIDTH_SHARE, _LENGTH_SPREAD = 0.58, 0.2
"""Of a blade's width against its length; of its length about the mean."""

_FOLDS_RAD, _BENDS_RAD = (0.1, 0.5), (0.1, 0.9)
_GREEN, _YOUNG_GREEN = np.array([0.055, 0.130, 0.022]), np.array([0.105, 0.215, 0.036])
_TURNS_AFTER_BLOOM_DAYS, _TURN_SPREAD_DAYS = 190.0, 15.0
_FALLS_AFTER_TURNING_DAYS = (8.0, 28.0)


@dataclass(frozen=True, eq=False)
class Foliage:
    """Leaves on unbent wood, full grown.

    Attributes
    ----------
    axes : (L,) int64
    places : (L,)
    offsets_m : (L, 3)
        From the middle of the axis to the base of the blade.
    tips, normals : (L, 3)
    lengths_m, widths_m, folds_rad, bends_rad : (L,)
    greens : (L, 3)
    turning_days, falling_days : (L,)
        After bloom: when it turns yellow, and falls.
    """

    axes: NDArray[np.int64]
    places: NDArray[np.float64]
    offsets_m: NDArray[np.float64]
    tips: NDArray[np.float64]
    normals: NDArray[np.float64]
    lengths_m: NDArray[np.float64]
    widths_m: NDArray[np.float64]
    folds_rad: NDArray[np.float64]
    bends_rad: NDArray[np.float64]
    greens: NDArray[np.float64]
    turning_days: NDArray[np.float64]
    falling_days: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.axes)


def grow_leaves(rng: np.random.Generator, design: RowDesign, wood: WoodAxes, spurs: Spurs) -> Foliage:
    """Grow the leaves of all trees: half of them in rosettes."""
    per_tree = design.leaves_per_tree
    in_rosettes = per_tree // 2
    parts = [
        _rosettes(rng, design, wood, spurs, in_rosettes),
        _shoot_leaves(rng, design, wood, per_tree - in_rosettes),
    ]
    return Foliage(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Foliage)))


def _rosettes(rng: np.random.Generator, design: RowDesign, wood: WoodAxes, spurs: Spurs, per_tree: int) -> Foliage:
    """Leaves around spurs in a golden spiral, as many on each as can be even."""
    spur = np.concatenate(
        [of_tree[np.arange(per_tree) % len(of_tree)] for of_tree in _by_tree(spurs.trees, design.n_trees)]
    )
    turn = np.concatenate([np.arange(per_tree) // design.spurs_per_tree] * design.n_trees) * GOLDEN_ANGLE_RAD
    heading = unit(spurs.offsets_m[spur])
    across = perpendiculars(heading, turn + rng.uniform(0.0, 2.0 * np.pi, len(spurs))[spur])
    outward = unit(across + 0.45 * heading)
    return _leaves(rng, design, wood, spurs.axes[spur], spurs.places[spur], spurs.offsets_m[spur], outward, _GREEN)


def _by_tree(trees: NDArray[np.int64], n_trees: int) -> list[NDArray[np.int64]]:
    return [np.flatnonzero(trees == tree) for tree in range(n_trees)]


def _shoot_leaves(rng: np.random.Generator, design: RowDesign, wood: WoodAxes, per_tree: int) -> Foliage:
    """Leaves along the thin wood, one a golden angle after the other; shoots are twice as leafy as branches."""
    density = wood.lengths_m * np.where(wood.orders == wood.orders.max(), 2.0, 1.0) * (wood.radii_m[:, 0] < 0.014)
    axes, places = [], []
    for of_tree in _by_tree(wood.trees, design.n_trees):
        ends = np.cumsum(density[of_tree])
        at = (np.arange(per_tree) + rng.uniform(0.1, 0.9, per_tree)) / max(per_tree, 1) * ends[-1]
        which = np.searchsorted(ends, at)
        axes.append(of_tree[which])
        places.append(1.0 - (ends[which] - at) / density[of_tree][which])
    axis, place = np.concatenate(axes), np.clip(np.concatenate(places), 0.05, 1.0)
    tangents = wood.tangents(axis, place)
    across = perpendiculars(tangents, np.arange(len(axis)) * GOLDEN_ANGLE_RAD + rng.normal(0.0, 0.2, len(axis)))
    offsets = across * along_axes(wood.radii_m, axis, place)[:, None]
    young = np.where((wood.bears[axis]), 0.15, 0.3 + 0.7 * place)[:, None]
    greens = (1.0 - young) * _GREEN + young * _YOUNG_GREEN
    return _leaves(rng, design, wood, axis, place, offsets, unit(across + 0.4 * tangents), greens)


def _leaves(
    rng: np.random.Generator,
    design: RowDesign,
    wood: WoodAxes,
    axes: NDArray[np.int64],
    places: NDArray[np.float64],
    offsets: NDArray[np.float64],
    outward: NDArray[np.float64],
    greens: NDArray[np.float64],
) -> Foliage:
    """Put blades on petioles that point outwards: they droop, and their upper sides look to the light."""
    n = len(axes)
    depth = (along_axes(wood.nodes_m, axes, places) + offsets)[:, 1] / design.training.depth_m
    light = np.stack([np.zeros(n), 0.75 * np.clip(depth, -1.5, 1.5), np.ones(n)], axis=1) + rng.normal(0.0, 0.3, (n, 3))
    tips = unit(outward + rng.uniform(-0.2, 0.75, n)[:, None] * [0.0, 0.0, -1.0] + rng.normal(0.0, 0.2, (n, 3)))
    normals = unit(light - (light * tips).sum(axis=1, keepdims=True) * tips)
    lengths = design.leaf_length_m * np.exp(rng.normal(0.0, _LENGTH_SPREAD, n))
    turning = rng.normal(_TURNS_AFTER_BLOOM_DAYS, _TURN_SPREAD_DAYS, n)
    return Foliage(
        axes,
        places,
        offsets + outward * rng.uniform(*_PETIOLES_M, n)[:, None],
        tips,
        normals,
        lengths,
        lengths * _WIDTH_SHARE * rng.uniform(0.85, 1.15, n),
        rng.uniform(*_FOLDS_RAD, n),
        rng.uniform(*_BENDS_RAD, n),
        greens * np.exp(rng.normal(0.0, 0.18, (n, 1))) * np.exp(rng.normal(0.0, 0.06, (n, 3))),
        turning,
        turning + rng.uniform(*_FALLS_AFTER_TURNING_DAYS, n),
    )
