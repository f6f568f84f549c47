"""How an axis grows: from its root in a direction that light, weight and chance turn as it goes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.wood import NODES, TRUNK, WoodAxes, along_axes

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Sprouts", "grow_axes", "perpendiculars", "unit"]

_TAPER = 0.75
"""Exponent of the radius from root to tip: thick for longer than a cone."""


class Sprouts:
    """Where new axes stand on old ones: which, at what place, (N,) each."""

    def __init__(self, axes: NDArray[np.int64], places: NDArray[np.float64]) -> None:
        self.axes, self.places = axes, places

    def __len__(self) -> int:
        return len(self.axes)

    def roots(self, wood: WoodAxes) -> NDArray[np.float64]:
        """Points in the row frame, (N, 3)."""
        return along_axes(wood.nodes_m, self.axes, self.places)


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions of vectors, (..., 3)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def perpendiculars(directions: NDArray[np.float64], azimuths_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give unit vectors across directions, (N, 3); azimuth 0 is as level as can be, a quarter turn as high."""
    level = np.cross(directions, [0.0, 0.0, 1.0])
    steep = np.linalg.norm(level, axis=1) < 0.05
    level[steep] = np.cross(directions[steep], [1.0, 0.0, 0.0])
    level = unit(level)
    high = np.cross(level, directions)
    return np.asarray(np.cos(azimuths_rad)[:, None] * level + np.sin(azimuths_rad)[:, None] * high)


def grow_axes(
    rng: np.random.Generator,
    on: WoodAxes | None,
    sprouts: Sprouts,
    directions: NDArray[np.float64],
    lengths_m: NDArray[np.float64],
    *,
    radii_m: tuple[float, float],
    lift: float = 0.0,
    wobble: float = 0.15,
    stiffness: float = 1.0,
    bears: bool = True,
    roots_m: NDArray[np.float64] | None = None,
) -> WoodAxes:
    """Grow one axis from each sprout.

    Parameters
    ----------
    directions : (N, 3)
        At the root.
    lengths_m : (N,)
    radii_m
        At the root of an axis of mean length, and at every tip.
    lift
        How much an axis turns up, or down, on its way: added to the unit direction at the tip.
    wobble
        The same in a random direction.
    roots_m : (N, 3), optional
        Of trunks, which stand on nothing.
    """
    share = np.linspace(0.0, 1.0, NODES)
    n = len(directions)
    bow, snake = unit(rng.normal(size=(n, 3))), unit(rng.normal(size=(n, 3)))
    phase = rng.uniform(0.0, 2.0 * np.pi, n)
    middle = (share[1:] + share[:-1]) / 2.0
    heading = unit(directions)[:, None, :] + middle[None, :, None] * [0.0, 0.0, lift]
    heading = heading + wobble * middle[None, :, None] * bow[:, None, :]
    heading = heading + wobble * np.sin(2.0 * np.pi * 1.5 * middle + phase[:, None])[:, :, None] * snake[:, None, :]
    steps = unit(heading) * (lengths_m / (NODES - 1))[:, None, None]
    root = roots_m if on is None or roots_m is not None else sprouts.roots(on)
    nodes = np.concatenate([np.zeros((n, 1, 3)), np.cumsum(steps, axis=1)], axis=1) + np.asarray(root)[:, None, :]
    thick = radii_m[0] * np.sqrt(lengths_m / max(float(lengths_m.mean()), 1e-9)) if n else np.empty(0)
    thick = np.maximum(thick, radii_m[1])
    radii = radii_m[1] + (thick - radii_m[1])[:, None] * (1.0 - share) ** _TAPER
    return WoodAxes(
        nodes,
        radii,
        sprouts.axes,
        sprouts.places,
        np.zeros(n, np.int64) if on is None else on.orders[sprouts.axes] + 1,
        np.arange(n) if on is None else on.trees[sprouts.axes],
        np.full(n, stiffness),
        np.full(n, bears),
    )


def trunks(
    rng: np.random.Generator, feet_m: NDArray[np.float64], height_m: float, radii_m: tuple[float, float]
) -> WoodAxes:
    """Grow one trunk from each foot; it never bends."""
    n = len(feet_m)
    up = np.tile([0.0, 0.0, 1.0], (n, 1)) + rng.normal(0.0, 0.02, (n, 3))
    sprouts = Sprouts(np.full(n, TRUNK), np.zeros(n))
    lengths = np.full(n, height_m) * rng.uniform(0.95, 1.0, n)
    return grow_axes(
        rng, None, sprouts, up, lengths, radii_m=radii_m, wobble=0.04, stiffness=np.inf, bears=False, roots_m=feet_m
    )
