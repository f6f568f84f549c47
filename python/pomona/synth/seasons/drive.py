"""How one visit drives along the row: which side, which way, from which tree to which."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.seasons.season_plan import SeasonPlan

__all__ = ["Drive", "plan_drive"]

_DISTANCE_M, _HEIGHT_M, _STEP_M = 1.7, 1.5, 0.25
_LOOK_ASIDE_M = 0.6
"""A camera that begins beside a tree sees so much of the one before; a drive that misses a tree begins further on."""

_SIDEWAYS_M, _HEIGHT_SPREAD_M = 0.05, 0.15


@dataclass(frozen=True, eq=False)
class Drive:
    """The way of a camera that looks straight across the row.

    Attributes
    ----------
    side
        "near" is at -y and looks along +y.
    backwards
        Whether it drives towards -x.
    cameras_m : (K, 3)
        Its places in the row frame, in the order of the frames.
    """

    side: Literal["near", "far"]
    backwards: bool
    cameras_m: NDArray[np.float64]


def plan_drive(rng: np.random.Generator, plan: SeasonPlan, number: int) -> Drive:
    """Draw the drive of a visit; where both sides are driven, every second visit takes the far one."""
    far = plan.both_sides and number % 2 == 1
    backwards = bool(rng.random() < 0.5)
    spacing = plan.design.training.spacing_m
    begin, end = -0.5 * spacing, (plan.design.n_trees - 0.5) * spacing
    left_out = rng.integers(3)
    if plan.skips_end_trees and plan.design.n_trees > 1:
        missed = spacing + _LOOK_ASIDE_M
        begin, end = begin + missed * (left_out == 1), end - missed * (left_out == 2)
    x = np.arange(begin, max(end, begin + _STEP_M), _STEP_M)
    side = 1.0 if far else -1.0
    wander = np.cumsum(rng.normal(0.0, 0.01, (2, len(x))), axis=1)
    distance = _DISTANCE_M + rng.normal(0.0, _SIDEWAYS_M) + wander[0]
    height = _HEIGHT_M + rng.normal(0.0, _HEIGHT_SPREAD_M) + wander[1]
    cameras = np.stack([x, side * distance, height], axis=1)
    return Drive("far" if far else "near", backwards, cameras[::-1] if backwards else cameras)
