"""Whether the rows of left and right pictures are the same, and what to do where they are not.

A rectified pair shows a point in the same row of both pictures. Where one camera was knocked since it was calibrated,
the right picture lies lower and is turned: corners that are found in both pictures tell, whatever their depth. The core
fits and decides (`stereo/alignment.rs`); small errors are taken out of the right picture. What is farther off than
corners are sought in their rows, corners that are sought everywhere tell.
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
from pomona.recording.far_corners import far_corners
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

STRETCH_TOLD, MOST_STRETCH = 0.003, 0.02
"""By which the right picture is larger: told from, and taken out up to; good pairs are measured below 0.001."""

APART_ROWS = 100.0
"""Rows between the two places where the fit says how much lower the right picture is."""

BEYOND = 1.25
"""Times what is taken out, from which on corners that are sought everywhere count, which are less exact."""

AGREEING_PX, AGREEING_SHARE = 1.5, 1 / 3
"""Of corners that are sought everywhere, those of a pair that is one; of pictures of different places 1 in 10 agree."""

ON_SIDE = 1.5
"""Times as many corners that keep their column as corners that keep their row."""


@dataclass(frozen=True)
class Alignment:
    """How the right picture lies to the left one.

    Attributes
    ----------
    lower_px : float
        By how much the right picture shows everything lower.
    turned_rad : float
        By how much it is turned about its principal point, clockwise as seen.
    stretch : float
        By which part of its size it is larger.
    is_off : bool
        Whether it is to be told.
    is_correctable : bool
        Whether it is small enough to be taken out.
    is_on_side : bool
        Whether the pair lies on its side: corners keep their column, not their row.
    """

    lower_px: float
    turned_rad: float
    stretch: float
    is_off: bool
    is_correctable: bool
    is_on_side: bool = False

    def __str__(self) -> str:
        if self.is_on_side:
            return "corners keep their column in the right picture and not their row, the pair is turned on its side"
        turned = f"{self.lower_px:.1f} px lower and turned by {np.degrees(self.turned_rad):.2f} degrees"
        size = "larger" if self.stretch > 0 else "smaller"
        larger = f" and {abs(self.stretch):.1%} {size}" if abs(self.stretch) >= STRETCH_TOLD else ""
        return f"the right picture is {turned}{larger}"

    @property
    def advice(self) -> str:
        """What to do where it is not taken out."""
        if self.is_on_side:
            return "give the pictures as the cameras took them, side by side"
        most_px, most_rad = _core.MOST_MISALIGNED
        most = f"{most_px:g} px, {np.degrees(most_rad):.2f} degrees and {MOST_STRETCH:.0%}"
        return f"more than the {most} that are taken out, calibrate the cameras again"


def straightened(recording: Recording) -> Recording:
    """Give the recording with rows aligned, and warn where they were not; itself where they are, or nothing says."""
    found = alignment_of(recording)
    if found is None or not found.is_off:
        return recording
    if not found.is_correctable:
        warnings.warn(f"{recording.path}: {found}: {found.advice}", PomonaWarning, stacklevel=3)
        return recording
    warnings.warn(f"{recording.path}: {found}: taken out, calibrate the cameras again", PomonaWarning, stacklevel=3)
    return StraightenedRecording(recording, found)


def alignment_of(recording: Recording) -> Alignment | None:
    """Measure how right pictures lie to left ones; None where too little shows in both, or one is not there."""
    found, anywhere = np.zeros((0, 3)), np.zeros((0, 4))
    middles = (2 * np.arange(min(LOOKED_AT, len(recording))) + 1) * len(recording) // (2 * LOOKED_AT)
    looked_at = {recording.numbers[min(row, len(recording) - 1)] for row in middles.tolist()}
    for frame in recording.frames(looked_at):
        if frame.read_left is None or frame.read_right is None:
            return None
        try:
            left, right = frame.read_left(), frame.read_right()
        except UnreadablePictureError:
            continue
        found = np.concatenate([found, row_errors(left, right)])
        anywhere = np.concatenate([anywhere, far_corners(left, right)])
    centre_px = (recording.calibration.cx, recording.calibration.cy)
    return _beyond(anywhere, centre_px) or _fitted(found, centre_px)


def _fitted(corners: Array, centre_px: tuple[float, float]) -> Alignment | None:
    """Fit column there, row here and difference of the rows, (N, 3); rows farther down tell the stretch."""
    fitted = _core.row_alignment(corners, centre_px)
    below = _core.row_alignment(corners, (centre_px[0], centre_px[1] + APART_ROWS))
    if fitted is None or below is None:
        return None
    lower_px, turned_rad, is_off, is_correctable = fitted
    stretch = (below[0] - lower_px) / APART_ROWS
    is_off |= abs(stretch) >= STRETCH_TOLD
    return Alignment(lower_px, turned_rad, stretch, is_off, is_correctable and abs(stretch) <= MOST_STRETCH)


def _beyond(places: Array, centre_px: tuple[float, float]) -> Alignment | None:
    """Give the alignment where it is farther off than what is taken out; places as `far_corners` gives them."""
    x_left, y_left, x_right, y_right = places.T
    rows, columns = (np.stack([x_right, y_left, off], axis=1) for off in (y_right - y_left, x_right - x_left))
    found, least = _fitted(rows, centre_px), AGREEING_SHARE * len(places)
    in_rows, in_columns = (_agreeing(corners, centre_px) for corners in (rows, columns))
    if in_columns > max(least, ON_SIDE * in_rows):
        return Alignment(0.0, 0.0, 0.0, is_off=True, is_correctable=False, is_on_side=True)
    if found is None or in_rows < least:
        return None
    most = (*_core.MOST_MISALIGNED, MOST_STRETCH)
    off = np.abs([found.lower_px, found.turned_rad, found.stretch])
    return found if (off > BEYOND * np.array(most)).any() else None


def _agreeing(corners: Array, centre_px: tuple[float, float]) -> int:
    fit = _fitted(corners, centre_px)
    if fit is None:
        return 0
    x, y = corners[:, 0] - centre_px[0], corners[:, 1] - centre_px[1]
    left_over = corners[:, 2] - fit.lower_px - fit.turned_rad * x - fit.stretch * y
    return int((np.abs(left_over) < AGREEING_PX).sum())


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
    """A recording whose right pictures are moved, turned and sized to the rows of the left ones.

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
        """Give the picture that shows at (x, y) what was seen at (x, y) turned, larger and lowered."""
        import cv2

        picture, calibration = read(), self.calibration
        cx, cy, turn = calibration.cx - 0.5, calibration.cy - 0.5, self.alignment.turned_rad
        part, lower_px = self.alignment.stretch, self.alignment.lower_px
        seen_from_straight = np.array(
            [[1 + part, -turn, turn * cy - part * cx], [turn, 1 + part, lower_px - turn * cx - part * cy]]
        )
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        height, width = picture.shape[:2]
        return np.asarray(cv2.warpAffine(picture, seen_from_straight, (width, height), flags=flags), np.uint8)
