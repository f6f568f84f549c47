"""Where the camera was in each frame: as recorded, or found by odometry; one interface for both."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.odometry import Motion, OdometryTrajectory, StereoOdometry
from pomona.recording import Frame, Recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.prefetch import Kind
from pomona.survey.refinement import Motions, SeenFruits, refine
from pomona.survey.sightings import Sightings
from pomona.survey.thinning import between_keys, followed, stride

__all__ = ["Followed", "Place", "PoseSource", "odometry_of", "pose_source_of"]


OFF_PX = 0.5
"""What the disparities of a good calibration are off by together, after some months."""

FAR_PX = 10.0
"""Median disparity below which that makes more than 5 % of all lengths."""


@dataclass(frozen=True, eq=False)
class Place:
    """Pose of one frame.

    Attributes
    ----------
    session_from_camera : (4, 4) float64 or None
        In the frame of reference of its part; None where this frame alone could not be placed.
    part : int
        0, 1, ...: a new one, with its own frame of reference, begins where the track broke.
    broken : str or None
        Why a new part begins here, or why this frame has no pose.
    """

    session_from_camera: NDArray[np.float64] | None
    part: int = 0
    broken: str | None = None


class PoseSource(Protocol):
    """Gives the place of each frame, in order."""

    needs: tuple[Kind, ...]

    def __call__(self, frame: Frame) -> Place:
        """Place the next frame."""

    def refined(
        self, part: int, frames: Sequence[int], sightings: Sightings, fruits: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Give the poses of the frames of a part, (F, 4, 4), by all that is known at the end.

        Parameters
        ----------
        part : int
            Which part.
        frames : sequence of F int
            Its frame numbers.
        sightings : Sightings
            What they saw.
        fruits : (S,) int64
            Which sightings are of one fruit, -1 of none.
        """


def pose_source_of(
    recording: Recording, *, odometry: bool = False, config: Mapping[str, Any] | None = None
) -> PoseSource:
    """Choose where poses come from.

    Parameters
    ----------
    recording : Recording
        With poses, or with one frame, or with left and right (or left and depth) pictures.
    odometry : bool
        Use odometry even where there are poses.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`; the odometry's is `odometry`.

    Raises
    ------
    PomonaError
        When there are neither poses nor the pictures that odometry needs.
    """
    if recording.trajectory is not None and not odometry:
        return _Recorded(recording)
    if len(recording) == 1 and not odometry:
        return _Recorded(recording)
    return Followed(recording, config)


def odometry_of(recording: Recording, config: Mapping[str, Any] | None = None) -> Followed | None:
    """Follow the camera by its pictures; None where the recording has not those that it takes."""
    pictures = recording.description()["pictures"]
    stereo = "right" in pictures and recording.calibration.baseline_m is not None
    return Followed(recording, config) if "left" in pictures and (stereo or "depth" in pictures) else None


class _Recorded:
    """Poses that came with the recording; a single frame without is its own frame of reference."""

    needs: tuple[Kind, ...] = ()

    def __init__(self, recording: Recording) -> None:
        known = recording.trajectory
        poses = np.eye(4)[None] if known is None else known.session_from_camera
        frames = recording.numbers if known is None else known.frames.tolist()
        self._pose_of = dict(zip(frames, poses, strict=True))

    def __call__(self, frame: Frame) -> Place:
        pose = self._pose_of.get(frame.number)
        return Place(pose, broken=None if pose is not None else "it has no pose")

    def refined(
        self, part: int, frames: Sequence[int], sightings: Sightings, fruits: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        del part, sightings, fruits  # recorded poses are trusted
        return np.array([self._pose_of[frame] for frame in frames]).reshape(-1, 4, 4)


class Followed:
    """Poses found in the pictures by odometry, refined with the fruits at the end.

    Raises
    ------
    PomonaError
        When the recording has no left pictures, or neither right pictures with a baseline nor depth.
    """

    def __init__(self, recording: Recording, config: Mapping[str, Any] | None) -> None:
        pictures = recording.description()["pictures"]
        stereo = "right" in pictures and recording.calibration.baseline_m is not None
        if "left" not in pictures or not (stereo or "depth" in pictures):
            found = " and ".join(pictures)
            raise PomonaError(
                f"{recording.path}: found {found} pictures and no poses, expected poses, or left and right pictures"
            )
        self.needs: tuple[Kind, ...] = ("left", "right") if stereo else ("left", "depth")
        self._stereo, self._path = stereo, recording.path
        self._odometry = StereoOdometry(recording.calibration, config)
        self._count_of: dict[int, int] = {}

    def __call__(self, frame: Frame) -> Place:
        """Follow the camera to the next frame."""
        self._count_of[frame.number] = len(self._count_of)
        motion = self._moved(frame)
        return Place(motion.session_from_camera, motion.part, motion.broken or motion.lost)

    def _moved(self, frame: Frame) -> Motion:
        try:
            left = _grey(_read(frame, "left", frame.read_left))
            if self._stereo:
                return self._odometry(left, _grey(_read(frame, "right", frame.read_right)))
            return self._odometry.with_depth(left, _read(frame, "depth", frame.read_depth))
        except UnreadablePictureError as error:
            return self._odometry.skip(str(error))

    def motions(self, frames: Sequence[int]) -> Motions:
        """Give what was measured between some frames, by their rows in the list."""
        row_of = {self._count_of[frame]: row for row, frame in enumerate(frames)}
        way = self._way
        rows = np.array([row_of.get(int(count), -1) for count in way.frames], np.int64).reshape(-1)
        first, second = rows[way.first], rows[way.second]
        kept = np.flatnonzero((first >= 0) & (second >= 0))
        # In a gust most points of the picture move with the leaves, and what agrees may be a motion that never was.
        doubtful = np.ones(len(kept), bool)
        return Motions(first[kept], second[kept], way.first_from_second[kept], way.information[kept], doubtful)

    def refined(
        self, part: int, frames: Sequence[int], sightings: Sightings, fruits: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Adjust all poses of the part together, by what was measured between them and by the fruits they saw."""
        way = self._way
        rows = np.flatnonzero(way.parts == part)
        of_part = {int(count): row for row, count in enumerate(way.frames[rows])}
        ours = np.array([of_part[self._count_of[frame]] for frame in frames], np.int64)
        poses, motions = way.session_from_camera[rows], _between(way, rows)
        seen = _seen(sightings, fruits, ours)
        every = stride(seen.frames, seen.fruits, len(rows))
        if every == 1:
            return np.asarray(refine(poses, seen, motions).session_from_camera[ours])
        keys = np.unique([*range(0, len(rows), every), len(rows) - 1])
        refined = refine(poses[keys], _seen_by(seen, keys), between_keys(poses, motions, keys))
        return followed(poses, keys, refined.session_from_camera)[ours]

    @cached_property
    def _way(self) -> OdometryTrajectory:
        way = self._odometry.trajectory()
        if self._stereo and way.median_disparity_px < FAR_PX:
            part = OFF_PX / way.median_disparity_px
            found = f"found a median disparity of {way.median_disparity_px:.1f} px over whole pictures"
            message = (
                f"{self._path}: {found}, expected {FAR_PX:g} px or more: {OFF_PX:g} px that the calibration is off by "
                f"make {part:.0%} of lengths there, and less of those of nearer fruits"
            )
            warnings.warn(message, PomonaWarning, stacklevel=2)
        return way


def _seen(sightings: Sightings, fruits: NDArray[np.int64], rows: NDArray[np.int64]) -> SeenFruits:
    """Sightings of fruits for the refinement; fruits seen once hold nothing together."""
    views = np.bincount(fruits[fruits >= 0], minlength=1)
    kept = np.flatnonzero((fruits >= 0) & (views[np.maximum(fruits, 0)] > 1))
    return SeenFruits(
        frames=rows[sightings.rows[kept]],
        fruits=np.unique(fruits[kept], return_inverse=True)[1],
        centres_in_camera=sightings.centres_in_camera[kept],
        covariances=sightings.covariances[kept],
    )


def _seen_by(sightings: SeenFruits, keys: NDArray[np.int64]) -> SeenFruits:
    """Sightings of some frames, which become the rows 0, 1, ... ."""
    kept = np.flatnonzero(np.isin(sightings.frames, keys))
    return SeenFruits(
        frames=np.searchsorted(keys, sightings.frames[kept]),
        fruits=np.unique(sightings.fruits[kept], return_inverse=True)[1],
        centres_in_camera=sightings.centres_in_camera[kept],
        covariances=sightings.covariances[kept],
    )


def _between(way: OdometryTrajectory, rows: NDArray[np.int64]) -> Motions:
    """Motions between the frames of one part, by their rows in it."""
    row_of = np.full(len(way), -1, np.int64)
    row_of[rows] = np.arange(len(rows))
    ours = np.flatnonzero(row_of[way.first] >= 0)
    return Motions(
        row_of[way.first[ours]], row_of[way.second[ours]], way.first_from_second[ours], way.information[ours]
    )


def _read(frame: Frame, name: str, read: Callable[[], NDArray[Any]] | None) -> NDArray[Any]:
    if read is None:
        raise PomonaError(f"frame {frame.number}: found no {name} picture, expected one in every frame")
    return read()


def _grey(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    import cv2

    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
