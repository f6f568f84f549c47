"""From a box and a depth picture to a fruit in 3D: the face of the core's `lifting`, which does the work.

The box gives the cone in which a round fruit sits, the depths inside it vote for the distance of its centre, and the
centre lies behind the surface by the radius of the cone there. Equations and limits: docs/depth.md.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration

__all__ = ["Lifted", "Refusal", "lift"]

Array = NDArray[np.float64]


class Refusal(StrEnum):
    """Why a box did not become a fruit."""

    CUT = "cut by the edge of the picture"
    NO_DEPTH = "no depth in the box"


_LIFTED = 0
_REFUSED = {1: Refusal.CUT, 2: Refusal.NO_DEPTH}
"""Outcomes as the core numbers them."""


@dataclass(frozen=True, eq=False)
class Lifted:
    """Fruits of one frame in 3D, one row for each box that could be lifted.

    Attributes
    ----------
    rows : (M,) int64
        Row of the box.
    centres_in_camera : (M, 3) float64
        Centres, metres.
    covariances : (M, 3, 3) float64
        Their covariances, square metres.
    diameters_m, diameter_sigmas_m : (M,) float64
        Diameters and their standard deviations.
    hidden : (M,) float64
        Mean part of the diameter that leaves are expected to hide; its square is in `diameter_sigmas_m`.
    support : (M,) float64
        Part of the outline's pixels whose depth is on the fruit, 0 to 1.
    refused : Counter of Refusal
        Boxes that could not be lifted, by reason.
    """

    rows: NDArray[np.int64]
    centres_in_camera: Array
    covariances: Array
    diameters_m: Array
    diameter_sigmas_m: Array
    hidden: Array
    support: Array
    refused: Counter[Refusal]

    def __len__(self) -> int:
        return len(self.rows)


def lift(
    depth_m: NDArray[np.float32],
    boxes_px: Array,
    calibration: Calibration,
    *,
    disparity_sigma_px: float | Array | None = None,
) -> Lifted:
    """Lift boxes to fruits in 3D, in the frame of the camera.

    Parameters
    ----------
    depth_m : (H, W) float32
        Depth along the optical axis, metres, 0 where nothing was measured.
    boxes_px : (D, 4) float64
        xmin, ymin, xmax, ymax; origin at the top left corner of the top left pixel. What is outside is cut.
    calibration : Calibration
        The camera of the depth picture.
    disparity_sigma_px : float or (D,) float64, optional
        For depth that a stereo pair gave: standard deviation of a fruit's disparity, in pixels. It makes the centre
        uncertain along its ray by Z^2 / (f B) of it. Needs the baseline of `calibration`.

    Raises
    ------
    PomonaError
        When the picture has another size than the calibration, or `disparity_sigma_px` is given and the calibration
        has no baseline.
    """
    if depth_m.shape != (calibration.height, calibration.width):
        found = " x ".join(str(side) for side in reversed(depth_m.shape))
        raise PomonaError(f"depth: found {found} pixels, expected {calibration.width} x {calibration.height}")
    boxes_px = np.asarray(boxes_px, np.float64).reshape(-1, 4)
    outcome, centres, covariances, numbers = _core.lift(
        np.ascontiguousarray(depth_m, np.float32),
        boxes_px,
        _depth_sigma_per_m2(calibration, disparity_sigma_px, len(boxes_px)),
        calibration,
    )
    diameters_m, diameter_sigmas_m, hidden, support = np.ascontiguousarray(numbers.T)
    return Lifted(
        rows=np.flatnonzero(outcome == _LIFTED),
        centres_in_camera=centres,
        covariances=covariances,
        diameters_m=diameters_m,
        diameter_sigmas_m=diameter_sigmas_m,
        hidden=hidden,
        support=support,
        refused=Counter(_REFUSED[int(code)] for code in outcome[outcome != _LIFTED]),
    )


def _depth_sigma_per_m2(calibration: Calibration, disparity_sigma_px: float | Array | None, count: int) -> Array:
    """Give sigma_Z / Z^2 of each box, 0 where depth is no stereo depth."""
    if disparity_sigma_px is None:
        return np.zeros(count)
    if calibration.baseline_m is None:
        raise PomonaError("baseline_m: found none, expected one where depth has a disparity_sigma_px")
    sigmas_px = np.broadcast_to(np.asarray(disparity_sigma_px, np.float64), count)
    return np.ascontiguousarray(sigmas_px / (calibration.fx * calibration.baseline_m))
