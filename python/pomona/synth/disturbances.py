"""What sets two visits to one row apart, besides noise, hiding and false points.

Row frame, metres: x along the row, y in depth, z up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.planting import unit_vectors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.planting import Row

__all__ = [
    "bent",
    "in_frame",
    "in_sight",
    "left_after_picking",
    "left_after_thinning",
    "merged",
    "sagged",
    "split",
    "torn",
]

_MERGED_WITHIN_M = 0.10
_SPLIT_M = (0.03, 0.05)
_TORN_TURN_RAD = np.radians(10.0)


def sagged(rng: np.random.Generator, row: Row, sag_m: float) -> NDArray[np.float64]:
    """Positions after branches sank and trees leaned."""
    factor = rng.uniform(0.3, 1.0, row.branch.max(initial=-1) + 1)[row.branch]
    azimuth = rng.uniform(0.0, 2.0 * np.pi, row.tree.max(initial=-1) + 1)[row.tree]
    lean = rng.uniform(0.0, 0.5, row.tree.max(initial=-1) + 1)[row.tree] * row.positions[:, 2] / row.height_m
    shift = np.stack([lean * np.cos(azimuth), lean * np.sin(azimuth), -factor * row.along_branch**2], axis=1)
    return np.asarray(row.positions + sag_m * shift)


def bent(rng: np.random.Generator, positions: NDArray[np.float64], drift: float) -> NDArray[np.float64]:
    """Stretch a row by `drift` of its length or shrink it, and bend it: its ends go aside and up or down by as much."""
    if drift == 0.0:
        return positions
    low, high = positions[:, 0].min(), positions[:, 0].max()
    half = (high - low) / 2.0
    along = (positions[:, 0] - (low + high) / 2.0) / half
    signs = rng.choice([-1.0, 1.0], 3)
    shift = np.stack([along, along**2, along**2], axis=1)
    return np.asarray(positions + drift * half * signs * shift)


def torn(rng: np.random.Generator, positions: NDArray[np.float64], tear_m: float) -> NDArray[np.float64]:
    """Move and turn the last third of a row: `tear_m` in a random direction, 10 degrees about the vertical."""
    if tear_m == 0.0:
        return positions
    low, high = positions[:, 0].min(), positions[:, 0].max()
    cut = low + (high - low) * 2.0 / 3.0
    behind = positions[:, 0] > cut
    turn = np.copysign(_TORN_TURN_RAD, rng.random() - 0.5)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    moved = positions.copy()
    moved[behind] = (positions[behind] - [cut, 0.0, 0.0]) @ rotation.T + [cut, 0.0, 0.0]
    moved[behind] += tear_m * unit_vectors(rng, ())
    return moved


def left_after_thinning(rng: np.random.Generator, row: Row, share: float) -> NDArray[np.bool_]:
    """Tell which fruits (N,) are left when whole clusters go, each with probability `share`."""
    if share == 0.0:
        return np.ones(len(row), bool)
    # The fruits of a cluster hang at one place of one branch.
    _, cluster = np.unique(np.stack([row.branch, row.along_branch]), axis=1, return_inverse=True)
    gone = rng.random(cluster.max(initial=-1) + 1) < share
    return np.asarray(~gone[cluster.ravel()])


def left_after_picking(rng: np.random.Generator, row: Row, share: float) -> NDArray[np.bool_]:
    """Tell which fruits (N,) are left when each goes with probability `share`."""
    return np.ones(len(row), bool) if share == 0.0 else rng.random(len(row)) >= share


def in_sight(rng: np.random.Generator, positions: NDArray[np.float64], fade_m: float, side: int) -> NDArray[np.bool_]:
    """Tell which fruits (N,) a visit on one side of the row sees: half in its middle, a quarter 1.1 `fade_m` behind."""
    if fade_m == 0.0:
        return np.ones(len(positions), bool)
    return np.asarray(rng.random(len(positions)) < 1.0 / (1.0 + np.exp(-side * positions[:, 1] / fade_m)))


def in_frame(
    rng: np.random.Generator, positions: NDArray[np.float64], seen: NDArray[np.int64], count: int
) -> NDArray[np.int64]:
    """Keep the `count` fruits nearest to one of those seen: what one frame shows."""
    if count == 0:
        return seen
    middle = positions[rng.choice(seen)]
    near = np.argsort(np.linalg.norm(positions[seen] - middle, axis=1), kind="stable")[:count]
    return np.sort(seen[near])


def split(rng: np.random.Generator, places: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Second places, 3-5 cm off, of the `share` of fruits that a visit has twice."""
    if share == 0.0:
        return np.empty((0, 3))
    twice = places[rng.choice(len(places), round(share * len(places)), replace=False)]
    return np.asarray(twice + unit_vectors(rng, (len(twice),)) * rng.uniform(*_SPLIT_M, (len(twice), 1)))


def merged(
    rng: np.random.Generator, places: NDArray[np.float64], share: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Take some fruits for one with the nearest within 10 cm, halfway between: which are left (N,), and all places.

    `share` of the fruits are tried; those that hang alone stay.
    """
    left, places = np.ones(len(places), bool), places.copy()
    if share == 0.0:
        return left, places
    for fruit in rng.choice(len(places), round(share * len(places)), replace=False):
        away_m = np.linalg.norm(places - places[fruit], axis=1)
        away_m[fruit] = np.inf
        away_m[~left] = np.inf
        other = int(away_m.argmin())
        if left[fruit] and away_m[other] < _MERGED_WITHIN_M:
            left[fruit] = False
            places[other] = (places[other] + places[fruit]) / 2.0
    return left, places
