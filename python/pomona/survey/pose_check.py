"""Whether poses that came with a recording are those of its pictures: a few stretches are followed and compared."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording import Recording
from pomona.survey.pose_source import pose_source_of
from pomona.trajectory import Trajectory

__all__ = ["Disagreement", "check_poses", "disagreement"]

Array = NDArray[np.float64]

STRETCHES, STRETCH_FRAMES = 3, 4
"""Evenly over the recording."""

MOVED_M = 0.05
"""In all stretches together; on a shorter way scale and direction say nothing."""

OFF_SHARE, TURNED_RAD = 0.3, np.radians(2.0)
"""Part of the way that is in another direction, and turn of a stretch, of poses that are not these."""

SCALED, SIGMAS = 0.03, 3.0
"""Scale that is told, and how sure it must be; calibrations a little old make 2 %."""

UNITS = {1000.0: "millimetres", 100.0: "centimetres", 3.2808: "feet", 0.001: "kilometres"}
"""By how many times the way is too long in them."""

ALIKE = 1.1
"""Scales of one unit differ by this factor at most."""

MISFIT, BETTER = 0.15, 0.25
"""Of what makes it another way: part of it from which on a mistake is asked for that leaves this part of it."""

ASIDE_M, AT_M, LEAST_ASIDE = 0.035, 1.5, 0.05
"""How far from the pictures poses stray in a stretch that lose fruits, those 1.5 m away; and as part of the way, for
pictures err by 1 or 2 % of a long one. With 2.7 cm 10 % of the fruits are missed, with 5 cm 70 %."""

BODY_FROM_CAMERA = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""A vehicle's axes: x ahead, y left, z up."""


@dataclass(frozen=True)
class Disagreement:
    """By how much motions by the poses differ from those by the pictures.

    Attributes
    ----------
    scale : float
        Way by the poses over that by the pictures; negative where it goes back.
    off_share : float
        Part of the way by the poses that the pictures do not have at that scale.
    turned_rad : float
        Median angle between the turns.
    aside_m : float
        Root mean square, over the stretches, of what the pictures do not have.
    """

    scale: float
    off_share: float
    turned_rad: float
    aside_m: float

    @property
    def is_other_way(self) -> bool:
        """Whether direction or turn differ."""
        return self.scale <= 0 or self.off_share > OFF_SHARE or self.turned_rad > TURNED_RAD

    @property
    def misfit(self) -> float:
        """How far they differ, of what makes it another way."""
        return float(np.hypot(self.off_share / OFF_SHARE, self.turned_rad / TURNED_RAD))

    @property
    def strays(self) -> bool:
        """Whether fruits are lost by it."""
        aside_m = float(np.hypot(self.aside_m, self.turned_rad * AT_M))
        return aside_m > ASIDE_M and max(self.off_share, self.turned_rad * AT_M / ASIDE_M) > LEAST_ASIDE


def check_poses(recording: Recording) -> bool:
    """Warn where the poses of a recording disagree with its pictures; where too little shows, nothing is said.

    Returns whether something was.
    """
    known = recording.trajectory
    if known is None:
        return False
    try:
        ends, seen = _followed(recording, known)
    except PomonaError:
        return False  # Pictures that cannot be followed are no reason to doubt poses.
    if not seen or np.linalg.norm(np.array(seen)[:, :3, 3], axis=1).sum() < MOVED_M:
        return False
    told = _in_words(known.session_from_camera, ends, np.array(seen))
    if told is not None:
        message = f"{recording.path}: the poses disagree with the pictures: {told}"
        warnings.warn(message, PomonaWarning, stacklevel=3)
    return told is not None


def _followed(recording: Recording, known: Trajectory) -> tuple[list[tuple[int, int]], list[Array]]:
    """Give the rows of first and last pose of each stretch, and the motion between them that the pictures show."""
    ends, seen = [], []
    for rows in _stretches(len(known)):
        camera = pose_source_of(recording, odometry=True)
        numbers = known.frames[rows]
        places = [camera(frame) for frame in recording.frames(set(numbers.tolist()))]
        first, last = places[0].session_from_camera, places[-1].session_from_camera
        if first is not None and last is not None and places[0].part == places[-1].part:
            ends.append((rows[0], rows[-1]))
            seen.append(np.linalg.inv(first) @ last)
    return ends, seen


def _stretches(n_poses: int) -> Iterator[list[int]]:
    length = min(STRETCH_FRAMES, n_poses)
    starts = np.linspace(0, n_poses - length, STRETCHES).astype(int)
    for start in dict.fromkeys(starts.tolist()) if length > 1 else ():
        yield list(range(start, start + length))


def disagreement(poses: Array, ends: list[tuple[int, int]], seen: Array) -> Disagreement:
    """Compare poses, (F, 4, 4), with motions that pictures show, (S, 4, 4), between pairs of their rows."""
    said = np.array([np.linalg.inv(poses[first]) @ poses[last] for first, last in ends])
    ways, true_ways = said[:, :3, 3], seen[:, :3, 3]
    scale = float((ways * true_ways).sum() / (true_ways**2).sum())
    length = max(float(np.linalg.norm(ways)), np.finfo(float).tiny)
    aside_m = float(np.linalg.norm(ways - scale * true_ways))
    traces = np.einsum("sij,sij->s", said[:, :3, :3], seen[:, :3, :3])
    turned_rad = float(np.median(np.arccos(np.clip((traces - 1) / 2, -1, 1))))
    return Disagreement(scale, aside_m / length, turned_rad, aside_m / float(np.sqrt(len(ways))))


def _in_words(poses: Array, ends: list[tuple[int, int]], seen: Array) -> str | None:
    found = disagreement(poses, ends, seen)
    off = f"{found.off_share:.0%} of the way goes elsewhere" if found.scale > 0 else "the way goes back"
    turned = f"turns differ by {np.degrees(found.turned_rad):.1f} degrees"
    for cause, meant in MISTAKES.items():
        other = disagreement(np.array([meant(pose) for pose in poses]), ends, seen)
        is_better = found.misfit > MISFIT and other.scale > 0 and other.misfit < BETTER * found.misfit
        if is_better or (found.is_other_way and not other.is_other_way):
            return f"{off}, {turned}: {cause}"
    if found.is_other_way:
        return (
            f"{off}, {turned}: check their axes (x right, y down, z forward) and times, or find others with --odometry"
        )
    unsure = SIGMAS * found.off_share / np.sqrt(len(ends))
    if abs(found.scale - 1) > max(SCALED, unsure):
        return _of_scale(found.scale)
    frames = ends[0][1] - ends[0][0]
    aside = f"{100 * found.aside_m:.0f} cm and {np.degrees(found.turned_rad):.1f} degrees in {frames} frames"
    advice = "fruits may be lost: check their times, or find others with --odometry"
    return f"they stray by {aside}, {advice}" if found.strays else None


def _of_scale(scale: float) -> str:
    unit = next((name for times, name in UNITS.items() if 1 / ALIKE < scale / times < ALIKE), None)
    check = "check their unit and that of depth, or the baseline"
    cause = check if unit is None else f"are they in {unit}? expected metres"
    return f"their way is {scale:.4g} times as long: {cause}"


def _w_last(pose: Array) -> Array:
    """Give the pose whose quaternion was w, x, y, z and was read as x, y, z, w."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = Rotation.from_matrix(pose[:3, :3]).as_quat()
    meant = pose.copy()
    meant[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
    return meant


MISTAKES: dict[str, Callable[[Array], Array]] = {
    "they are inverted, of the session in the camera": lambda pose: np.asarray(np.linalg.inv(pose)),
    "their quaternions are w x y z, expected x y z w": _w_last,
    "their axes are x ahead, y left, z up, expected x right, y down, z forward": lambda pose: pose @ BODY_FROM_CAMERA,
    "their axes are x right, y up, z back, as OpenGL has them, expected x right, y down, z forward": (
        lambda pose: pose @ np.diag([1.0, -1.0, -1.0, 1.0])
    ),
}
"""What poses are meant, by the mistake that was made with them."""
