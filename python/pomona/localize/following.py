"""The story of a localisation: recording -> boxes, depth and motion, frame by frame -> where the camera is."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.detect import Detector
from pomona.errors import PomonaError
from pomona.localize.course import Step, Way
from pomona.localize.localizer import Localizer
from pomona.match_arguments import Up
from pomona.recording import Frame, Recording
from pomona.recording.alignment import straightened
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.depth import Lifted
from pomona.survey.pose_source import Place, PoseSource, pose_source_of
from pomona.survey.prefetch import prefetched
from pomona.survey.seeing import Seeing, looked_ahead

__all__ = ["Moving", "cloud_of", "localize"]

Progress = Callable[[int, int], None]
"""Called after each frame with frames done and frames found."""


def localize(
    recording: Recording,
    detector: Detector,
    localizer: Localizer,
    *,
    single: bool = False,
    depth: str = "auto",
    odometry: bool = False,
    up: Up | None = None,
    progress: Progress | None = None,
) -> Way:
    """Find the camera in every frame of a recording.

    Parameters
    ----------
    recording : Recording
        With depth, or left and right, pictures.
    detector : Detector
        Gives boxes.
    localizer : Localizer
        The map; what it knows of frames before is forgotten.
    single : bool
        Take each frame from nothing. Else frames are tracked, by the motion that the recording has or its pictures
        show.
    depth : str
        As in `pomona.survey.scan`.
    odometry : bool
        Take the motion from the pictures even where the recording has poses.
    up : optional
        The vertical in the camera's and in the map's frame.
    progress : callable, optional
        Called after each frame.

    Raises
    ------
    PomonaError
        Pictures that are needed are not there, or no frame can be used.
    """
    if not (depth == "auto" and "depth" in recording.description()["pictures"]):
        recording = straightened(recording)
    seeing = Seeing(recording, detector, depth=depth, colour=False)
    camera = None if single else Moving(pose_source_of(recording, odometry=odometry))
    localizer.reset()
    steps: list[Step] = []
    skipped: dict[int, str] = {}
    frames = prefetched(recording.frames(), seeing.needs if camera is None else (*seeing.needs, *camera.needs))
    with closing(frames), ThreadPoolExecutor(1, "pomona-look") as looker:
        for frame, coming in looked_ahead(frames, seeing, looker):
            moved = None if camera is None else camera(frame)
            look = coming.result()
            if look.unusable is not None:
                skipped[frame.number] = look.unusable
                continue
            cloud = cloud_of(look.lifted)
            found = localizer.locate(cloud, up=up) if single else localizer.update(cloud, moved, up=up)
            if camera is not None:
                camera.use()
            # Where nobody noted the time, frames are numbered: order is all that is known.
            time_s = float(frame.number if frame.time_s is None else frame.time_s)
            steps.append(Step(frame.number, time_s, cloud, found))
            if progress is not None:
                progress(len(steps) + len(skipped), sum(map(bool, (step.found for step in steps))))
    if not steps:
        raise PomonaError(next(iter(skipped.values()), f"{recording.path}: found no frame, expected at least one"))
    return Way(tuple(steps), skipped)


def cloud_of(lifted: Lifted) -> FruitCloud:
    """Give the fruits of one frame as a cloud in the frame of its camera."""
    return FruitCloud(
        positions=lifted.centres_in_camera, covariances=lifted.covariances, diameters_m=lifted.diameters_m
    )


class Moving:
    """How the camera moved since the frame that was used last, None where nobody knows; frames are given in order."""

    def __init__(self, source: PoseSource) -> None:
        self._source = source
        self._used = self._now = Place(None)
        self.needs = source.needs

    def __call__(self, frame: Frame) -> NDArray[np.float64] | None:
        """Follow the camera to the next frame; give its pose in the frame of the camera that was used last, (4, 4)."""
        try:
            self._now = self._source(frame)
        except UnreadablePictureError:
            self._now = Place(None)
        before, pose = self._used.session_from_camera, self._now.session_from_camera
        if before is None or pose is None or self._used.part != self._now.part:
            return None
        return np.asarray(np.linalg.solve(before, pose))

    def use(self) -> None:
        """Use the frame: the next motion is since this one. Of a frame that is skipped the motion is not lost so."""
        self._used = self._now
