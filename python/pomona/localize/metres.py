"""Whether frames and a map have the same metres: a camera whose baseline is wrong finds fruits all the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.localize.course import Step
from pomona.row_length import WRONG_METRES, off_told

__all__ = ["length_in_map", "length_told"]

STRETCHES, LEAST_FRAMES = 10, 2
"""Into so many stretches the way is cut, for frames side by side err by the same fruits; and frames of one at least."""

LEAST_PAIRS, SURE = 5, 0.5
"""Pairs of a frame that is asked, and the probability of each: fewer are found by whether they fit."""

LEAST_OFF, LEAST_SIGMAS = 0.025, 5.0
"""What is told: branches that sag change lengths of a tree by 1 %, and those of a row by less."""


def length_in_map(steps: Sequence[Step], map_m: NDArray[np.float64]) -> float | None:
    """Return how long in the map is what is a metre in the frames, where that is not 1.

    Of every frame that was found the places of its fruits are regressed on those in the map, (N, 3) metres, about their
    middles: fruits of a map are known better than their depths.

    Returns
    -------
    float or None
        None where lengths are the same as far as the frames let tell, or too few say so.
    """
    sums = np.array([both for step in steps if (both := _products(step, map_m)) is not None]).reshape(-1, 2)
    if len(sums) < STRETCHES * LEAST_FRAMES:
        return None
    across, within = np.array([part.sum(axis=0) for part in np.array_split(sums, STRETCHES)]).T
    length = across.sum() / within.sum()
    error = np.std(across / within, ddof=1) / np.sqrt(STRETCHES)
    off = abs(length - 1.0)
    return float(1.0 / length) if off > max(LEAST_OFF, LEAST_SIGMAS * error) else None


def _products(step: Step, map_m: NDArray[np.float64]) -> tuple[float, float] | None:
    """Give the products of places of fruits in a frame and in the map, and of those in the map, about their middles."""
    found = step.found
    pairs = found.pairs[found.probabilities >= SURE]
    if found.map_from_camera is None or len(pairs) < LEAST_PAIRS:
        return None
    seen = step.cloud.positions[pairs[:, 0]] @ found.map_from_camera[:3, :3].T
    there = map_m[pairs[:, 1]]
    seen, there = seen - seen.mean(axis=0), there - there.mean(axis=0)
    return float((seen * there).sum()), float((there * there).sum())


def length_told(length: float) -> str:
    """Say it of a recording and a map; which of both has wrong metres they cannot tell."""
    apart = f"fruits lie {off_told(length)} apart in the frames than in the map"
    return f"{apart}, and poses are off by as much: {WRONG_METRES}"
