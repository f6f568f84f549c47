"""Poses at the times of the pictures, between those that a tracking system wrote down."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning

__all__ = ["posed_rows", "poses_at"]

LONGEST_GAP_S = 0.1
"""Over a longer gap a hand-held camera does not move evenly."""

SAME_S = 0.005
"""Times that are so near are one: clocks are written in milliseconds, and in these a camera in a row moves 5 mm."""

UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
"""By how many times a span is too long in them."""

ALIKE = 1.3
"""Spans of one drive, in one unit, differ by this factor at most: poses begin earlier and end later."""


def poses_at(
    times_s: NDArray[np.float64],
    known_s: NDArray[np.float64],
    known: NDArray[np.float64],
    longest_gap_s: float = LONGEST_GAP_S,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Interpolate poses: positions linearly, rotations along the shortest arc.

    Parameters
    ----------
    times_s : (F,) float64
        When poses are wanted.
    known_s, known : (K,) and (K, 4, 4) float64
        Poses and their times, ascending.
    longest_gap_s : float
        Poses farther apart than this, by `SAME_S` and more, have none between them.

    Returns
    -------
    poses : (F, 4, 4) float64
        Of the rows that have one; the identity elsewhere.
    has_pose : (F,) bool
        False outside the known times, and inside gaps over `longest_gap_s`; a pose within `SAME_S` is taken as it is.
    """
    from scipy.spatial.transform import Rotation, Slerp

    poses = np.tile(np.eye(4), (len(times_s), 1, 1))
    if len(known_s) == 0:
        return poses, np.zeros(len(times_s), bool)
    after = np.searchsorted(known_s, times_s).clip(0, len(known_s) - 1)
    before = np.where(known_s[after] == times_s, after, after - 1).clip(0)
    has_pose = (known_s[before] <= times_s) & (times_s <= known_s[after])
    has_pose &= known_s[after] - known_s[before] <= longest_gap_s + SAME_S
    nearest = np.where(times_s - known_s[before] <= known_s[after] - times_s, before, after)
    same = ~has_pose & (np.abs(known_s[nearest] - times_s) <= SAME_S)
    poses[same] = known[nearest[same]]
    wanted_s = times_s[has_pose]
    if len(known_s) == 1:
        poses[has_pose] = known[0]
    elif len(wanted_s):
        poses[has_pose, :3, :3] = Slerp(known_s, Rotation.from_matrix(known[:, :3, :3]))(wanted_s).as_matrix()
        for axis in range(3):
            poses[has_pose, axis, 3] = np.interp(wanted_s, known_s, known[:, axis, 3])
    return poses, has_pose | same


def posed_rows(
    path: Path,
    has_pose: NDArray[np.bool_],
    longest_gap_s: float = LONGEST_GAP_S,
    *,
    clocks: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> NDArray[np.int64]:
    """Rows that have a pose; says how many have none.

    Parameters
    ----------
    path : Path
        What has the poses.
    has_pose : (F,) bool
    longest_gap_s : float
        As in `poses_at`.
    clocks : two arrays of float64, optional
        Times of the pictures and of the poses, as they were written: where most have none, their units are compared.

    Raises
    ------
    PomonaError
        When none has, or hardly one for the times are in another unit.
    """
    missing = int((~has_pose).sum())
    if clocks is not None and 2 * missing > len(has_pose):
        _require_same_unit(path, *clocks)
    if missing == len(has_pose):
        raise PomonaError(f"{path}: found no pose at the time of any picture, expected the same clock")
    if missing:
        message = (
            f"{path}: {missing} of {len(has_pose)} frames have no pose within {longest_gap_s:g} s and are left out"
        )
        warnings.warn(message, PomonaWarning, stacklevel=4)
    return np.flatnonzero(has_pose)


def _require_same_unit(path: Path, times_s: NDArray[np.float64], known_s: NDArray[np.float64]) -> None:
    """Refuse times of which those of pictures or of poses go a thousand times as fast, or a million."""
    spans = [float(np.ptp(clock)) if len(clock) else 0.0 for clock in (times_s, known_s)]
    if min(spans) <= 0.0:
        return
    for factor, unit in UNITS.items():
        for (longer, shorter), names in ((spans, ("pictures", "poses")), (spans[::-1], ("poses", "pictures"))):
            if 1.0 / ALIKE < longer / shorter / factor < ALIKE:
                raise PomonaError(
                    f"{path}: found times of the {names[0]} over {longer:g} s and of the {names[1]} over {shorter:g} "
                    f"s, expected seconds in both: those of the {names[0]} look like {unit}"
                )
