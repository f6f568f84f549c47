r"""The front of a round fruit in a depth picture: where it is, what hides it.

With centre c = (X/Z, Y/Z, 1) and radius s = R/Z of its outline, a pixel with the ray q = (x, y, 1) meets the front of
the fruit at the depth t Z, where |t q - c|^2 = s^2:

    t = (q.c - sqrt((q.c)^2 - |q|^2 (|c|^2 - s^2))) / |q|^2.                                         (2)

So **every pixel votes for the depth of the centre**, Z = d / t. Pixels on the fruit agree, a leaf in front votes
nearer, the row behind farther, and the best supported vote wins:

    log L(Z) = sum_pixels log( p_fruit N(d; t Z, sigma) + p_leaf U(in front) + p_gap U(behind) )     (3)

with p_leaf > p_gap: a leaf in front is common, but nothing is seen through a fruit, so a depth behind the surface
speaks against it. Tukey's biweight refines the winner. The size never comes from the curvature of the depth: depth
cameras flatten small spheres (skin lets infrared in, filters smooth). A sphere fitted to box and depth together
made the apples of `kinect_apples` 25 mm too large on average; the box alone 6 mm, most of it the nominal focal length.

A fruit hidden along one side of its box is shifted along it: the mean over the likelihood of the
depths under the shifts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.outline import Outline

__all__ = ["SURFACE_PATCHES", "Vote", "covered_edges", "shifted", "vote_for_depth"]

Array = NDArray[np.float64]

FACE = 0.85
"""Part of the outline's radius that votes: beyond it the surface is steep and depth cameras mix it with what is
behind."""

RIM = 0.97
"""The same when few pixels inside `FACE` have a depth, and for the shift of a partly hidden fruit, which shows at the
rim."""

MIN_PIXELS = 8
"""Fewer depths than this in a box are a matter of chance."""

SURFACE_SIGMA = 0.2
"""sigma of equation (3) over the radius: a leaf is farther than this from the surface, a dent or stalk pit is not."""

MIN_SURFACE_SIGMA_M = 0.003
"""sigma of equation (3) for the smallest fruits: what depth cameras scatter."""

MIN_VOTE_SIGMA_M = 0.0005
"""Depth pictures come in steps of 1 mm."""

P_FRUIT, P_LEAF, P_GAP = 0.6, 0.35, 0.05
"""Shares of the pixels in an outline: on the fruit, hidden by a leaf, or through to what is behind (bad outline or
depth)."""

LEAF_RANGE_M, GAP_RANGE_M = 0.3, 1.0
"""How far in front hide leaves and branches, how far behind the next row begins: the ranges of the uniform parts of
(3)."""

CANDIDATES = 49
"""Depths tried in (3), at equal steps of rank of the votes: never farther apart than a fiftieth of the votes."""

SHIFTS = 17
"""Places tried along the hidden side of a box; the farthest two leave the fruit flush with one edge."""

SHAPE_SIGMA = 0.1
"""sigma of the surface over the radius while its place along a hidden side is sought: shape counts here, not only
depth."""

SURFACE_PATCHES = 8.0
"""Independent patches on the face of a whole fruit: shape and filters err alike over a third of the diameter. With it
the same apples scatter between the captures of `kinect_apples` by no more than the covariances say."""

REACH_PX, BEYOND_PX = 2, 3
"""A fruit that comes this near an edge of its box reaches it; the strip beyond the edge that is asked for what
begins."""

COVERED_SHARE = 0.5
"""An edge is covered when most of what lies beyond it is nearer than the fruit."""


@dataclass(frozen=True)
class Vote:
    """Depth of the centre, the spread of the votes that agree, their share of the outline's pixels."""

    depth_m: float
    sigma_m: float
    support: float


def covered_edges(
    depth_m: NDArray[np.float32], box_px: Array, fruit_m: float, radius: float
) -> tuple[bool, bool, bool, bool]:
    """Say at which edges of a box something nearer than the fruit begins, in the order xmin, ymin, xmax, ymax.

    Looked at are the rows (columns) in which the fruit reaches the edge. What lies beyond a fruit's own edge is farther
    than its rim, which is as far as its centre, or has no depth; a leaf that hides the rest is nearer.
    """
    xmin, ymin = np.floor(box_px[:2]).astype(int)
    xmax, ymax = np.ceil(box_px[2:]).astype(int)
    left, top = max(xmin - BEYOND_PX, 0), max(ymin - BEYOND_PX, 0)
    around = depth_m[top : ymax + BEYOND_PX, left : xmax + BEYOND_PX]
    columns, rows = slice(xmin - left, xmax - left), slice(ymin - top, ymax - top)
    # From half a radius in front of the fruit to half a radius behind its centre.
    on_fruit = np.abs(around[rows, columns] / fruit_m - 1.0 + radius / 2) < radius
    nearer = (around > 0) & (around < fruit_m)

    def covered(reach: NDArray[np.bool_], beyond: NDArray[np.bool_]) -> bool:
        return beyond.size > 0 and bool(reach.any()) and float(beyond[reach].mean()) > COVERED_SHARE

    return (
        covered(on_fruit[:, :REACH_PX].any(axis=1), nearer[rows, : columns.start]),
        covered(on_fruit[:REACH_PX].any(axis=0), nearer[: rows.start, columns].T),
        covered(on_fruit[:, -REACH_PX:].any(axis=1), nearer[rows, columns.stop :]),
        covered(on_fruit[-REACH_PX:].any(axis=0), nearer[rows.stop :, columns].T),
    )


def _sphere_depths(rays: Array, centre: Array, radius: float, part: float) -> tuple[NDArray[np.bool_], Array]:
    """Say which rays meet the sphere within `part` of its radius, and give t of those, equation (2)."""
    c = np.array([centre[0], centre[1], 1.0])
    along = rays @ c
    length2 = np.einsum("ij,ij->i", rays, rays)
    root2 = along**2 - length2 * (c @ c - radius**2)
    # The ray passes the centre at h with (h / R)^2 = 1 - root2 / (|q| s)^2.
    inside = root2 > (1.0 - part**2) * length2 * radius**2
    return inside, (along[inside] - np.sqrt(root2[inside])) / length2[inside]


def vote_for_depth(depths: Array, rays: Array, centre: Array, radius: float) -> Vote | None:
    """Find the depth of the centre that the pixels agree on."""
    for part in (FACE, RIM):
        inside, t = _sphere_depths(rays, centre, radius, part)
        measured = depths[inside] > 0
        if measured.sum() >= MIN_PIXELS:
            d, t = depths[inside][measured], t[measured]
            depth_m = _best_supported(d, t, radius)
            depth_m, sigma_m, agree = _biweight(d / t, depth_m, SURFACE_SIGMA * radius * depth_m)
            return Vote(depth_m, sigma_m, agree / len(measured))
    return None


def _best_supported(d: Array, t: Array, radius: float) -> float:
    """Maximise equation (3) over the votes themselves."""
    candidates = np.quantile(d / t, np.linspace(0.02, 0.98, CANDIDATES))[:, None]
    behind = d - candidates * t
    sigma = np.maximum(MIN_SURFACE_SIGMA_M, SURFACE_SIGMA * radius * candidates)
    on_fruit = P_FRUIT * np.exp(-0.5 * (behind / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
    elsewhere = np.where(behind < 0, P_LEAF / LEAF_RANGE_M, P_GAP / GAP_RANGE_M)
    return float(candidates[np.argmax(np.log(on_fruit + elsewhere).sum(axis=1)), 0])


def _biweight(votes: Array, start_m: float, sigma_m: float) -> tuple[float, float, int]:
    """Tukey's biweight mean about `start_m`: the mean, the spread of the votes within 3 sigma, their number."""
    mean, widest = start_m, sigma_m
    for _ in range(10):
        deviation = votes - mean
        weight = np.clip(1.0 - (deviation / (3 * sigma_m)) ** 2, 0.0, None) ** 2
        if weight.sum() > 0:
            mean += float(weight @ deviation / weight.sum())
        near = np.abs(votes - mean)
        near = near[near < 3 * widest]
        if len(near):
            sigma_m = float(np.clip(1.4826 * np.median(near), MIN_VOTE_SIGMA_M, widest))
    return mean, sigma_m, int((np.abs(votes - mean) < 3 * sigma_m).sum())


def shifted(depths: Array, rays: Array, outline: Outline, vote: Vote) -> tuple[Array, Array]:
    """Give mean and sigma of the centre of a partly hidden fruit over the likelihood of its shifts."""
    axis = outline.hidden_axis
    near = (depths > 0) & (np.abs(depths / vote.depth_m - 1.0) < 1.5 * outline.radius)
    sigma_m = max(MIN_SURFACE_SIGMA_M / 2, SHAPE_SIGMA * outline.radius * vote.depth_m)
    shifts = np.linspace(-outline.slack, outline.slack, SHIFTS)
    log_likelihood = np.empty(SHIFTS)
    for k, shift in enumerate(shifts):
        centre = outline.centre.copy()
        centre[axis] += shift
        log_likelihood[k] = _log_likelihood(depths[near], rays[near], centre, outline.radius, sigma_m)
    log_likelihood *= SURFACE_PATCHES / max(int(near.sum()), 1)
    weight = np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    mean = float(weight @ shifts)
    spread = float(np.sqrt(weight @ (shifts - mean) ** 2))
    centre, centre_sigma = outline.centre.copy(), outline.centre_sigma.copy()
    centre[axis] += mean
    centre_sigma[axis] = np.hypot(centre_sigma[axis], spread)
    return centre, centre_sigma


def _log_likelihood(depths: Array, rays: Array, centre: Array, radius: float, sigma_m: float) -> float:
    """Log likelihood of depths near a fruit under a sphere at `centre`, at its best distance."""
    inside, t = _sphere_depths(rays, centre, radius, RIM)
    off = np.log(P_GAP)
    if inside.sum() < MIN_PIXELS:
        return float(off * len(depths))
    d = depths[inside]
    residual = d - np.median(d / t) * t
    on = np.log(P_GAP + np.exp(-0.5 * (residual / sigma_m) ** 2))
    return float(on.sum() + off * (len(depths) - len(d)))
