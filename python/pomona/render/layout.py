"""What a photo-real renderer adds to a row, and where: grass, soil and weeds, rows beyond."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.render.surfaces import Surface, fruit_surface, grass_surface, leaf_surface, limb_surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.row_geometry import RowGeometry

__all__ = ["Place", "lay_out"]

Place = tuple[float, float, float, float]
"""Where a mesh stands: x and y in metres, its turn about z in radians, its height as a factor."""

SPACING_M = 3.2
"""Between rows, where only one stands there."""

STRIP_HALF_M = 0.45
"""Half of the strip under the trees that is kept free of grass."""

REACH_M = 5.0
"""How far grass goes on beyond the row's ends."""

ROWS_BEYOND = 2


def lay_out(geometry: RowGeometry, seed: int) -> tuple[dict[str, Surface], dict[str, list[Place]]]:
    """Mesh the row and what is around it; say where each mesh stands."""
    rng = np.random.default_rng([seed, 1])
    surfaces = {
        "fruits": fruit_surface(geometry.fruits, rng),
        "leaves": leaf_surface(geometry.leaves, rng),
        "limbs": limb_surface(geometry.limbs),
        "grass": grass_surface(5000, 0.11, rng),
        "weeds": grass_surface(500, 0.06, rng),
    }
    rows_m = _rows(geometry)
    spacing_m = float(np.diff(rows_m).mean()) if len(rows_m) > 1 else SPACING_M
    ends_m = _ends(geometry)
    here: list[Place] = [(0.0, 0.0, 0.0, 1.0)]
    beyond = here + _beyond(rows_m, spacing_m, ends_m)
    grass, weeds = _patches(rows_m, spacing_m, ends_m, rng)
    places = {"fruits": here, "leaves": beyond, "limbs": beyond, "grass": grass, "weeds": weeds}
    return surfaces, places


def _rows(geometry: RowGeometry) -> NDArray[np.float64]:
    """Depth of each row: where wood stands in the ground, apart by more than a metre."""
    starts = geometry.limbs.starts_m
    depths = np.sort(starts[starts[:, 2] < 0.15, 1])
    if len(depths) == 0:
        return np.zeros(1)
    return np.array([part.mean() for part in np.split(depths, np.flatnonzero(np.diff(depths) > 1.0) + 1)])


def _ends(geometry: RowGeometry) -> tuple[float, float]:
    along = np.concatenate([geometry.limbs.starts_m[:, 0], [0.0]])
    return float(along.min()), float(along.max())


def _beyond(rows_m: NDArray[np.float64], spacing_m: float, ends_m: tuple[float, float]) -> list[Place]:
    """Stand the row again behind, turned about, and beside itself there, so that no row ends in the picture."""
    middle_m, length_m = sum(ends_m) / 2, ends_m[1] - ends_m[0]
    centre_m = float(rows_m.mean())
    places = []
    for number in range(ROWS_BEYOND):
        depth_m = centre_m + (number + 1) * len(rows_m) * spacing_m
        for side in (-1, 0, 1):
            x = 2 * middle_m + side * length_m + 0.37 * number
            places.append((x, depth_m + centre_m, np.pi, 1.0))
    return places


def _patches(
    rows_m: NDArray[np.float64], spacing_m: float, ends_m: tuple[float, float], rng: np.random.Generator
) -> tuple[list[Place], list[Place]]:
    """Lay grass everywhere but under the trees, and weeds there."""
    grass: list[Place] = []
    weeds: list[Place] = []
    last_m = float(rows_m[-1]) + ROWS_BEYOND * spacing_m
    for x in np.arange(ends_m[0] - REACH_M, ends_m[1] + REACH_M, 0.9):
        for y in np.arange(float(rows_m[0]) - spacing_m, last_m, 0.45):
            from_row = abs((y - rows_m[0] + spacing_m / 2) % spacing_m - spacing_m / 2)
            strip = from_row < STRIP_HALF_M + 0.5
            place = (
                float(x + rng.uniform(-0.2, 0.2)),
                float(y),
                float(rng.integers(4) * np.pi / 2),
                float(rng.uniform(0.7, 1.3)),
            )
            (weeds if strip else grass).append(place)
    return grass, weeds
