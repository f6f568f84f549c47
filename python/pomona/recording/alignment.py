"""Whether the rows of left and right pictures are the same, and what to do where they are not.

A rectified pair shows a point in the same row of both pictures. Where one camera was knocked since it was calibrated,
the right picture lies lower and is turned: corners that are found in both pictures tell, whatever their depth. The core
fits and decides (`stereo/alignment.rs`); small errors are taken out of the right picture. What is farther off than
corners are sought in their rows, corners that are sought everywhere tell. Pictures may be of different moments
(`eye_lag.py`; `late_eye.py` where few corners agree on anything).
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
from pomona.recording.evenly import evenly
from pomona.recording.eye_lag import Lag, lag_of
from pomona.recording.far_corners import far_corners
from pomona.recording.frame import Frame, Recording
from pomona.recording.late_eye import FEWEST, SURE_SHARE, frames_late
from pomona.recording.lens_bend import Bend, bend_of, distinct
from pomona.recording.part_of_recording import PartOfRecording
from pomona.recording.pictures import UnreadablePictureError
from pomona.recording.row_corners import row_errors
from pomona.trajectory import Trajectory

__all__ = ["Alignment", "StraightenedRecording", "alignment_of", "straightened"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

LOOKED_AT, LOOKED_AT_LONGER = 6, 24
"""Frames, evenly over the recording, that are measured; where those may show a bend, which parts the corners of leaves
by less than they err, so many."""

STRETCH_TOLD, MOST_STRETCH = 0.003, 0.02
"""By which the right picture is larger: told from, and taken out up to; good pairs are measured below 0.001."""

APART_ROWS = 100.0
"""Rows between the two places where the fit says how much lower the right picture is."""

BEYOND = 1.25
"""Times what is taken out, from which on corners that are sought everywhere count, which are less exact."""

AGREEING_PX, AGREEING_SHARE = 1.5, 1 / 3
"""Of corners that are sought everywhere, those of a pair that is one; of pictures of different places 1 in 10 agree."""

AT_ONCE_WIDTHS, LEAST_AT_ONCE_PX, SURE = 1 / 1280, 0.5, 40
"""Of corners that are sought in their rows: how near they agree where both were taken at once, which is no nearer
than a row is found to, and how many of them, so that nothing else is asked."""


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
    frames_late : int
        By how many frames the right pictures are late; below 0, early.
    lag : Lag or None
        By what part of a frame they were taken after their left ones, where it is to be told.
    bend : Bend or None
        What parts the rows towards the corners, where something does.
    """

    lower_px: float
    turned_rad: float
    stretch: float
    is_off: bool
    is_correctable: bool
    frames_late: int = 0
    lag: Lag | None = None
    bend: Bend | None = None

    def __str__(self) -> str:
        if self.lag is not None:
            return str(self.lag)
        if self.bend is not None:
            return str(self.bend)
        if self.frames_late:
            when, moved = ("late", "up") if self.frames_late > 0 else ("early", "down")
            return f"the right pictures are a frame {when}, corners agree when they are moved {moved} by one"
        turned = f"{self.lower_px:.1f} px lower and turned by {np.degrees(self.turned_rad):.2f} degrees"
        size = "larger" if self.stretch > 0 else "smaller"
        larger = f" and {abs(self.stretch):.1%} {size}" if abs(self.stretch) >= STRETCH_TOLD else ""
        return f"the right picture is {turned}{larger}"

    @property
    def advice(self) -> str:
        """What to do where it is not taken out."""
        if self.bend is not None:
            return (
                "rectify the pictures with the cameras' own calibration, or calibrate again; places and sizes are off"
            )
        if self.lag is not None or self.frames_late:
            return "trigger the cameras at once, or pair the pictures that were; all lengths are wrong else"
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
    lag = lag_of(recording)
    if lag is not None and lag.is_told:
        return Alignment(0.0, 0.0, 0.0, is_off=True, is_correctable=False, lag=lag)
    rows = evenly(len(recording), LOOKED_AT)
    centre_px = (recording.calibration.cx, recording.calibration.cy)
    found = _corners(recording, rows, row_errors)
    if found is None:
        return None
    within_px = max(AT_ONCE_WIDTHS * recording.calibration.width, LEAST_AT_ONCE_PX)
    agreeing = partial(_agreeing, centre_px=centre_px, within_px=within_px)
    n_agreeing = agreeing(found)
    longer, bend = _looked_at_longer(recording, found)
    # Most corners of pictures that were not taken at once agree on nothing, bent or not.
    if bend is not None and bend.is_sure and agreeing(bend.taken_out_of(longer)) >= SURE_SHARE * len(longer):
        return Alignment(0.0, 0.0, 0.0, is_off=True, is_correctable=False, bend=bend)
    # Corners that are mostly above or below the middle show a turn about the vertical as one about the axis, too.
    fitted = _fitted(bend.taken_out_of(longer) if bend is not None and bend.is_likely else longer, centre_px)
    if n_agreeing >= max(SURE, SURE_SHARE * len(found)):
        return fitted
    if len(found) >= FEWEST and (late := frames_late(recording, rows, n_agreeing, agreeing)):
        return Alignment(0.0, 0.0, 0.0, is_off=True, is_correctable=False, frames_late=late)
    anywhere = _corners(recording, rows, far_corners)
    return (None if anywhere is None else _beyond(anywhere, centre_px)) or fitted


def _looked_at_longer(recording: Recording, found: Array) -> tuple[Array, Bend | None]:
    """Fit a bend to the corners of a few frames, and of more where those may show one; give the last ones."""
    calibration = recording.calibration
    centre_px = (calibration.cx, calibration.cy)
    bend = bend_of(found, centre_px, calibration.fx)
    if bend is None or not bend.is_suspected:
        return found, bend
    many = _corners(recording, evenly(len(recording), LOOKED_AT_LONGER), row_errors)
    longer = distinct(found if many is None else many)
    return longer, bend_of(longer, centre_px, calibration.fx)


def _corners(recording: Recording, rows: list[int], find: Callable[[Picture, Picture], Array]) -> Array | None:
    """Give the corners that are found in the pairs of some frames; None where a frame is no pair."""
    found = []
    for frame in recording.frames({recording.numbers[row] for row in rows}):
        if frame.read_left is None or frame.read_right is None:
            return None
        try:
            found.append(find(frame.read_left(), frame.read_right()))
        except UnreadablePictureError:
            continue
    return np.concatenate(found) if found else None


def _fitted(corners: Array, centre_px: tuple[float, float]) -> Alignment | None:
    """Fit column there, row here and difference of the rows, (N, 3) and more; rows farther down tell the stretch."""
    corners = np.ascontiguousarray(corners[:, :3])
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
    _, y_left, x_right, y_right = places.T
    rows = np.stack([x_right, y_left, y_right - y_left], axis=1)
    found = _fitted(rows, centre_px)
    if found is None or _agreeing(rows, centre_px) < AGREEING_SHARE * len(places):
        return None
    most = (*_core.MOST_MISALIGNED, MOST_STRETCH)
    off = np.abs([found.lower_px, found.turned_rad, found.stretch])
    return found if (off > BEYOND * np.array(most)).any() else None


def _agreeing(corners: Array, centre_px: tuple[float, float], within_px: float = AGREEING_PX) -> int:
    """Count corners that lie as one fit has them; of too few for a fit, those as much lower as most are."""
    if not len(corners):
        return 0
    fit = _fitted(corners, centre_px)
    if fit is None:
        return int((np.abs(corners[:, 2] - np.median(corners[:, 2])) < within_px).sum())
    x, y = corners[:, 0] - centre_px[0], corners[:, 1] - centre_px[1]
    left_over = corners[:, 2] - fit.lower_px - fit.turned_rad * x - fit.stretch * y
    return int((np.abs(left_over) < within_px).sum())


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
