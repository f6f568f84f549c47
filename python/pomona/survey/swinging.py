"""Fruits that swing while they are filmed: how far, and how a tracker has to allow for it.

A tracker takes what is seen for static. Where a wind moves clusters by centimetres from frame to frame it begins a
fruit anew beside itself, and what it has together lies nearer together than the fruits swing. So the swing is measured
on what was tracked, the boxes are tracked again with as much allowed for, and so on until the measure stays.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaWarning
from pomona.survey.sightings import Sightings

__all__ = ["allowed_m", "allowing", "swing_m", "tell_swing"]

LEAST_M = 0.002
"""A swing that is allowed for; in still air none is found, beside what boxes and depths err by."""

TOLD_M = 0.004
"""A swing that is told."""

DEVIATIONS = 4.0
"""Of a swing, how far a fruit may be from one frame to the next: from one end to the other."""

MOST_M = 0.04
"""That is allowed for at the most: with 5 cm fruits of a cluster are taken for one."""

LEAST_VIEWS = 4
"""Sightings of a fruit that say where its middle is: of fewer each lies near the mean of all."""

LEAST_FRUITS = 5
"""Fruits in a frame that say how its pose is off: that moves them together."""

MEDIAN_CHI2 = 1.386
"""Median of chi squared with two degrees of freedom."""


def allowed_m(swing_m: float) -> float:
    """Return how far a fruit may be from where it was seen last, metres; 0 in still air."""
    return min(DEVIATIONS * swing_m, MOST_M) if swing_m > LEAST_M else 0.0


def allowing(config: Mapping[str, Any], allowed_m: float) -> Mapping[str, Any]:
    """Return a configuration whose tracker finds fruits that are so many metres from where they were seen last."""
    if allowed_m <= 0.0:
        return config
    tracking = dict(config.get("tracking", {}))
    # At once, and not as the camera goes on.
    tracking |= {"drift_per_metre": 1.0, "max_drift_m": max(allowed_m, tracking.get("max_drift_m", 0.0))}
    return {**config, "tracking": tracking}


def swing_m(
    sightings: Sightings,
    fruits: NDArray[np.int64],
    session_from_camera: NDArray[np.float64],
    centres: NDArray[np.float64],
) -> float:
    """Measure it across the lines of sight, where sightings err least.

    Parameters
    ----------
    sightings : Sightings
        Each of a fruit.
    fruits : (S,) int64
        Row in `centres` of each.
    session_from_camera : (F, 4, 4) float64
        Poses of all frames.
    centres : (N, 3) float64
        Where the fruits are by all of their sightings, metres.

    Returns
    -------
    float
        Standard deviation per axis beyond what the sightings' covariances say, metres; 0 where they say enough.
    """
    views = np.bincount(fruits, minlength=len(centres))
    in_frame = np.bincount(sightings.rows, minlength=len(session_from_camera))
    kept = np.flatnonzero((views[fruits] >= LEAST_VIEWS) & (in_frame[sightings.rows] >= LEAST_FRUITS))
    if not len(kept):
        return 0.0
    frames, in_camera = sightings.rows[kept], sightings.centres_in_camera[kept]
    poses = session_from_camera[frames]
    off = np.einsum("nji,nj->ni", poses[:, :3, :3], centres[fruits[kept]] - poses[:, :3, 3]) - in_camera
    off -= _common(off, frames)
    rays = in_camera / np.linalg.norm(in_camera, axis=1, keepdims=True)
    across2 = np.einsum("ni,ni->n", off, off) - np.einsum("ni,ni->n", off, rays) ** 2
    spreads = sightings.covariances[kept]
    expected = (np.trace(spreads, axis1=1, axis2=2) - np.einsum("ni,nij,nj->n", rays, spreads, rays)) / 2.0
    n = views[fruits[kept]]
    excess = np.median(across2 * n / (n - 1.0)) / MEDIAN_CHI2 - np.median(expected)
    return float(np.sqrt(max(excess, 0.0)))


def _common(off: NDArray[np.float64], frames: NDArray[np.int64]) -> NDArray[np.float64]:
    """Median of its frame for each, which is the pose's."""
    of_frame = np.unique(frames, return_inverse=True)[1]
    medians = np.array([np.median(off[of_frame == row], axis=0) for row in range(int(of_frame.max()) + 1)])
    return np.asarray(medians[of_frame])


def tell_swing(path: Path, swings_m: Sequence[float]) -> None:
    """Warn of fruits that swing by so much in the parts of a recording; poses that are off look alike."""
    if (most_m := max(swings_m, default=0.0)) > TOLD_M:
        message = (
            f"{path}: where fruits are seen scatters by {1000 * most_m:.0f} mm (standard deviation) beyond what their "
            "sightings err by, as of fruits that swing in wind, or of poses that are off: places are no better than "
            "that, the camera's way is as doubtful, and some fruits may be counted twice"
        )
        warnings.warn(message, PomonaWarning, stacklevel=3)
