"""Whether the rows of left and right pictures are the same, and what to do where they are not.

A rectified pair shows a point in the same row of both pictures. Where one camera was knocked since it was calibrated,
the right picture lies lower and is turned: corners that are found in both pictures tell, whatever their depth. The core
fits and decides (`stereo/alignment.rs`); small errors are taken out of the right picture.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.errors import PomonaWarning
from pomona.recording.frame import Frame, Recording
from pomona.recording.part_of_recording import PartOfRecording
from pomona.recording.pictures import UnreadablePictureError
from pomona.trajectory import Trajectory

__all__ = ["Alignment", "StraightenedRecording", "alignment_of", "straightened"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

LOOKED_AT = 6
"""Frames, evenly over the recording, that are measured."""

CORNERS, PATCH_PX, MIN_DISTANCE_PX = 250, 15, 8

LEAST_CORRELATION = 0.85
"""Of a patch with its like in the other picture; below, leaves are found everywhere among leaves."""

LARGEST_SHARE = 0.25
"""Of the width of the picture, as disparity."""


@dataclass(frozen=True)
class Alignment:
    """How the right picture lies to the left one.

    Attributes
    ----------
    lower_px : float
        By how much the right picture shows everything lower.
    turned_rad : float
        By how much it is turned about its principal point, clockwise as seen.
    is_off : bool
        Whether it is to be told.
    is_correctable : bool
        Whether it is small enough to be taken out.
    """

    lower_px: float
    turned_rad: float
    is_off: bool
    is_correctable: bool

    def __str__(self) -> str:
        return (
            f"the right picture is {self.lower_px:.1f} px lower and turned by {np.degrees(self.turned_rad):.2f} degrees"
        )


def straightened(recording: Recording) -> Recording:
    """Give the recording with rows aligned, and warn where they were not; itself where they are, or nothing says."""
    found = alignment_of(recording)
    if found is None or not found.is_off:
        return recording
    if not found.is_correctable:
        most_px, most_rad = _core.MOST_MISALIGNED
        most = f"{most_px:g} px and {np.degrees(most_rad):.1f} degrees"
        message = f"{recording.path}: {found}, more than the {most} that are taken out: calibrate the cameras again"
        warnings.warn(message, PomonaWarning, stacklevel=3)
        return recording
    warnings.warn(f"{recording.path}: {found}: taken out, calibrate the cameras again", PomonaWarning, stacklevel=3)
    return StraightenedRecording(recording, found)


def alignment_of(recording: Recording) -> Alignment | None:
    """Measure how right pictures lie to left ones; None where too little shows in both, or one is not there."""
    found = np.zeros((0, 3))
    middles = (2 * np.arange(min(LOOKED_AT, len(recording))) + 1) * len(recording) // (2 * LOOKED_AT)
    looked_at = {recording.numbers[min(row, len(recording) - 1)] for row in middles.tolist()}
    for frame in recording.frames(looked_at):
        if frame.read_left is None or frame.read_right is None:
            return None
        try:
            found = np.concatenate([found, row_errors(frame.read_left(), frame.read_right())])
        except UnreadablePictureError:
            continue
    fitted = _core.row_alignment(found, (recording.calibration.cx, recording.calibration.cy))
    return None if fitted is None else Alignment(*fitted)


def row_errors(left: Picture, right: Picture) -> Array:
    """Find corners of the left picture in the right one: column there, row here and difference of the rows, (N, 3)."""
    import cv2

    greys = [cv2.cvtColor(one, cv2.COLOR_BGR2GRAY) if one.ndim == 3 else one for one in (left, right)]
    height, width = greys[0].shape
    half, reach = PATCH_PX // 2, _core.row_reach_px(width)
    corners = cv2.goodFeaturesToTrack(greys[0], CORNERS, 0.01, MIN_DISTANCE_PX)
    farthest = int(LARGEST_SHARE * width)
    found = []
    for x, y in () if corners is None else corners[:, 0].astype(int):
        low = max(x - half - farthest, 0)
        if not (half <= x < width - half and half + reach <= y < height - half - reach):
            continue
        patch = greys[0][y - half : y + half + 1, x - half : x + half + 1]
        strip = greys[1][y - half - reach : y + half + reach + 1, low : x + half + 1]
        similar = cv2.matchTemplate(strip, patch, cv2.TM_CCOEFF_NORMED)
        row, column = np.unravel_index(int(similar.argmax()), similar.shape)
        if similar[row, column] >= LEAST_CORRELATION and 0 < row < 2 * reach:
            found.append((low + half + column, y, row - reach + _vertex(similar[row - 1 : row + 2, column])))
    return np.array(found, np.float64).reshape(-1, 3)


def _vertex(three: NDArray[Any]) -> float:
    before, peak, after = map(float, three)
    bend = before - 2 * peak + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


@dataclass(frozen=True, eq=False)
class StraightenedRecording(PartOfRecording):
    """A recording whose right pictures are moved and turned to the rows of the left ones.

    Attributes
    ----------
    alignment : Alignment
        What is taken out.
    """

    alignment: Alignment

    @property
    def numbers(self) -> tuple[int, ...]:
        """Those of the whole."""
        return self.whole.numbers

    @property
    def trajectory(self) -> Trajectory | None:
        """That of the whole."""
        return self.whole.trajectory

    @property
    def times_s(self) -> NDArray[np.float64] | None:
        """Those of the whole."""
        return self.whole.times_s

    def __len__(self) -> int:
        return len(self.whole)

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Give the frames of the whole with straightened right pictures."""
        for frame in self.whole.frames(numbers):
            read = frame.read_right
            yield frame if read is None else replace(frame, read_right=partial(self._straightened, read))

    def inputs(self) -> Iterator[Path]:
        """Give the files of the whole."""
        return self.whole.inputs()

    def description(self) -> dict[str, Any]:
        """Describe the whole."""
        return self.whole.description()

    def _straightened(self, read: Callable[[], Picture]) -> Picture:
        """Give the picture that shows at (x, y) what was seen at (x, y) turned and lowered."""
        import cv2

        picture, calibration = read(), self.calibration
        cx, cy, turn = calibration.cx - 0.5, calibration.cy - 0.5, self.alignment.turned_rad
        seen_from_straight = np.array([[1.0, -turn, turn * cy], [turn, 1.0, self.alignment.lower_px - turn * cx]])
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        height, width = picture.shape[:2]
        return np.asarray(cv2.warpAffine(picture, seen_from_straight, (width, height), flags=flags), np.uint8)
