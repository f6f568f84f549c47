r"""From a box and a depth picture to a fruit in 3D.

The outline (`pomona.outline`) fixes a fruit up to its distance: centre c = (X/Z, Y/Z, 1), radius s = R/Z. The depth
picture gives Z (`pomona.surface`). The fruit is then at Z c with the diameter 2 s Z. So the centre lies behind the
surface by the radius that the outline gives, on the axis Z = depth / (1 - s); no constant is added.

Covariance of the centre, to first order, with the ray c as its long axis:

    C = var(Z) c c^T + Z^2 diag(sigma_cx^2, sigma_cy^2, 0)
    var(Z) = sigma_vote^2 / n + (Z sigma_s)^2 + (roundness R)^2 + (scale Z)^2 + (Z^2 sigma_d / (f B))^2    (4)

sigma_vote is the spread of the depths that agree: noise and the surface's own shape; n the number of independent
patches of surface they come from; Z sigma_s the outline's error, which moves the centre behind the surface; then what
fruits differ from a sphere, the depth camera's own scale, and for a stereo pair what the disparities of one fruit err
by together, sigma_d. The diameter has the variance

    var(D) = (2 Z sigma_s)^2 + (2 s)^2 var(Z) + (roundness D)^2 + (hidden D)^2,                      (5)

hidden being the part of it that leaves are expected to hide: such boxes are too small, never too large.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.outline import Outline, outline_of_box
from pomona.recording.calibration import Calibration
from pomona.surface import SURFACE_PATCHES, Vote, covered_edges, shifted, vote_for_depth

__all__ = ["Lifted", "Refusal", "lift"]

Array = NDArray[np.float64]

ROUNDNESS_SIGMA = 0.03
"""How far fruits are from a sphere, over the radius (or diameter): calipers on two diameters of an apple differ by
2-5 %."""

SCALE_SIGMA = 0.001
"""Error of depth in proportion to depth, as the makers of time-of-flight cameras state it."""

HIDDEN = (0.09, 0.04, 0.02)
"""Mean part of the diameter that leaves hide, by the number of axes on which no leaf covers an edge: 0, 1, 2. With
`HIDDEN_UNSUPPORTED` it makes what boxes around the visible part of rendered fruits lack: 10, 6 and 3 %
(`rendered_row`, both dates)."""

HIDDEN_UNSUPPORTED = 0.04
"""What is added to it for a fruit of which nearly nothing agrees with the outline."""


class Refusal(StrEnum):
    """Why a box did not become a fruit."""

    CUT = "cut by the edge of the picture"
    NO_DEPTH = "no depth in the box"


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


@dataclass(frozen=True)
class _Fruit:
    centre: Array
    covariance: Array
    diameter_m: float
    diameter_sigma_m: float
    hidden: float
    support: float


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
        When `disparity_sigma_px` is given and the calibration has no baseline.
    """
    depth_sigma_per_m2 = _depth_sigma_per_m2(calibration, disparity_sigma_px, len(boxes_px))
    size = np.array([calibration.width, calibration.height, calibration.width, calibration.height], np.float64)
    fruits: dict[int, _Fruit] = {}
    refused: Counter[Refusal] = Counter()
    for row, box_px in enumerate(np.clip(boxes_px, 0.0, size)):
        fruit = _lift_box(depth_m, box_px, calibration, float(depth_sigma_per_m2[row]))
        if isinstance(fruit, Refusal):
            refused[fruit] += 1
        else:
            fruits[row] = fruit
    found = fruits.values()
    return Lifted(
        rows=np.array(list(fruits), np.int64),
        centres_in_camera=np.array([fruit.centre for fruit in found]).reshape(-1, 3),
        covariances=np.array([fruit.covariance for fruit in found]).reshape(-1, 3, 3),
        diameters_m=np.array([fruit.diameter_m for fruit in found], np.float64),
        diameter_sigmas_m=np.array([fruit.diameter_sigma_m for fruit in found], np.float64),
        hidden=np.array([fruit.hidden for fruit in found], np.float64),
        support=np.array([fruit.support for fruit in found], np.float64),
        refused=refused,
    )


def _depth_sigma_per_m2(calibration: Calibration, disparity_sigma_px: float | Array | None, count: int) -> Array:
    """Give sigma_Z / Z^2 of each box, 0 where depth is no stereo depth."""
    if disparity_sigma_px is None:
        return np.zeros(count)
    if calibration.baseline_m is None:
        raise PomonaError("baseline_m: found none, expected one where depth has a disparity_sigma_px")
    return np.broadcast_to(disparity_sigma_px, count) / (calibration.fx * calibration.baseline_m)


def _lift_box(
    depth_m: NDArray[np.float32], box_px: Array, calibration: Calibration, depth_sigma_per_m2: float
) -> _Fruit | Refusal:
    outline = outline_of_box(box_px, calibration)
    if outline is None:
        return Refusal.CUT
    depths, rays = _pixels(depth_m, box_px, calibration)
    vote = vote_for_depth(depths, rays, outline.centre, outline.radius)
    if vote is None:
        return Refusal.NO_DEPTH
    covered = covered_edges(depth_m, box_px, vote.depth_m, outline.radius)
    if any(covered):
        outline = outline_of_box(box_px, calibration, covered) or outline
        vote = vote_for_depth(depths, rays, outline.centre, outline.radius) or vote
    centre, centre_sigma = outline.centre, outline.centre_sigma
    if outline.hidden_axis is not None:
        centre, centre_sigma = shifted(depths, rays, outline, vote)
        vote = vote_for_depth(depths, rays, centre, outline.radius) or vote
    return _fruit(outline, vote, centre, centre_sigma, depth_sigma_per_m2)


def _pixels(depth_m: NDArray[np.float32], box_px: Array, calibration: Calibration) -> tuple[Array, Array]:
    """Depths (P,) and rays (P, 3) of the pixels in a box; a missing depth is 0."""
    xmin, ymin = np.floor(box_px[:2]).astype(int)
    xmax, ymax = np.ceil(box_px[2:]).astype(int)
    x, y = np.meshgrid(np.arange(xmin, xmax) + 0.5, np.arange(ymin, ymax) + 0.5)
    depths = depth_m[ymin:ymax, xmin:xmax].astype(np.float64)
    return depths.ravel(), calibration.rays(np.stack([x, y], axis=-1)).reshape(-1, 3)


def _fruit(outline: Outline, vote: Vote, centre: Array, centre_sigma: Array, depth_sigma_per_m2: float) -> _Fruit:
    """Put a fruit together with its covariance, equations (4) and (5)."""
    z, s = vote.depth_m, outline.radius
    diameter_m = 2 * s * z
    patches = max(1.0, SURFACE_PATCHES * vote.support)
    along2 = (
        vote.sigma_m**2 / patches
        + (z * outline.radius_sigma) ** 2
        + (ROUNDNESS_SIGMA * s * z) ** 2
        + (SCALE_SIGMA * z) ** 2
        + (depth_sigma_per_m2 * z**2) ** 2
    )
    ray = np.array([centre[0], centre[1], 1.0])
    covariance = along2 * np.outer(ray, ray) + z**2 * np.diag([centre_sigma[0] ** 2, centre_sigma[1] ** 2, 0.0])
    hidden = HIDDEN[outline.whole_axes] + HIDDEN_UNSUPPORTED * (1.0 - vote.support)
    diameter_sigma_m = np.sqrt(
        (2 * z * outline.radius_sigma) ** 2 + 4 * s**2 * along2 + (ROUNDNESS_SIGMA**2 + hidden**2) * diameter_m**2
    )
    return _Fruit(z * ray, covariance, diameter_m, float(diameter_sigma_m), hidden, vote.support)
