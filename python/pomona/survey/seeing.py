"""What one frame shows: boxes, each lifted to 3D where it can be, and its colour. No frame needs another."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.detect import Detections, Detector
from pomona.errors import PomonaError
from pomona.recording import Calibration, Frame, Recording
from pomona.recording.checks.readable import is_blank
from pomona.recording.pictures import UnreadablePictureError
from pomona.stereo import open_stereo
from pomona.survey.depth import Lifted, lift
from pomona.survey.prefetch import Kind

__all__ = ["Look", "Seeing", "looked_ahead"]

LOOKS_AHEAD = 2
"""Frames that are looked at before the camera is followed to them: neither waits for an uneven other."""


@dataclass(frozen=True, eq=False)
class Look:
    """One frame, seen.

    Attributes
    ----------
    frame : int
        Frame number.
    detections : Detections
        D boxes.
    lifted : Lifted
        The boxes in 3D, those that could be.
    colours : (D, 3) uint8 or None
        Median colour of each box, BGR; None where the recording has none.
    fruitness, fruit_px : (D,) float64 or None
        How far the colours in each box are the fruits' and not the leaves', 0 to 1, and how many of its pixels are
        rather fruit; None where the recording has no colour.
    elsewhere : (E,) float64 or None
        Fruitness of places that no box touches.
    unusable : str or None
        Why nothing was looked at: a picture cannot be read or shows nothing. The boxes are there as far as the detector
        knows them all the same.
    """

    frame: int
    detections: Detections
    lifted: Lifted
    colours: NDArray[np.uint8] | None = None
    fruitness: NDArray[np.float64] | None = None
    fruit_px: NDArray[np.float64] | None = None
    elsewhere: NDArray[np.float64] | None = None
    unusable: str | None = None


class _Depth(Protocol):
    """Gives the fruits of one frame in 3D."""

    needs: tuple[Kind, ...]

    def __call__(self, frame: Frame, boxes_px: NDArray[np.float64]) -> Lifted: ...


class Seeing:
    """Detector and depth of one recording.

    Parameters
    ----------
    recording : Recording
        With depth, or with left and right pictures and a baseline.
    detector : Detector
        Gives the boxes.
    depth : str
        ``auto``: depth pictures, else from left and right at the fruits. Or from left and right even where there are
        depth pictures: ``stereo``, ``dense`` or a file, as in `pomona.stereo.open_stereo`.
    colour : bool
        Whether to look at colours too, where there are some.

    Raises
    ------
    PomonaError
        When the recording has neither depth nor a stereo pair.
    """

    def __init__(self, recording: Recording, detector: Detector, *, depth: str = "auto", colour: bool = True) -> None:
        self._detector = detector
        self._depth = _depth_of(recording, depth)
        self._colour = colour and "left" in recording.description()["pictures"]

    @property
    def needs(self) -> tuple[Kind, ...]:
        """Pictures that every frame is asked for."""
        return tuple(dict.fromkeys((*self._depth.needs, *(("left",) if self._colour else ()))))

    @property
    def stereo(self) -> bool:
        """Whether depth comes from left and right."""
        return isinstance(self._depth, _FromStereo)

    def __call__(self, frame: Frame) -> Look:
        """Look at one frame; `Look.unusable` where a picture fails, or the left one, which depth needs, is blank."""
        detections = Detections.none()
        try:
            detections = self._detector(frame)
            return self._seen(frame, detections)
        except UnreadablePictureError as error:
            return Look(frame.number, detections, Lifted.none(), unusable=str(error))

    def _seen(self, frame: Frame, detections: Detections) -> Look:
        if "left" in self._depth.needs and frame.read_left is not None and is_blank(frame.read_left()):
            raise UnreadablePictureError(f"frame {frame.number}: the left picture shows nothing")
        lifted = self._depth(frame, detections.boxes_px)
        look = Look(frame.number, detections, lifted)
        # Where nobody looked, places without a box are no places without a fruit.
        if not self._colour or frame.read_left is None or not detections.looked:
            return look
        left, boxes_px = frame.read_left(), detections.boxes_px
        colours, fruitness, fruit_px, elsewhere = _core.look_of(np.ascontiguousarray(left), boxes_px)
        return replace(look, colours=colours, fruitness=fruitness, fruit_px=fruit_px, elsewhere=elsewhere)


def _depth_of(recording: Recording, how: str) -> _Depth:
    pictures = recording.description()["pictures"]
    if "depth" in pictures and how == "auto":
        return _FromPictures(recording)
    if {"left", "right"} <= pictures.keys() and recording.calibration.baseline_m is not None:
        return _FromStereo(recording.calibration, "stereo" if how == "auto" else how)
    found = " and ".join(pictures)
    expected = "depth, or left and right" if how == "auto" else "left and right"
    raise PomonaError(f"{recording.path}: found {found} pictures, expected {expected}")


class _FromPictures:
    """Depth that was recorded."""

    needs: tuple[Kind, ...] = ("depth",)

    def __init__(self, recording: Recording) -> None:
        self._recording = recording

    def __call__(self, frame: Frame, boxes_px: NDArray[np.float64]) -> Lifted:
        if frame.read_depth is None:
            raise PomonaError(f"{self._recording.path}: frame {frame.number} has no depth picture")
        return lift(frame.read_depth(), boxes_px, self._recording.calibration)


class _FromStereo:
    """Depth from left and right."""

    needs: tuple[Kind, ...] = ("left", "right")

    def __init__(self, calibration: Calibration, how: str) -> None:
        self._calibration, self._measure = calibration, open_stereo(how, calibration)

    def __call__(self, frame: Frame, boxes_px: NDArray[np.float64]) -> Lifted:
        if frame.read_left is None or frame.read_right is None:
            raise PomonaError(f"frame {frame.number}: found one picture, expected left and right")
        found = self._measure(frame.read_left(), frame.read_right(), boxes_px)
        return lift(found, boxes_px, self._calibration)


def looked_ahead(
    frames: Iterable[Frame], look_at: Callable[[Frame], Look], looker: Executor
) -> Iterator[tuple[Frame, Future[Look]]]:
    """Give each frame and its look, which another thread takes; those of the next frames are begun already."""
    begun: deque[tuple[Frame, Future[Look]]] = deque()
    for frame in frames:
        begun.append((frame, looker.submit(look_at, frame)))
        if len(begun) > LOOKS_AHEAD:
            yield begun.popleft()
    yield from begun
