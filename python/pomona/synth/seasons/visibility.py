"""How much of each fruit the frames of a drive see past leaves, wood and other fruits.

A coarse depth picture is made of each frame: points on leaves, wood and fruits, the nearest of each pixel kept. A
fruit shows as much as points on the half that faces the camera lie in front of their pixels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.training_systems import GOLDEN_ANGLE_RAD

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.row_geometry import FruitSolids, Leaves, Limbs, RowGeometry
    from pomona.synth.seasons.drive import Drive

__all__ = ["NOT_IN_VIEW", "shown_shares"]

NOT_IN_VIEW = np.nan
"""Share of a fruit that a frame does not look at."""

_PIXEL = 0.010
"""Of a picture at the distance 1: 1.7 cm at the row, an apple is four across."""

_SPACING_M = 0.011
"""Between points on what hides: finer than a pixel from 1.1 m on, nearer than which hardly anything stands."""

_HALF_VIEW = 0.5
"""Tangent of half the picture's width, 53 degrees; upwards and downwards it sees all of the row."""

_COLUMNS, _ROWS = round(2.0 * _HALF_VIEW / _PIXEL), 800
_OUTSIDE = _COLUMNS * _ROWS

_POINTS_PER_FRUIT = 19
_IN_FRONT_M = 0.012
"""What lies no deeper than this in front of a fruit's skin is the fruit itself, or its stalk."""

_NEAREST_M = 0.3


def shown_shares(geometry: RowGeometry, drive: Drive) -> NDArray[np.float64]:
    """Share of each labelled fruit that each frame sees, (K, F) 0 to 1; `NOT_IN_VIEW` outside of the picture."""
    fruits = geometry.fruits
    labelled = np.flatnonzero(fruits.ids > 0)
    hiding = np.concatenate([_leaf_points(geometry.leaves), _limb_points(geometry.limbs)])
    facing = 1.0 if drive.side == "near" else -1.0
    # From far to near: of the points in one pixel the last one written is the nearest, in every frame.
    hiding = hiding[np.argsort(-facing * hiding[:, 1])].T.copy()
    skins = _skin_points(fruits, labelled, facing)
    shares = np.empty((len(drive.cameras_m), len(labelled)))
    for frame, camera in enumerate(drive.cameras_m):
        shown, in_view = _shown(camera, facing, hiding, skins.reshape(-1, 3).T)
        whole = in_view.reshape(skins.shape[:2]).all(axis=1)
        shares[frame] = np.where(whole, shown.reshape(skins.shape[:2]).mean(axis=1), NOT_IN_VIEW)
    return shares


def _shown(
    camera: NDArray[np.float64], facing: float, hiding: NDArray[np.float64], skin: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether points of skin, (3, P), show behind what hides, (3, H) from far to near; whether they are in view."""
    pixels, depths = _seen_from(camera, facing, skin)
    in_view = pixels != _OUTSIDE
    if not in_view.any():
        return in_view, in_view
    reach = _HALF_VIEW * float(depths.max())
    others, other_depths = _seen_from(camera, facing, hiding[:, np.abs(hiding[0] - camera[0]) < reach])
    nearest = np.full(_COLUMNS * _ROWS + 1, np.inf)
    nearest[others] = other_depths
    nearest[_OUTSIDE] = np.inf
    np.minimum.at(nearest, pixels[in_view], depths[in_view])
    return in_view & (depths <= nearest[pixels] + _IN_FRONT_M), in_view


def _seen_from(
    camera: NDArray[np.float64], facing: float, points: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Pixel and depth of points, (3, N); all pixels outside of the picture are one more."""
    depths = facing * (points[1] - camera[1])
    safe = np.maximum(depths, _NEAREST_M) * _PIXEL
    column = ((points[0] - camera[0]) / safe + _COLUMNS / 2.0).astype(np.int64)
    row = ((points[2] - camera[2]) / safe + _ROWS / 2.0).astype(np.int64)
    inside = (depths > _NEAREST_M) & (column > 0) & (column < _COLUMNS) & (row > 0) & (row < _ROWS)
    return np.where(inside, row * _COLUMNS + column, _OUTSIDE), depths


def _skin_points(fruits: FruitSolids, chosen: NDArray[np.int64], facing: float) -> NDArray[np.float64]:
    """Points on the half that faces the camera, spread evenly over its disc in a sunflower's pattern, (F, P, 3)."""
    number = np.arange(_POINTS_PER_FRUIT)
    out = 0.92 * np.sqrt((number + 0.5) / _POINTS_PER_FRUIT)
    turn = number * GOLDEN_ANGLE_RAD
    disc = np.stack([out * np.cos(turn), -facing * np.sqrt(1.0 - out**2), out * np.sin(turn)], axis=1)
    radii = fruits.diameters_m[chosen] / 2.0
    return np.asarray(fruits.centres_m[chosen][:, None, :] + radii[:, None, None] * disc)


def _leaf_points(leaves: Leaves) -> NDArray[np.float64]:
    """Points over the flat blades, ovals, as dense as `_SPACING_M` asks of the largest."""
    if len(leaves) == 0:
        return np.empty((0, 3))
    along = np.arange(_SPACING_M / 2.0, leaves.lengths_m.max(), _SPACING_M)
    across = np.arange(-leaves.widths_m.max() / 2.0, leaves.widths_m.max() / 2.0, _SPACING_M) + _SPACING_M / 4.0
    sides = np.cross(leaves.normals, leaves.tips)
    points = []
    for reach in along:
        share = np.minimum(reach / leaves.lengths_m, 1.0)
        half = leaves.widths_m * np.sqrt(np.maximum(share * (1.0 - share), 0.0))
        sunk = leaves.bends_rad * share * reach / 2.0
        middle = leaves.bases_m + leaves.tips * reach - leaves.normals * sunk[:, None]
        for offset in across:
            on = np.flatnonzero((np.abs(offset) <= half) & (reach < leaves.lengths_m))
            points.append(middle[on] + sides[on] * offset)
    return np.concatenate(points)


def _limb_points(limbs: Limbs) -> NDArray[np.float64]:
    """Points along the rods; thick ones have two more lines along their sides."""
    lengths = np.linalg.norm(limbs.ends_m - limbs.starts_m, axis=1)
    count = np.maximum(1, np.ceil(lengths / _SPACING_M)).astype(np.int64)
    rod = np.repeat(np.arange(len(limbs)), count)
    number = np.arange(len(rod)) - np.repeat(np.cumsum(count) - count, count)
    share = ((number + 0.5) / count[rod])[:, None]
    middle = (1.0 - share) * limbs.starts_m[rod] + share * limbs.ends_m[rod]
    radii = (1.0 - share) * limbs.start_radii_m[rod, None] + share * limbs.end_radii_m[rod, None]
    thick = radii[:, 0] > _SPACING_M / 2.0
    sideways = radii[thick] * np.array([0.8, 0.0, 0.0])
    return np.concatenate([middle, middle[thick] + sideways, middle[thick] - sideways])
