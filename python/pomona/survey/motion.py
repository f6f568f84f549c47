"""Where the camera was in each frame: as recorded, or found by odometry; one interface for both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording import Frame, Recording
from pomona.survey.prefetch import Kind
from pomona.survey.sightings import Sightings

__all__ = ["Camera", "Place", "camera_of"]


POSE_FILES = "poses_tum.txt, in a TUM RGB-D folder groundtruth.txt"


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


class Camera(Protocol):
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


def camera_of(recording: Recording, *, odometry: bool = False) -> Camera:
    """Choose where poses come from.

    Parameters
    ----------
    recording : Recording
        With poses, or with one frame, or with left and right (or left and depth) pictures.
    odometry : bool
        Use odometry even where there are poses.

    Raises
    ------
    PomonaError
        When there are neither poses nor the pictures that odometry needs.
    """
    if recording.trajectory is not None and not odometry:
        return _Recorded(recording)
    if len(recording) == 1 and not odometry:
        return _Recorded(recording)
    raise PomonaError(f"{recording.path}: found {len(recording)} frames without poses, expected {POSE_FILES}")


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
