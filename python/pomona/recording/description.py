"""What `pomona info` says of a recording of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pomona.recording.boxes_beside import boxes_beside
from pomona.recording.frame import Recording

__all__ = ["DEPTH_M", "DISPARITY_ERROR_PX", "describe"]

DEPTH_M = 1.5
"""Distance of a camera on a vehicle to the row."""

DISPARITY_ERROR_PX = 0.5
"""Error of a plain stereo matcher at a fruit; the depth error that follows shows a wrong unit at a glance."""


def describe(
    recording: Recording, kind: str, times_s: Sequence[float] | None, pictures: dict[str, int]
) -> dict[str, Any]:
    """Say what was found.

    Parameters
    ----------
    recording : Recording
        For its camera, poses, name and date.
    kind : str
        What it was recognised as.
    times_s : sequence of float or None
        Time of each frame.
    pictures : mapping
        Count of left, right and depth pictures.
    """
    camera = recording.calibration
    return {
        "recording": str(recording.path),
        "kind": kind,
        "name": recording.name,
        "date": recording.date,
        "frames": len(recording),
        "rate_hz": _rate_hz(times_s),
        "width": camera.width,
        "height": camera.height,
        "fx": camera.fx,
        "fy": camera.fy,
        "baseline_m": camera.baseline_m,
        "depth_error_m": camera.depth_error_m(DEPTH_M, DISPARITY_ERROR_PX),
        "depth_unit_m": camera.depth_unit_m if "depth" in pictures else None,
        "pictures": pictures,
        "poses": recording.trajectory is not None,
        "detections": boxes_beside(recording.path) is not None,
    }


def _rate_hz(times_s: Sequence[float] | None) -> float | None:
    """Frames a second by the median interval, so that a pause does not count."""
    if times_s is None or len(times_s) < 2:
        return None
    return float(1 / np.median(np.diff(np.asarray(times_s))))
