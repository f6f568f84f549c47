"""Leaf blades: pointed ovals, folded along the middle rib, bent to an arc, wavy at the edge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.render.surfaces.surface import Surface, grid_faces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.row_geometry import Leaves

__all__ = ["leaf_surface"]

ALONG, ACROSS = 7, 5
"""Vertices of a blade."""

WAVE_WIDTHS = 0.09
"""How high the edge's waves are, in widths."""


def leaf_surface(leaves: Leaves, rng: np.random.Generator) -> Surface:
    """Mesh all leaves.

    Its values: `colour`; `along`, 0 at the base to 1 at the tip; `across`, -1 to 1; `chance`, one number a leaf.
    """
    count = len(leaves)
    t, s = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, ALONG), np.linspace(-1, 1, ACROSS), indexing="ij"))
    phase, chance = rng.random((count, 1)) * 2 * np.pi, rng.random(count)
    forward, rise = _arc(leaves.bends_rad[:, None], t)
    turn = leaves.bends_rad[:, None] * t
    half = leaves.widths_m[:, None] / 2 * _outline(t) * s
    fold = leaves.folds_rad[:, None]
    lift = np.abs(half) * np.sin(fold) + _wave(t, s, phase) * leaves.widths_m[:, None]
    forward = leaves.lengths_m[:, None] * forward + np.sin(turn) * lift
    rise = leaves.lengths_m[:, None] * rise + np.cos(turn) * lift
    sides = np.cross(leaves.normals, leaves.tips)
    vertices = (
        leaves.bases_m[:, None]
        + forward[..., None] * leaves.tips[:, None]
        + rise[..., None] * leaves.normals[:, None]
        - (half * np.cos(fold))[..., None] * sides[:, None]
    )
    values = {
        "colour": np.repeat(leaves.colours, len(t), axis=0),
        "along": np.tile(t, count),
        "across": np.tile(s, count),
        "chance": np.repeat(chance, len(t)),
    }
    return Surface(
        vertices.reshape(-1, 3).astype(np.float32),
        grid_faces(count, ALONG, ACROSS, closed=False),
        {name: value.astype(np.float32) for name, value in values.items()},
    )


def _outline(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half width along the blade, 1 at the widest: round at the base, drawn out to a point."""
    shape = np.sin(np.pi * t**0.8) ** 0.75
    return np.asarray(np.where((t > 0) & (t < 1), shape, 0.02))


def _arc(bends_rad: NDArray[np.float64], t: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the middle rib, an arc of length 1 that turns by `bends_rad` away from the normal: forward and up."""
    bend = np.where(np.abs(bends_rad) < 1e-6, 1e-6, bends_rad)
    return np.sin(bend * t) / bend, (np.cos(bend * t) - 1) / bend


def _wave(t: NDArray[np.float64], s: NDArray[np.float64], phase: NDArray[np.float64]) -> NDArray[np.float64]:
    side = np.where(s > 0, 0.0, 2.1)
    return np.asarray(WAVE_WIDTHS * s**2 * np.sin(np.pi * t) * np.sin(2 * np.pi * 1.6 * t + phase + side))
