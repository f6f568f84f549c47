"""Which pictures of a bag are one frame, and where the camera was then."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.contents import PictureTopic
from pomona.recording.bags.pose_messages import Known
from pomona.recording.calibration.rectification import Optics
from pomona.recording.pairing import half_period, mutually_nearest
from pomona.recording.poses_in_time import LONGEST_GAP_S, posed_rows, poses_at
from pomona.trajectory import Trajectory

__all__ = ["posed", "simultaneous"]

LOST_POSES, SLOWEST_GAP_S = 2.5, 0.5
"""Poses are taken across two that were lost, and no farther: a vehicle in a row moves half a metre in half a second."""

Rows = dict[str, NDArray[np.int64]]
"""For each kind of picture the (F,) rows of its topic."""


def simultaneous(path: Path, pictures: dict[str, PictureTopic]) -> Rows:
    """Rows of each topic that belong together: within half a frame of the first topic's; says what is left out."""
    kinds = list(pictures)
    first = pictures[kinds[0]]
    rows = {kinds[0]: np.arange(len(first.stamps_ns))}
    for kind in kinds[1:]:
        other = pictures[kind]
        farthest_ns = min(half_period(first.stamps_ns), half_period(other.stamps_ns))
        pairs = mutually_nearest(first.stamps_ns[rows[kinds[0]]], other.stamps_ns, farthest_ns)
        if len(pairs) == 0:
            names = f"{first.topic.name} and {other.topic.name}"
            raise PomonaError(f"{path}: {names}: found no pictures within half a frame, expected one clock")
        rows = {known: of_known[pairs[:, 0]] for known, of_known in rows.items()} | {kind: pairs[:, 1]}
    counts = [len(pictures[kind].stamps_ns) for kind in kinds]
    if max(counts) > len(rows[kinds[0]]):
        found = ", ".join(f"{count} {kind}" for kind, count in zip(kinds, counts, strict=True))
        message = f"{path}: found {found} pictures, {len(rows[kinds[0]])} frames have all of them; others are left out"
        warnings.warn(message, PomonaWarning, stacklevel=4)
    return rows


def posed(
    path: Path, pictures: dict[str, PictureTopic], rows: Rows, known: Known | None, optics: Optics
) -> tuple[Rows, Trajectory | None]:
    """Give the frames that have a pose, and their poses; all, and none, where the bag has no poses."""
    if known is None:
        return rows, None
    known_ns, session_from_left = known
    first = next(iter(pictures))
    taken_ns = pictures[first].stamps_ns[rows[first]]
    # Differences of nanoseconds are exact as integers, and only then.
    known_s = (known_ns - known_ns[0]) / 1e9
    longest_gap_s = float(np.clip(LOST_POSES * 2 * half_period(known_s), LONGEST_GAP_S, SLOWEST_GAP_S))
    poses, has_pose = poses_at((taken_ns - known_ns[0]) / 1e9, known_s, session_from_left, longest_gap_s)
    kept = posed_rows(path, has_pose, longest_gap_s)
    rows = {kind: of_kind[kept] for kind, of_kind in rows.items()}
    left_from_rectified = np.eye(4)
    left_from_rectified[:3, :3] = optics.rectified_from_left.T
    return rows, Trajectory(rows[first], taken_ns[kept] / 1e9, poses[kept] @ left_from_rectified)
