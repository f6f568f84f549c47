r"""From a box to the cone in which a round fruit sits.

A sphere of radius R at (X, Y, Z), seen by a pinhole camera. In the plane x-z it is a circle of radius R at (X, Z),
and the planes through the camera's y axis that touch it make the angles theta_x -+ alpha_x with the optical axis,
where

    tan theta_x = X / Z,     sin alpha_x = R / sqrt(X^2 + Z^2) = (R / Z) cos theta_x.          (1)

These planes are the left and right edges of the sphere's box: with a_0 = atan((xmin - cx) / fx), a_1 likewise,
theta_x = (a_0 + a_1) / 2 and alpha_x = (a_1 - a_0) / 2. So a box gives, with no approximation for fruits off the axis,

    X / Z = tan theta_x,     Y / Z = tan theta_y,     R / Z = sin alpha / cos theta of either axis.

Scale and distance stay open: depth gives them. Not every edge of a box is the fruit's own. The edge of the picture
and a leaf in front leave only a bound: the fruit ends there or beyond. Size and place come from the edges that are
the fruit's: an axis with both gives R / Z, one edge and R / Z give the centre. Where a side has no edge of its own,
and where a box is longer one way than fruits are, the centre may lie anywhere from flush with one short edge to flush
with the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.recording.calibration import Calibration

__all__ = ["Outline", "outline_of_box"]

EDGE_SIGMA_PX = 1.0
"""One edge of a box: half a pixel of rounding, and what people and detectors disagree by on a clear outline."""

ROUNDNESS = 1.15
"""Long side over short side above which a fruit counts as partly hidden; whole Fuji apples stay below 1.12."""

COVERED_SIGMA = 0.06
"""How much too small R / Z may be, over R / Z, when no axis has both edges free of leaves."""

PICTURE_EDGE_PX = 1.0
"""A box edge this near the edge of the picture is the picture's, not the fruit's."""

MIN_SEEN = 0.5
"""Part of the diameter that the picture must hold: with less than half, the other side of the box is only a chord."""


@dataclass(frozen=True)
class Outline:
    """Cone around a fruit; all numbers are ratios to the depth Z of its centre.

    Attributes
    ----------
    centre : (2,) float64
        X / Z, Y / Z.
    radius : float
        R / Z.
    centre_sigma : (2,) float64
        Standard deviation of `centre` from the edges of the box.
    radius_sigma : float
        The same of `radius`.
    hidden_axis : int or None
        0 or 1 where the fruit is partly hidden along x or y.
    slack : float
        How far the centre can lie from `centre` along `hidden_axis`, either way; 0 without one.
    whole_axes : int
        How many axes have both edges of the fruit itself, 0 to 2.
    """

    centre: NDArray[np.float64]
    radius: float
    centre_sigma: NDArray[np.float64]
    radius_sigma: float
    hidden_axis: int | None
    slack: float
    whole_axes: int


@dataclass(frozen=True)
class _Side:
    """One axis of a box: angles of its edges, which the picture cuts, which are the fruit's own; a sigma."""

    angles: tuple[float, float]
    cut: tuple[bool, bool]
    own: tuple[bool, bool]
    edge_sigma: float

    @property
    def whole(self) -> bool:
        return all(self.own)

    @property
    def middle(self) -> float:
        return math.tan((self.angles[0] + self.angles[1]) / 2)

    @property
    def radius(self) -> float:
        low, high = self.angles
        return math.sin((high - low) / 2) / math.cos((low + high) / 2)


NONE_COVERED = (False, False, False, False)


def outline_of_box(
    box_px: NDArray[np.float64],
    calibration: Calibration,
    covered: tuple[bool, bool, bool, bool] = NONE_COVERED,
) -> Outline | None:
    """Give the cone of a box, None where the edge of the picture leaves size or place open.

    Parameters
    ----------
    box_px : (4,) float64
        xmin, ymin, xmax, ymax inside the picture.
    calibration : Calibration
        The camera of the picture.
    covered : (4,) bool
        Edges where something nearer than the fruit begins, in the order of the box.
    """
    xmin, ymin, xmax, ymax = (float(edge) for edge in box_px)
    sides = (
        _side((xmin, xmax), (covered[0], covered[2]), calibration.width, calibration.fx, calibration.cx),
        _side((ymin, ymax), (covered[1], covered[3]), calibration.height, calibration.fy, calibration.cy),
    )
    if not _decided(sides):
        return None
    if all(side.whole for side in sides):
        return _whole(sides)
    return _bounded(sides)


def _side(
    edges_px: tuple[float, float], covered: tuple[bool, bool], size_px: int, focal_px: float, centre_px: float
) -> _Side:
    low, high = (math.atan((edge - centre_px) / focal_px) for edge in edges_px)
    cut = edges_px[0] <= PICTURE_EDGE_PX, edges_px[1] >= size_px - PICTURE_EDGE_PX
    own = not (cut[0] or covered[0]), not (cut[1] or covered[1])
    return _Side((low, high), cut, own, edge_sigma=EDGE_SIGMA_PX / focal_px)


def _decided(sides: tuple[_Side, _Side]) -> bool:
    """Whether the picture leaves enough of the fruit: at most one edge cut, and over half of that side there."""
    cuts = [sum(side.cut) for side in sides]
    if sum(cuts) == 0:
        return True
    side, other = (sides[0], sides[1]) if cuts[0] else (sides[1], sides[0])
    return sum(cuts) == 1 and side.radius >= MIN_SEEN * other.radius


def _whole(sides: tuple[_Side, _Side]) -> Outline:
    """All four edges are the fruit's own."""
    radii = sides[0].radius, sides[1].radius
    long = int(radii[1] > radii[0])
    middle_sigma = np.array([side.edge_sigma for side in sides]) / math.sqrt(2)  # the mean of two edges
    centre = np.array([side.middle for side in sides])
    slack = radii[long] - radii[1 - long]
    # Rounding alone makes a fruit of few pixels elongated.
    if radii[long] > ROUNDNESS * radii[1 - long] and slack > middle_sigma.max():
        return Outline(centre, radii[long], middle_sigma, float(middle_sigma[long]), 1 - long, slack, 2)
    radius_sigma = float(np.hypot(*middle_sigma)) / 2  # half the difference of two edges, averaged over two sides
    return Outline(centre, math.sqrt(radii[0] * radii[1]), middle_sigma, radius_sigma, None, 0.0, 2)


def _bounded(sides: tuple[_Side, _Side]) -> Outline:
    """Take size from the longer side and place from edges of the fruit's own, where others are only bounds.

    A box as round as fruits are was drawn around the whole fruit, leaf or not: it counts as it is.
    """
    short, long = sorted(side.radius for side in sides)
    is_cut = any(sides[0].cut) or any(sides[1].cut)
    is_round = not is_cut and long <= ROUNDNESS * short
    radius = math.sqrt(short * long) if is_round else long
    whole_axes = sides[0].whole + sides[1].whole
    axis = int(sides[1].radius > sides[0].radius) if whole_axes == 0 else int(sides[1].whole)
    edge_sigma = sides[axis].edge_sigma / math.sqrt(2)
    radius_sigma = edge_sigma if whole_axes else math.hypot(edge_sigma, COVERED_SIGMA * radius)
    other = sides[1 - axis]
    centre, centre_sigma = np.empty(2), np.empty(2)
    centre[axis], centre_sigma[axis] = sides[axis].middle, max(edge_sigma, radius_sigma)
    centre[1 - axis], centre_sigma[1 - axis] = other.middle, other.edge_sigma / math.sqrt(2)
    if is_round or other.whole:
        return Outline(centre, radius, centre_sigma, radius_sigma, None, 0.0, whole_axes)
    if not any(other.own):
        slack = max(radius - other.radius, 0.0)
        return Outline(centre, radius, centre_sigma, radius_sigma, 1 - axis, slack, whole_axes)
    own = 0 if other.own[0] else 1
    centre[1 - axis] = _centre_from_edge(other.angles[own], radius, +1 if own == 0 else -1)
    centre_sigma[1 - axis] = math.hypot(other.edge_sigma, radius_sigma)
    return Outline(centre, radius, centre_sigma, radius_sigma, None, 0.0, whole_axes)


def _centre_from_edge(angle: float, radius: float, inwards: int) -> float:
    """Solve angle = theta -+ asin(radius cos theta) for tan theta; equation (1) with one edge."""
    theta = angle
    for _ in range(20):  # a contraction with factor radius * |sin theta|, 0.1 for the nearest fruits
        theta = angle + inwards * math.asin(min(radius * math.cos(theta), 1.0))
    return math.tan(theta)
