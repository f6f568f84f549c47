"""Apples as solids of revolution: round shoulders, a hollow at the stalk, five bumps about the calyx."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.render.surfaces.surface import Surface, frames_along, grid_faces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.row_geometry import FruitSolids

__all__ = ["fruit_surface"]

RINGS, SIDES = 19, 24
"""From pole to pole and around; at 1 m a side of a 75 mm apple is 4 pixels wide with a focal length of 420."""

SHOULDER = 2.2
"""Exponent of the outline: 2 is an ellipse, more has squarer shoulders."""

STALK_HOLLOW, CALYX_HOLLOW = (0.42, 0.27), (0.26, 0.20)
"""Depth in half heights and width in half diameters."""

BUMPS = 0.05
"""Height of the five bumps about the calyx, in half heights."""


def fruit_surface(fruits: FruitSolids, rng: np.random.Generator) -> Surface:
    """Mesh all fruits.

    Its values: `id`; `place`, where on the skin in half diameters, z towards the stalk; `sunny`, the cosine to the
    blush's middle; `share`, `ground` and `blush` as the fruits have them; `chance`, one number a fruit.
    """
    radii, heights = _profile()
    turn = np.arange(SIDES) * (2 * np.pi / SIDES)
    low = np.clip(-heights, 0, 1)[:, None] ** 4 * np.clip(radii, 0, 1)[:, None]
    unit = np.stack(
        [
            radii[:, None] * np.cos(turn),
            radii[:, None] * np.sin(turn),
            heights[:, None] - BUMPS * low * (1 + np.cos(5 * turn)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    frames = frames_along(fruits.axes)
    half = np.stack([fruits.diameters_m, fruits.diameters_m, fruits.heights_m], axis=-1) / 2
    local = unit[None] * half[:, None]
    outward = unit / np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-9)
    toward_sun = np.einsum("fji,fj->fi", frames, fruits.blush_directions)
    each = {
        "id": fruits.ids,
        "share": fruits.blush_shares,
        "ground": fruits.ground_colours,
        "blush": fruits.blush_colours,
        "chance": rng.random(len(fruits)),
    }
    values = {name: np.repeat(of_fruit, len(unit), axis=0) for name, of_fruit in each.items()}
    values["place"] = np.tile(unit, (len(fruits), 1))
    values["sunny"] = (toward_sun @ outward.T).ravel()
    vertices = np.einsum("fij,fvj->fvi", frames, local) + fruits.centres_m[:, None]
    return Surface(
        vertices.reshape(-1, 3).astype(np.float32),
        grid_faces(len(fruits), RINGS, SIDES, closed=True),
        {name: value.astype(np.float32) for name, value in values.items()},
    )


def _profile() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Radii and heights from the calyx to the stalk, in half diameters and half heights; both reach 1."""
    angle = np.linspace(0.02, np.pi - 0.02, RINGS)
    radii, cosine = np.sin(angle), np.cos(angle)
    heights = -np.sign(cosine) * (1 - radii**SHOULDER) ** (1 / SHOULDER)
    upper = heights > 0
    depth, width = np.where(upper, STALK_HOLLOW[0], CALYX_HOLLOW[0]), np.where(upper, STALK_HOLLOW[1], CALYX_HOLLOW[1])
    heights = heights - np.sign(heights) * depth * np.exp(-((radii / width) ** 2))
    # Apples are widest a little above the middle and narrow towards the calyx.
    radii = radii * (1 - 0.10 * np.clip(-heights, 0, 1) ** 2)
    return radii / radii.max(), np.where(upper, heights / heights.max(), heights / -heights.min())
