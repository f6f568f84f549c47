"""Grass under and beside the row: narrow blades in tufts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.axis_growth import unit
from pomona.synth.row_geometry import Leaves

if TYPE_CHECKING:
    from pomona.synth.living.design import RowDesign

__all__ = ["grow_grass"]

_HALF_DEPTH_M, _BLADES_PER_TUFT, _TUFT_RADIUS_M = 1.6, 12, 0.06
_LENGTHS_M, _WIDTHS_M = (0.06, 0.22), (0.004, 0.009)
_GREEN = np.array([0.075, 0.135, 0.028])


def grow_grass(rng: np.random.Generator, design: RowDesign) -> Leaves:
    """Grow tufts over the strip of the row; they stay as they are, mown, over the season."""
    spacing = design.training.spacing_m
    begin, end = -1.5 * spacing, (design.n_trees + 0.5) * spacing
    tufts = round(design.grass_blades_per_m2 * (end - begin) * 2.0 * _HALF_DEPTH_M / _BLADES_PER_TUFT)
    n = tufts * _BLADES_PER_TUFT
    feet = rng.uniform([begin, -_HALF_DEPTH_M, 0.0], [end, _HALF_DEPTH_M, 0.0], (tufts, 3))
    bases = np.repeat(feet, _BLADES_PER_TUFT, axis=0) + rng.normal(0.0, _TUFT_RADIUS_M, (n, 3)) * [1.0, 1.0, 0.0]
    tips = unit(rng.normal(0.0, 0.4, (n, 3)) * [1.0, 1.0, 0.2] + [0.0, 0.0, 1.0])
    level = rng.normal(size=(n, 3))
    normals = unit(level - (level * tips).sum(axis=1, keepdims=True) * tips)
    return Leaves(
        bases,
        tips,
        normals,
        rng.uniform(*_LENGTHS_M, n),
        rng.uniform(*_WIDTHS_M, n),
        np.full(n, 0.2),
        rng.uniform(0.2, 1.3, n),
        np.clip(_GREEN * np.exp(rng.normal(0.0, 0.25, (n, 1))) * np.exp(rng.normal(0.0, 0.1, (n, 3))), 0.0, 1.0),
    )
