"""Whether depth pictures hold distances along the rays, as simulators give them, in place of depths along the axis.

A point that is seen in two frames lies at one place. With x, y from the principal point in focal lengths, its depth is
d, or d / sqrt(1 + x^2 + y^2) where d is a distance. Between the frames it moves in the picture, so under the wrong one
of both the points of one frame are not those of the other one, moved and turned.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.recording.calibration import Calibration
from pomona.recording.evenly import evenly
from pomona.recording.frame import Frame, Recording
from pomona.recording.pictures import UnreadablePictureError

__all__ = ["depth_along_rays"]

Array = NDArray[np.float64]

PAIRS, FEWEST_PAIRS, FEWEST = 8, 4, 15
"""Pairs of frames, evenly, that are looked at, those that must say something, and points in both frames of one."""

GAPS, MOVED_WIDTHS = (1, 2, 4, 8, 16), 0.05
"""Frames between the two of a pair: so many that points move by this part of the width, which tells both apart."""

CORNERS, MIN_DISTANCE_PX, WINDOW_PX, LEVELS, BACK_PX = 2000, 6, 15, 4, 0.5
"""Of a picture, followed by Lucas and Kanade in so many halvings, and how near each is led back to where it was."""

AROUND_PX, ONE_DEPTH = 3, 0.1
"""Around a corner, and by what share depths differ there at the most where it is no outline."""

ALIKE = 0.8
"""Correlation of what is around a corner in both pictures below which it was led astray."""

NOISE, FIRST_NOISE, ROUNDS = 0.01, 0.3, 10
"""Part of its depth by which a place errs; deviations of three count as wholly off. The fit begins with the second."""

BETTER, SURE, FITS = 0.15, 5.0, 0.3
"""By which the mean loss, 0 to 1, is less along the rays, in standard deviations too, and what it is there at the most.
Of an outsider's two dozen recordings of true depths it is more by .10 to .14; of the same made distances it is less by
.20 to .25, and .03 to .12, or .37 with noise of 1 % of the squared depth, which is not told; of depths that are a frame
late, moved or scaled it may be less by .20, and is .32 and more."""


def depth_along_rays(recording: Recording) -> str | None:
    """Say that the depth pictures hold distances along the rays, and what to do; None where nothing says so."""
    if not {"left", "depth"} <= set(recording.description()["pictures"]):
        return None
    gap = _gap(recording)
    pairs = [
        seen for row in evenly(len(recording) - gap, PAIRS) if (seen := _seen(recording, row, row + gap)) is not None
    ]
    if len(pairs) < FEWEST_PAIRS:
        return None
    losses = np.array([[_loss(seen, along_rays=along) for along in (False, True)] for seen in pairs])
    gains = losses[:, 0] - losses[:, 1]
    is_better = gains.mean() > max(BETTER, SURE * gains.std(ddof=1) / np.sqrt(len(gains)))
    if not is_better or losses[:, 1].mean() > FITS:
        return None
    found = "the depth pictures hold distances along the rays, expected depths along the optical axis"
    return f"{found}: divide by sqrt(1 + x^2 + y^2), x and y from the principal point in focal lengths"


def _gap(recording: Recording) -> int:
    """Give the frames after which the points in the middle of the recording have moved far enough."""
    for gap in GAPS:
        seen = _seen(recording, len(recording) // 2 - gap // 2, len(recording) // 2 - gap // 2 + gap)
        if seen is not None:
            moved = np.linalg.norm(seen[2] - seen[0], axis=1) * recording.calibration.fx
            if np.median(moved) >= MOVED_WIDTHS * recording.calibration.width:
                return gap
    return GAPS[0]


Seen = tuple[Array, Array, Array, Array]
"""Of points: x and y in one frame, from the principal point in focal lengths, (N, 2), what its depth picture says, (N,)
metres, and the same in the other frame."""


def _seen(recording: Recording, first: int, second: int) -> Seen | None:
    """Follow corners from one frame to another; None where too few have a depth in both."""
    import cv2

    if not 0 <= first < second < len(recording):
        return None
    numbers = [recording.numbers[row] for row in (first, second)]
    frames = {frame.number: frame for frame in recording.frames(set(numbers))}
    pictures = [_pictures(frames[number]) for number in numbers]
    if pictures[0] is None or pictures[1] is None:
        return None
    (grey, depth_m), (other, other_m) = pictures[0], pictures[1]
    corners = cv2.goodFeaturesToTrack(grey, CORNERS, 0.01, MIN_DISTANCE_PX)
    if corners is None:
        return None
    led, there = _followed(grey, other, corners)
    back, here = _followed(other, grey, led)
    corners, led, back = corners[:, 0], led[:, 0], back[:, 0]
    kept = there & here & (np.linalg.norm(back - corners, axis=1) < BACK_PX)
    kept &= ((led >= 0) & (led <= np.array(grey.shape[::-1]) - 1)).all(axis=1)
    kept &= _likeness((grey, other), (np.asarray(corners, np.float32), led)) > ALIKE
    depths_m, others_m = _at(depth_m, corners[kept]), _at(other_m, led[kept])
    known = (depths_m > 0) & (others_m > 0)
    if known.sum() < FEWEST:
        return None
    rays, other_rays = (_rays(one[kept][known], recording.calibration) for one in (corners, led))
    return rays, depths_m[known], other_rays, others_m[known]


def _followed(
    grey: NDArray[np.uint8], other: NDArray[np.uint8], corners: NDArray[Any]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Give the places (N, 1, 2) of corners in another picture, and which of them are found."""
    import cv2

    window = (WINDOW_PX, WINDOW_PX)
    no_idea = np.zeros_like(corners)
    led, found, _ = cv2.calcOpticalFlowPyrLK(grey, other, corners, no_idea, winSize=window, maxLevel=LEVELS)
    return np.asarray(led, np.float32), found[:, 0] > 0


def _likeness(pictures: tuple[NDArray[np.uint8], ...], places: tuple[NDArray[np.float32], ...]) -> Array:
    """Correlate what is around places of two pictures, (N,): a fine texture is led to anywhere, there and back."""
    import cv2

    window = (WINDOW_PX, WINDOW_PX)
    patches = [
        np.array([cv2.getRectSubPix(picture, window, (float(x), float(y))) for x, y in of], np.float64)
        for picture, of in zip(pictures, places, strict=True)
    ]
    patches = [one - one.mean(axis=(1, 2), keepdims=True) for one in patches]
    first, second = patches
    norms = np.sqrt((first**2).sum(axis=(1, 2)) * (second**2).sum(axis=(1, 2)))
    return np.asarray((first * second).sum(axis=(1, 2)) / np.maximum(norms, 1e-9))


def _pictures(frame: Frame) -> tuple[NDArray[np.uint8], NDArray[np.float32]] | None:
    """Read the grey picture of a frame and its depth."""
    import cv2

    if frame.read_left is None or frame.read_depth is None:
        return None
    try:
        left, depth_m = frame.read_left(), frame.read_depth()
    except UnreadablePictureError:
        return None
    return np.asarray(cv2.cvtColor(left, cv2.COLOR_BGR2GRAY) if left.ndim == 3 else left, np.uint8), depth_m


def _at(depth_m: NDArray[np.float32], places: NDArray[np.float32]) -> Array:
    """Give the depth of places, (N,), 0 where it is not known or not one: an outline moves as what is before it."""
    columns, rows = np.rint(places).astype(int).T
    (height, width), beside = depth_m.shape, range(-AROUND_PX, AROUND_PX + 1)
    steps = [(down, aside) for down in beside for aside in beside]
    around = np.array(
        [depth_m[(rows + down).clip(0, height - 1), (columns + aside).clip(0, width - 1)] for down, aside in steps]
    )
    nearest = np.where(around > 0, around, np.inf).min(axis=0)
    is_one = around.max(axis=0) < (1 + ONE_DEPTH) * nearest
    return np.where(is_one, depth_m[rows, columns], 0.0).astype(np.float64)


def _rays(places: NDArray[np.float32], calibration: Calibration) -> Array:
    """Give x and y in focal lengths of places whose whole numbers are the middles of pixels."""
    centre, focal = (calibration.cx, calibration.cy), (calibration.fx, calibration.fy)
    return np.asarray((places.astype(np.float64) + 0.5 - centre) / focal, np.float64)


def _loss(seen: Seen, along_rays: bool) -> float:
    """Fit the motion of the points between the frames, and give how badly they fit, 0 to 1 in the mean."""
    rays, depths_m, other_rays, others_m = seen
    before, after = _points(rays, depths_m, along_rays), _points(other_rays, others_m, along_rays)
    weights = after[:, 2] ** -2
    off = np.empty(0)
    for noise in np.maximum(FIRST_NOISE * 0.5 ** np.arange(ROUNDS), NOISE):
        off = np.linalg.norm(_moved(before, after, weights) - after, axis=1) / after[:, 2]
        # Points that count nothing count a little, so that the motion stays fixed.
        weights = (np.clip(1 - (off / (3 * noise)) ** 2, 0, None) ** 2 + 1e-9) / after[:, 2] ** 2
    return float((np.minimum(off / (3 * NOISE), 1) ** 2).mean())


def _points(rays: Array, told_m: Array, along_rays: bool) -> Array:
    depths_m = told_m / np.sqrt(1 + (rays**2).sum(axis=1)) if along_rays else told_m
    return np.asarray(depths_m[:, None] * np.column_stack([rays, np.ones(len(rays))]), np.float64)


def _moved(before: Array, after: Array, weights: Array) -> Array:
    """Move and turn points, (N, 3), to where others are, by weighted least squares (Kabsch)."""
    middles = [np.average(points, axis=0, weights=weights) for points in (before, after)]
    u, _, vt = np.linalg.svd((weights[:, None] * (after - middles[1])).T @ (before - middles[0]))
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return np.asarray((before - middles[0]) @ turn.T + middles[1], np.float64)
