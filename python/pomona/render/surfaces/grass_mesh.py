"""A square metre of grass, to be laid out many times."""

from __future__ import annotations

import numpy as np

from pomona.render.surfaces.surface import Surface, grid_faces

__all__ = ["grass_surface"]

JOINTS = 4
"""Pairs of vertices of a blade, from the ground to its tip."""


def grass_surface(blades: int, height_m: float, rng: np.random.Generator) -> Surface:
    """Mesh a patch of 1 m x 1 m about the origin. Its values: `colour`; `along`, 0 at the ground to 1 at the tip."""
    tall = height_m * rng.lognormal(0.0, 0.35, blades)
    heading, lean = rng.random(blades) * 2 * np.pi, rng.random(blades) * 1.5
    t = np.linspace(0, 1, JOINTS)
    bent = lean[:, None] * t
    forward = tall[:, None] * np.where(lean[:, None] > 0, (1 - np.cos(bent)) / np.maximum(lean[:, None], 1e-6), 0)
    up = tall[:, None] * np.sin(bent) / np.maximum(lean[:, None], 1e-6)
    half = 0.5 * rng.uniform(0.002, 0.005, (blades, 1)) * (1 - 0.9 * t**2)
    ahead = np.stack([np.cos(heading), np.sin(heading), np.zeros(blades)], axis=-1)
    aside = np.stack([-np.sin(heading), np.cos(heading), np.zeros(blades)], axis=-1)
    root = np.concatenate([rng.uniform(-0.5, 0.5, (blades, 2)), np.zeros((blades, 1))], axis=1)
    middle = root[:, None] + forward[..., None] * ahead[:, None] + up[..., None] * [0.0, 0.0, 1.0]
    sides = half[..., None] * aside[:, None]
    vertices = np.stack([middle - sides, middle + sides], axis=2).reshape(-1, 3)
    dry = rng.random((blades, 1)) < 0.12
    fresh = np.array([0.055, 0.125, 0.018]) * rng.lognormal(0.0, 0.25, (blades, 1)) + [0.02, 0.015, 0.0]
    colour = np.where(dry, [0.30, 0.25, 0.11], fresh)
    values = {"colour": np.repeat(colour, 2 * JOINTS, axis=0), "along": np.tile(np.repeat(t, 2), blades)}
    return Surface(
        vertices.astype(np.float32),
        grid_faces(blades, JOINTS, 2, closed=False),
        {name: value.astype(np.float32) for name, value in values.items()},
    )
