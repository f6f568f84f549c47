"""Where the camera was, by the constellations of all frames at once, with odometry where it holds.

The recording is walked through twice: first each frame is looked at and the way is laid out, loops closed; then the
fruits are tracked along it. What the frames show is kept from the first time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.recording import Frame, Recording
from pomona.survey.pose_source import Followed, Place, odometry_of
from pomona.survey.prefetch import Kind, prefetched
from pomona.survey.seeing import Look, looked_ahead
from pomona.survey.sightings import Sightings
from pomona.survey.slam import FruitWay, way_by_fruits

__all__ = ["MappedWay", "mapped_way"]

ALONE = "its fruits are those of no other frame"


class MappedWay:
    """A way that is known before its frames come; a `PoseSource`.

    Parameters
    ----------
    looks : mapping of int to Look
        What each frame shows, by its number.
    frames : sequence of F int
        Numbers of the frames that could be used.
    way : FruitWay
        Of these.
    whole : bool
        Whether all frames of the recording were looked at.
    """

    needs: tuple[Kind, ...] = ()

    def __init__(self, looks: Mapping[int, Look], frames: Sequence[int], way: FruitWay, *, whole: bool) -> None:
        self._looks, self.way, self._whole = looks, way, whole
        self._placed = 0
        self._row_of = {frame: row for row, frame in enumerate(frames)}
        self._part_of = _numbered(way.parts)
        self._begun = {-1}

    def look(self, frame: Frame) -> Look:
        """Give what a frame shows."""
        return self._looks[frame.number]

    def stop_after(self, stop: Callable[[], bool] | None) -> Callable[[], bool] | None:
        """Give what tells when to stop: at the last frame that was looked at, where looking was stopped before."""
        return stop if self._whole else lambda: self._placed == len(self._looks)

    def __call__(self, frame: Frame) -> Place:
        """Place the next frame."""
        self._placed += 1
        row = self._row_of.get(frame.number)
        part = -1 if row is None else self._part_of[self.way.parts[row]]
        if row is None or part < 0:
            return Place(None, broken=ALONE)
        broken = None if part in self._begun or part == 0 else "its fruits are not those of the frames before"
        self._begun.add(part)
        return Place(self.way.session_from_camera[row], part, broken)

    def refined(
        self, part: int, frames: Sequence[int], sightings: Sightings, fruits: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Give the poses, which are adjusted already."""
        del part, sightings, fruits
        rows = [self._row_of[frame] for frame in frames]
        return np.asarray(self.way.session_from_camera[rows])


def mapped_way(
    recording: Recording,
    look_at: Callable[[Frame], Look],
    needs: Sequence[Kind],
    *,
    config: Mapping[str, Any] | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> MappedWay:
    """Look at all frames, and find the way.

    Parameters
    ----------
    recording : Recording
        With what `look_at` needs; odometry helps where it has the pictures for that.
    look_at : callable
        Says what a frame shows.
    needs : sequence of str
        Pictures that it asks for.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`.
    progress : callable, optional
        As in `pomona.survey.scan`; this is half of the work.
    stop : callable, optional
        Once it says yes, the way of the frames so far is found.

    Raises
    ------
    PomonaError
        No frame is found in another one.
    """
    odometry = odometry_of(recording, config)
    looks: dict[int, Look] = {}
    frames = prefetched(recording.frames(), (*needs, *(odometry.needs if odometry else ())))
    with closing(frames), ThreadPoolExecutor(1, "pomona-look") as looker:
        for frame, coming in looked_ahead(frames, look_at, looker):
            if odometry is not None:
                odometry(frame)
            looks[frame.number] = coming.result()
            if progress is not None:
                progress(len(looks), 2 * len(recording), 0)
            if stop is not None and stop():
                break
    return _laid_out(recording, looks, odometry, config)


def _laid_out(
    recording: Recording, looks: Mapping[int, Look], odometry: Followed | None, config: Mapping[str, Any] | None
) -> MappedWay:
    usable = [number for number, look in looks.items() if look.unusable is None]
    clouds = [
        FruitCloud(positions=look.lifted.centres_in_camera, covariances=look.lifted.covariances)
        for look in (looks[number] for number in usable)
    ]
    way = way_by_fruits(clouds, odometry.motions(usable) if odometry else None, config=config)
    if len(usable) and np.bincount(way.parts).max() < 2:
        if len(usable) == 1:
            raise PomonaError(f"{recording.path}: found 1 frame to follow, expected two or more; leave out --slam")
        found = f"found {amount(len(usable), 'frame')} that show no fruits in common"
        raise PomonaError(f"{recording.path}: {found}, expected 5 or more in each two; without --slam odometry follows")
    return MappedWay(looks, usable, way, whole=len(looks) == len(recording))


def _numbered(parts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Count the parts of more than one frame in order of time; -1 for the others."""
    several = np.bincount(parts) > 1 if len(parts) else np.zeros(0, bool)
    return np.where(several, np.cumsum(several) - 1, -1)
