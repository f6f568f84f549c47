"""Wood, stalks, posts and wires: tapered rods with round ends, so that rods that meet leave no gap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.render.surfaces.surface import Surface, frames_along, grid_faces

if TYPE_CHECKING:
    from pomona.synth.row_geometry import Limbs

__all__ = ["limb_surface"]

SIDES = 8
CAP = ((-1.0, 0.05), (-0.7, 0.72), (0.0, 1.0))
"""Rings of a round end: how far beyond it and how wide, in radii."""


def limb_surface(limbs: Limbs) -> Surface:
    """Mesh all rods. Its values: `colour`; `radius` in metres; `along`, metres from the start; `id` is none."""
    apart = limbs.ends_m - limbs.starts_m
    lengths = np.maximum(np.linalg.norm(apart, axis=1), 1e-9)
    frames = frames_along(apart / lengths[:, None])
    out, wide = (np.array(column) for column in zip(*CAP, strict=True))
    height = np.concatenate(
        [out * limbs.start_radii_m[:, None], lengths[:, None] - out[::-1] * limbs.end_radii_m[:, None]], axis=1
    )
    radii = np.concatenate([wide * limbs.start_radii_m[:, None], wide[::-1] * limbs.end_radii_m[:, None]], axis=1)
    turn = np.arange(SIDES) * (2 * np.pi / SIDES)
    local = np.stack(
        [
            radii[..., None] * np.cos(turn),
            radii[..., None] * np.sin(turn),
            np.broadcast_to(height[..., None], (*height.shape, SIDES)),
        ],
        axis=-1,
    )
    vertices = np.einsum("lij,lrsj->lrsi", frames, local) + limbs.starts_m[:, None, None]
    rings = 2 * len(CAP)
    values = {
        "colour": np.repeat(limbs.colours, rings * SIDES, axis=0),
        "radius": np.repeat(radii.ravel(), SIDES),
        "along": np.repeat(height.ravel(), SIDES),
    }
    return Surface(
        vertices.reshape(-1, 3).astype(np.float32),
        grid_faces(len(limbs), rings, SIDES, closed=True),
        {name: value.astype(np.float32) for name, value in values.items()},
    )
