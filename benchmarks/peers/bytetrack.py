"""ByteTrack (Zhang et al., ECCV 2022) as the package `trackers` ships it: boxes in the picture, no poses, no depth."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from pomona.detect import Detections


def is_installed() -> bool:
    """Whether the packages of the dependency group `bench` are there."""
    return find_spec("trackers") is not None


def follow(frames: Iterable[Detections], rate_hz: float) -> list[NDArray[np.int64]]:
    """Give the track number of every box, -1 for none.

    The package's settings but for two: the true rate, and a track may show with its first box, else two thirds of the
    boxes would be lost before anything is compared.
    """
    import supervision
    from trackers import ByteTrackTracker

    tracker = ByteTrackTracker(frame_rate=rate_hz, minimum_consecutive_frames=1)
    numbers = []
    for detections in frames:
        row_of = {tuple(box): row for row, box in enumerate(detections.boxes_px.astype(np.float32).tolist())}
        found = tracker.update(
            supervision.Detections(
                xyxy=detections.boxes_px.astype(np.float32),
                confidence=detections.scores.astype(np.float32),
                class_id=np.zeros(len(detections), int),
            )
        )
        told = np.full(len(detections), -1, np.int64)
        for box, number in zip(found.xyxy.tolist(), found.tracker_id.tolist(), strict=True):
            told[row_of[tuple(box)]] = number
        numbers.append(told)
    return numbers
