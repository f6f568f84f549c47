"""From a box and a depth picture to a fruit in 3D: the face of the core's `lifting`, which does the work.

The box gives the cone in which a round fruit sits, the depths inside it vote for the distance of its centre, and the
centre lies behind the surface by the radius of the cone there. Equations and limits: docs/depth.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration
from pomona.stereo.fruit_depth import FruitDepth

__all__ = ["Lifted", "Refusal", "lift"]

Array = NDArray[np.float64]


class Refusal(StrEnum):
    """Why a box did not become a fruit."""

    CUT = "cut by the edge of the picture"
    NO_DEPTH = "no depth in the box"
    UNMATCHED = "no sure match in the right picture"


_LIFTED = 0
_REFUSED = {1: Refusal.CUT, 2: Refusal.NO_DEPTH, 3: Refusal.UNMATCHED}
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
        Part of the outline's pixels whose depth is on the fruit, 0 to 1; 0 where the depth is not measured but what
        the usual size of the picture's fruits says, with a sigma of 15 % or more.
    refused : mapping of int to Refusal
        Row of each box that could not be lifted, and why.
    """

    rows: NDArray[np.int64]
    centres_in_camera: Array
    covariances: Array
    diameters_m: Array
    diameter_sigmas_m: Array
    hidden: Array
    support: Array
    refused: Mapping[int, Refusal]

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def none(cls) -> Lifted:
        """Give what is known where nothing was looked at."""
        empty = np.empty(0)
        return cls(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3, 3)), empty, empty, empty, empty, {})

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Which depths were measured, (M,); the others are guesses from the size of the outline."""
        return np.asarray(self.support > 0)


def lift(
    depth: NDArray[np.float32] | FruitDepth,
    boxes_px: Array,
    calibration: Calibration,
    *,
    disparity_sigma_px: float | Array | None = None,
) -> Lifted:
    """Lift boxes to fruits in 3D, in the frame of the camera.

    Parameters
    ----------
    depth : (H, W) float32, or FruitDepth
        Depth along the optical axis, metres, 0 where nothing was measured; or what a stereo pair gave for these boxes.
    boxes_px : (D, 4) float64
        xmin, ymin, xmax, ymax; origin at the top left corner of the top left pixel. What is outside is cut.
    calibration : Calibration
        The camera of the depth picture.
    disparity_sigma_px : float or (D,) float64, optional
        For a depth picture of a stereo pair: standard deviation of a fruit's disparity, in pixels. It makes the centre
        uncertain along its ray by Z^2 / (f B) of it. A `FruitDepth` brings its own.

    Raises
    ------
    PomonaError
        When the picture has another size than the calibration, or depth is stereo and the calibration has no baseline.
    """
    found = depth
    if not isinstance(found, FruitDepth):
        sigma_px = 0.0 if disparity_sigma_px is None else disparity_sigma_px
        found = FruitDepth(found, np.broadcast_to(np.asarray(sigma_px, np.float64), len(boxes_px)))
    if found.depth_m.shape != (calibration.height, calibration.width):
        size = " x ".join(str(side) for side in reversed(found.depth_m.shape))
        raise PomonaError(f"depth: found {size} pixels, expected {calibration.width} x {calibration.height}")
    outcome, centres, covariances, numbers = _core.lift(
        np.ascontiguousarray(found.depth_m, np.float32),
        np.asarray(boxes_px, np.float64).reshape(-1, 4),
        _sources(found, calibration),
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
        refused={row: _REFUSED[code] for row, code in enumerate(outcome.tolist()) if code != _LIFTED},
    )


def _sources(found: FruitDepth, calibration: Calibration) -> Array:
    """Give sigma_Z / Z^2, depth of the centre and support of each box; a depth of NaN leaves it to votes."""
    sigmas_px = found.disparity_sigma_px
    if not np.any(sigmas_px) and found.disparity_px is None:
        focal_baseline_px_m = 1.0
    elif calibration.baseline_m is None:
        raise PomonaError("baseline_m: found none, expected one where depth is of a stereo pair")
    else:
        focal_baseline_px_m = calibration.fx * calibration.baseline_m
    absent = np.full(len(sigmas_px), np.nan)
    depth_m = absent if found.disparity_px is None else focal_baseline_px_m / found.disparity_px
    support = absent if found.support is None else found.support
    return np.stack([sigmas_px / focal_baseline_px_m, depth_m, support], axis=1)
