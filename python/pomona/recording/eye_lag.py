"""By what part of a frame right pictures were taken after or before their left ones: cameras not triggered at once.

A point that the picture moves by v rows from one frame to the next lies, in a right picture taken l frames later,

    y_right - y_left = a + t (x_right - c_x) + s (y_left - c_y) + l v

with the shift a, turn t and size s of a pair that is only misaligned. Those are the same in every frame and v is not: a
camera that is carried or driven rises, sinks, rolls and nods. So l is told to a few hundredths of a frame, though it is
what moves along the rows that spoils the disparities, by l times as many pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.recording.evenly import evenly
from pomona.recording.frame import Recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.recording.row_corners import row_errors
from pomona.recording.row_fit import row_fit

__all__ = ["Lag", "lag_of"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

LOOKED_AT, LOOKED_AT_LONGER = 6, 24
"""Frames, evenly over the recording; where the few may show a lag, many tell it."""

ENOUGH = 50
"""Corners that are found in the right picture and in the next left one, without which nothing is said."""

TOLD, SIGMAS = 0.1, 6.0
"""Lag from which on it is told, and how sure it must be: eleven good recordings are measured within 0.03."""

MOST = 1.2
"""Lag beyond which it is not told how long: the picture does not go on as it went for one frame."""

SUSPECTED, SUSPECTED_SIGMAS = 0.05, 1.5
"""From which on many frames are looked at."""

THERE_AND_BACK_PX = 0.5
"""How near a corner comes to where it was when it is followed to the next picture and back."""


@dataclass(frozen=True)
class Lag:
    """How late right pictures are.

    Attributes
    ----------
    frames : float
        Below 0 where they were taken before their left ones.
    sigma : float
        Its standard deviation.
    frame_s : float or None
        From one frame to the next; None where the recording has no times.
    disparity_px, passing_px : float
        In the median: disparities as they are measured, and by how many columns the picture moves in a frame.
    """

    frames: float
    sigma: float
    frame_s: float | None
    disparity_px: float
    passing_px: float

    @property
    def is_told(self) -> bool:
        """Whether it is large enough, and sure."""
        return abs(self.frames) >= TOLD and abs(self.frames) >= SIGMAS * self.sigma

    def __str__(self) -> str:
        when = "after" if self.frames > 0 else "before"
        if abs(self.frames) > MOST:
            return f"the right pictures were taken more than a frame {when} the left ones"
        lasting = "" if self.frame_s is None else f" ({1000 * abs(self.frames) * self.frame_s:.0f} ms)"
        off_px = abs(self.frames * self.passing_px)
        spoiled = f"disparities of {self.disparity_px:.0f} px are off by {off_px:.1f} px"
        lag = f"{abs(self.frames):.2f} of a frame{lasting} {when} the left ones"
        return f"the right pictures were taken {lag}, {spoiled}"


def lag_of(recording: Recording) -> Lag | None:
    """Measure the lag of the right pictures; None where nothing says."""
    found = _measured(recording, LOOKED_AT)
    if found is not None and abs(found.frames) < max(SUSPECTED, SUSPECTED_SIGMAS * found.sigma):
        return found
    return _measured(recording, LOOKED_AT_LONGER)


def _measured(recording: Recording, n_frames: int) -> Lag | None:
    """Fit the lag to what so many frames show."""
    found = list(_followed(recording, n_frames))
    corners = np.concatenate([np.zeros((0, 6)), *found])
    if len(corners) < ENOUGH:
        return None
    frames = np.repeat(np.arange(len(found)), [len(each) for each in found])
    fitted, times_s = _fitted(corners, frames, recording), recording.times_s
    if fitted is None:
        return None
    frame_s = None if times_s is None or len(times_s) < 2 else float(np.median(np.diff(times_s)))
    disparity_px, passing_px = np.median(corners[:, 3] - corners[:, 0]), np.median(np.abs(corners[:, 4]))
    return Lag(*fitted, frame_s, float(disparity_px), float(passing_px))


def _followed(recording: Recording, n_frames: int) -> Iterator[Array]:
    """Give the corners of each pair as `row_errors` does, with their way to the next left picture, (N, 6)."""
    numbers, n_steps = recording.numbers, len(recording) - 1
    rows = evenly(n_steps, n_frames)
    following = {numbers[row + 1]: numbers[row] for row in rows}
    firsts = {numbers[row] for row in rows}
    pairs: dict[int, tuple[Picture, Picture]] = {}
    for frame in recording.frames(firsts | following.keys()):
        if frame.read_left is None or frame.read_right is None:
            return
        try:
            left = frame.read_left()
            before = pairs.pop(following.get(frame.number, -1), None)
            if before is not None and len({picture.shape for picture in (*before, left)}) == 1:
                yield _corners(*before, left)
            if frame.number in firsts:
                pairs[frame.number] = left, frame.read_right()
        except UnreadablePictureError:
            continue


def _corners(left: Picture, right: Picture, following: Picture) -> Array:
    import cv2

    corners = row_errors(left, right)
    if not len(corners):
        return np.zeros((0, 6))
    here = np.ascontiguousarray(corners[:, [3, 1]], np.float32)
    there, is_found, _ = cv2.calcOpticalFlowPyrLK(left, following, here, here.copy())
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(following, left, there, there.copy())
    is_sure = (is_found * is_back)[:, 0] > 0
    is_sure &= np.linalg.norm(back - here, axis=1) < THERE_AND_BACK_PX
    return np.hstack([corners, there - here])[is_sure].astype(np.float64)


def _fitted(corners: Array, frames: NDArray[np.int64], recording: Recording) -> tuple[float, float] | None:
    """Fit the lag beside shift, turn and size, and tell how sure it is; None where the corners do not fix it."""
    camera = recording.calibration
    terms = np.stack(
        [
            np.ones(len(corners)),
            (corners[:, 0] - camera.cx) / camera.fx,
            (corners[:, 1] - camera.cy) / camera.fy,
            corners[:, 5],
        ],
        axis=1,
    )
    fit = row_fit(terms, corners[:, 2])
    if fit is None:
        return None
    # The corners of a frame err together, so each frame is one that errs.
    of_frames = np.zeros((frames[-1] + 1, terms.shape[1]))
    np.add.at(of_frames, frames, (fit.weights * fit.left_over)[:, None] * terms)
    covariance = fit.inverse @ (of_frames.T @ of_frames) @ fit.inverse
    return float(fit.factors[3]), float(np.sqrt(covariance[3, 3]))
