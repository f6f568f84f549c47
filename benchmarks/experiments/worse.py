"""A visit made as hard as the paper's: fruits hidden at random, false ones among them, all of them off their places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiments.visits import Visit
from pomona.cloud import FruitCloud, Views
from pomona.synth.false_points import false_points

NEAR_M = 1.5
"""Distance of a camera on a tractor, to which the noise refers: that of stereo grows with the square of it."""


HIDDEN, FALSE = 0.35, 0.1
"""Share of a visit's fruits that is not found, and of false ones that come in."""

SIGMA_M = 0.01
"""Standard deviation per axis of a place that is filmed from `NEAR_M`."""


def made_worse(visit: Visit, distance_m: float, seed: tuple[int, int]) -> Visit:
    """Draw what such a visit finds; a false fruit is seen in the frames that see the fruit nearest to it."""
    rng = np.random.default_rng(seed)
    n = len(visit.cloud)
    kept = np.flatnonzero(rng.random(n) >= HIDDEN)
    seen = visit.cloud.select(kept)
    strays = false_points(rng, visit.cloud.positions, round(FALSE * n))
    places = np.concatenate([seen.positions, strays])
    sigma_m = SIGMA_M * (distance_m / NEAR_M) ** 2
    cloud = FruitCloud(places + rng.normal(0.0, sigma_m, places.shape), views=_seen_with(seen, strays))
    names = (*(visit.true_ids[row] for row in kept), *("" for _ in strays))
    left = frozenset(names)
    return Visit(cloud, names, visit.countable & left, visit.detected & left)


def _seen_with(seen: FruitCloud, strays: NDArray[np.float64]) -> Views:
    views = seen.views
    assert views is not None
    frames, fruits = [views.frames], [views.fruits]
    for number, stray in enumerate(strays):
        nearest = int(np.linalg.norm(seen.positions - stray, axis=1).argmin())
        of_it = views.frames[views.fruits == nearest]
        frames.append(of_it)
        fruits.append(np.full(len(of_it), len(seen) + number, np.int64))
    return Views(np.concatenate(frames), np.concatenate(fruits))
