"""Training systems: how the wood of a tree is led, with the figures of a planting."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.axis_growth import Sprouts, grow_axes, perpendiculars, trunks, unit
from pomona.synth.living.wood import WoodAxes, joined

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["GOLDEN_ANGLE_RAD", "SYSTEMS", "TrainingSystem", "grow_wood"]

GOLDEN_ANGLE_RAD = np.pi * (3.0 - np.sqrt(5.0))
"""Between one branch or leaf and the next around a stem."""

_TIED = 6.0
"""Stiffness of wood that is tied to wires every half metre against the same wood untied."""


@dataclass(frozen=True)
class TrainingSystem:
    """One way to lead trees.

    Attributes
    ----------
    spacing_m, height_m
        Of a usual planting.
    depth_m
        How far its branches reach to either side of the row.
    wires_m
        Heights of the wires.
    post_every_trees
        A post stands at both ends and after so many trees.
    frame
        Grows trunks and the wood that bears laterals: (rng, feet (T, 3), system) to axes.
    lateral_gap_m, lateral_lengths_m
        Between laterals along the wood, and their least and greatest length.
    """

    spacing_m: float
    height_m: float
    depth_m: float
    wires_m: tuple[float, ...]
    post_every_trees: int
    frame: Callable[[np.random.Generator, NDArray[np.float64], TrainingSystem], WoodAxes]
    lateral_gap_m: float
    lateral_lengths_m: tuple[float, float]

    def resized(self, spacing_m: float, height_m: float) -> TrainingSystem:
        """Give the system at another spacing and height; 0 keeps its own. Wires above the trees are left out."""
        spacing, height = spacing_m or self.spacing_m, height_m or self.height_m
        wires = tuple(wire for wire in self.wires_m if wire <= height)
        return replace(self, spacing_m=spacing, height_m=height, wires_m=wires)


def grow_wood(rng: np.random.Generator, feet_m: NDArray[np.float64], system: TrainingSystem) -> WoodAxes:
    """Grow trees on feet, (T, 3): the frame of the system, laterals on it, and shoots of the year."""
    frame = system.frame(rng, feet_m, system)
    return _with_shoots(rng, _with_laterals(rng, frame, system))


def _spindle(rng: np.random.Generator, feet: NDArray[np.float64], system: TrainingSystem) -> WoodAxes:
    """Branches all around a central leader, long and flat below, short and steep above."""
    wood = trunks(rng, feet, system.height_m, (0.032, 0.005))
    per_tree = round(7.0 * system.height_m)
    tree = np.repeat(np.arange(len(feet)), per_tree)
    number = np.tile(np.arange(per_tree), len(feet))
    place = 0.17 + 0.79 * (number + rng.uniform(0.1, 0.9, len(number))) / per_tree
    azimuth = number * GOLDEN_ANGLE_RAD + rng.uniform(0.0, 2.0 * np.pi, len(feet))[tree]
    azimuth += rng.normal(0.0, 0.3, len(number))
    along, across = 0.62 * system.spacing_m * np.cos(azimuth), system.depth_m * np.sin(azimuth)
    length = np.hypot(along, across) * (1.15 - 0.75 * place) * rng.uniform(0.75, 1.15, len(number))
    rise = 0.15 + 0.5 * place + rng.normal(0.0, 0.1, len(number))
    outward = unit(np.stack([along, across, np.hypot(along, across) * rise], axis=1))
    branches = grow_axes(
        rng, wood, Sprouts(tree, place), outward, length, radii_m=(0.0115, 0.003), lift=-0.35, wobble=0.25
    )
    return joined([wood, branches])


def _cordon(rng: np.random.Generator, feet: NDArray[np.float64], system: TrainingSystem) -> WoodAxes:
    """Two low arms, half a spacing each way, and uprights on them up to the top."""
    low = 0.5
    wood = trunks(rng, feet, low, (0.035, 0.028))
    tree = np.repeat(np.arange(len(feet)), 2)
    side = np.tile([-1.0, 1.0], len(feet))
    outward = np.stack([side, np.zeros(len(side)), np.full(len(side), 0.45)], axis=1)
    length = np.full(len(side), 0.53 * system.spacing_m)
    arms = grow_axes(
        rng, wood, Sprouts(tree, np.ones(len(side))), outward, length,
        radii_m=(0.024, 0.013), lift=-0.6, wobble=0.05, stiffness=_TIED, bears=False,
    )  # fmt: skip
    wood = joined([wood, arms])
    per_arm = max(2, round(0.5 * system.spacing_m / 0.28))
    arm = len(feet) + np.repeat(np.arange(len(side)), per_arm)
    place = (np.tile(np.arange(per_arm), len(side)) + rng.uniform(0.35, 0.65, len(arm))) / per_arm
    sprouts = Sprouts(arm, place)
    up = np.tile([0.0, 0.0, 1.0], (len(arm), 1)) + rng.normal(0.0, 0.05, (len(arm), 3)) * [1.0, 0.4, 0.0]
    length = (system.height_m - sprouts.roots(wood)[:, 2]) * rng.uniform(0.85, 1.0, len(arm))
    uprights = grow_axes(
        rng, wood, sprouts, up, length, radii_m=(0.013, 0.004), wobble=0.06, stiffness=_TIED, bears=True
    )
    return joined([wood, uprights])


def _wall(rng: np.random.Generator, feet: NDArray[np.float64], system: TrainingSystem) -> WoodAxes:
    """Arms both ways along every wire, from the trunk to halfway to the next."""
    wood = trunks(rng, feet, system.height_m, (0.034, 0.008))
    heights = np.tile(np.repeat(system.wires_m, 2), len(feet))
    tree = np.repeat(np.arange(len(feet)), 2 * len(system.wires_m))
    side = np.tile([-1.0, 1.0], len(tree) // 2)
    place = np.clip(heights / system.height_m - 0.03 + rng.normal(0.0, 0.01, len(tree)), 0.05, 1.0)
    outward = np.stack([side, rng.normal(0.0, 0.06, len(tree)), rng.uniform(0.2, 0.45, len(tree))], axis=1)
    length = 0.54 * system.spacing_m * rng.uniform(0.85, 1.05, len(tree))
    arms = grow_axes(
        rng, wood, Sprouts(tree, place), outward, length,
        radii_m=(0.012, 0.004), lift=-0.45, wobble=0.12, stiffness=_TIED,
    )  # fmt: skip
    return joined([wood, arms])


def _stations(rng: np.random.Generator, wood: WoodAxes, gap_m: float, least: float) -> Sprouts:
    """Places about every `gap_m` along the wood that bears, from `least` of it on."""
    bearing = np.flatnonzero(wood.bears)
    count = np.maximum(1, np.round(wood.lengths_m[bearing] * (1.0 - least) / gap_m)).astype(np.int64)
    axes = np.repeat(bearing, count)
    number = np.arange(len(axes)) - np.repeat(np.cumsum(count) - count, count)
    places = least + (0.98 - least) * (number + rng.uniform(0.1, 0.9, len(axes))) / np.repeat(count, count)
    return Sprouts(axes, places)


def _with_laterals(rng: np.random.Generator, wood: WoodAxes, system: TrainingSystem) -> WoodAxes:
    """Side branches, in turn to either side, shorter towards the tip of what bears them."""
    sprouts = _stations(rng, wood, system.lateral_gap_m, 0.12)
    n = len(sprouts)
    tangents = wood.tangents(sprouts.axes, sprouts.places)
    azimuths = np.where(np.arange(n) % 2 == 0, 0.0, np.pi) + rng.normal(0.35, 0.5, n)
    directions = perpendiculars(tangents, azimuths) * [0.8, 1.0, 1.0] + 0.6 * tangents
    length = rng.uniform(*system.lateral_lengths_m, n) * (1.1 - 0.5 * sprouts.places)
    laterals = grow_axes(rng, wood, sprouts, directions, length, radii_m=(0.0048, 0.0022), lift=0.15, wobble=0.35)
    return joined([wood, laterals])


def _with_shoots(rng: np.random.Generator, wood: WoodAxes) -> WoodAxes:
    """Leafy shoots of the year, rising from the wood; they bear nothing yet."""
    sprouts = _stations(rng, wood, 0.4, 0.25)
    n = len(sprouts)
    tangents = wood.tangents(sprouts.axes, sprouts.places)
    directions = 0.7 * perpendiculars(tangents, rng.uniform(0.0, np.pi, n)) + 0.5 * tangents + [0.0, 0.0, 0.45]
    length = rng.uniform(0.12, 0.34, n)
    shoots = grow_axes(rng, wood, sprouts, directions, length, radii_m=(0.0026, 0.0013), lift=0.2, bears=False)
    return joined([wood, shoots])


SYSTEMS = {
    "spindle": TrainingSystem(1.2, 3.2, 0.55, (0.6, 1.4, 2.2, 3.0), 5, _spindle, 0.12, (0.10, 0.32)),
    "cordon": TrainingSystem(2.0, 2.8, 0.3, (0.5, 1.1, 1.7, 2.3, 2.8), 4, _cordon, 0.10, (0.08, 0.28)),
    "wall": TrainingSystem(1.2, 2.7, 0.25, (0.5, 1.0, 1.5, 2.0, 2.5), 5, _wall, 0.08, (0.08, 0.24)),
}
"""A slender spindle, a planar cordon of uprights (biaxis, guyot), a wall of arms along wires (trellis)."""
