"""Local metres anchored to the Earth: a rigid transform between known points of both, with what it leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.earth.ellipsoid import east_north_up, ecef_from_geodetic, geodetic_from_ecef
from pomona.errors import PomonaError

__all__ = ["Anchor", "anchored"]

LEAST_APART_M = 2.0
"""Known points that are nearer tell no heading: 5 cm of noise turn the map by 1.4 degrees."""

LEAST_SPREAD_M = 2.0
"""Where points reach so far in their second direction, and have heights, they tell the vertical themselves."""


@dataclass(frozen=True, eq=False)
class Anchor:
    """Where a map lies.

    Attributes
    ----------
    enu_from_map : (4, 4) float64
        To metres east, north and up of the origin.
    longitude_deg, latitude_deg : float
        Of the origin, WGS 84.
    height_m : float or None
        Of the origin above the ellipsoid; None where no heights are known, and heights count from the origin.
    """

    enu_from_map: NDArray[np.float64]
    longitude_deg: float
    latitude_deg: float
    height_m: float | None

    def geodetic(self, positions_in_map: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return longitudes and latitudes in degrees and heights in metres, (N, 3)."""
        enu = positions_in_map @ self.enu_from_map[:3, :3].T + self.enu_from_map[:3, 3]
        axes = east_north_up(self.longitude_deg, self.latitude_deg)
        origin = np.array([[self.longitude_deg, self.latitude_deg, self.height_m or 0.0]])
        return geodetic_from_ecef(ecef_from_geodetic(origin) + enu @ axes)

    def east_north_up(self, geodetic: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return metres east, north and up of the origin, (N, 3), of longitudes, latitudes and heights."""
        axes = east_north_up(self.longitude_deg, self.latitude_deg)
        origin = np.array([[self.longitude_deg, self.latitude_deg, self.height_m or 0.0]])
        return np.asarray((ecef_from_geodetic(geodetic) - ecef_from_geodetic(origin)) @ axes.T)

    def off_m(self, positions_in_map: NDArray[np.float64], geodetic: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far known points lie from where they should, (N, 3) east, north, up; up is NaN without heights."""
        placed = positions_in_map @ self.enu_from_map[:3, :3].T + self.enu_from_map[:3, 3]
        off = placed - self.east_north_up(np.nan_to_num(geodetic))
        off[np.isnan(geodetic[:, 2]), 2] = np.nan
        return np.asarray(off)


def anchored(
    positions_in_map: NDArray[np.float64],
    geodetic: NDArray[np.float64],
    up_in_map: NDArray[np.float64] | None,
    *,
    free_scale: bool = False,
) -> Anchor:
    """Fit a map to known points.

    Points that reach in two directions, with heights, give the whole rotation; else the heading comes from the points
    and the vertical is `up_in_map`.

    Parameters
    ----------
    positions_in_map : (N, 3) float64
        Two or more.
    geodetic : (N, 3) float64
        The same points: longitude, latitude in degrees, height in metres; NaN where the height is not known.
    up_in_map : (3,) float64 or None
        Where it is not known the points must tell the whole rotation.
    free_scale : bool
        Whether the map's metres may be longer or shorter than the Earth's.

    Raises
    ------
    PomonaError
        When there are fewer than two points, all lie together, or nothing tells the vertical.
    """
    if len(positions_in_map) < 2:
        raise PomonaError(f"found {len(positions_in_map)} known points, expected two or more")
    has_heights = bool(np.isfinite(geodetic[:, 2]).all())
    origin = geodetic.mean(axis=0)
    start = Anchor(np.eye(4), float(origin[0]), float(origin[1]), float(origin[2]) if has_heights else None)
    enu = start.east_north_up(np.nan_to_num(geodetic) if not has_heights else geodetic)
    if has_heights and _spread(positions_in_map) >= LEAST_SPREAD_M and _spread(enu) >= LEAST_SPREAD_M:
        rotation, scale = _rotation(positions_in_map, enu, free_scale)
        linear = scale * rotation
    else:
        linear = _upright(positions_in_map, enu, up_in_map, free_scale)
    enu_from_map = np.eye(4)
    enu_from_map[:3, :3] = linear
    enu_from_map[:3, 3] = (enu - positions_in_map @ linear.T).mean(axis=0)
    if not has_heights:
        # Heights count from the height of the points in the map.
        enu_from_map[2, 3] = -(positions_in_map @ linear[2]).mean()
    return Anchor(enu_from_map, start.longitude_deg, start.latitude_deg, start.height_m)


def _upright(
    positions_in_map: NDArray[np.float64],
    enu: NDArray[np.float64],
    up_in_map: NDArray[np.float64] | None,
    free_scale: bool,
) -> NDArray[np.float64]:
    """Return what turns, and scales, the map by the heading of the points, its vertical upright, (3, 3)."""
    if up_in_map is None:
        raise PomonaError(
            "found no cameras in the map, which would tell the vertical, expected --up X,Y,Z, or known points with "
            "heights that reach 2 m in two directions"
        )
    level = _level(up_in_map)
    before = positions_in_map @ level.T
    apart = float(np.linalg.svd(_centred(before[:, :2]))[1][0])
    if apart < LEAST_APART_M / np.sqrt(2.0):
        raise PomonaError(
            f"known points reach {apart * np.sqrt(2.0):.2g} m in plan, expected {LEAST_APART_M:g} m or more: nearer "
            "ones tell no heading"
        )
    flat, scale = _rotation(before[:, :2], enu[:, :2], free_scale)
    rotation = np.eye(3)
    rotation[:2, :2] = flat
    return np.asarray(scale * rotation @ level)


def _centred(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(points - points.mean(axis=0))


def _spread(points: NDArray[np.float64]) -> float:
    """Return how far points reach beside a line, the root of the sum of squares."""
    return float(np.linalg.svd(_centred(points))[1][1]) if len(points) > 2 else 0.0


def _rotation(
    source: NDArray[np.float64], target: NDArray[np.float64], free_scale: bool
) -> tuple[NDArray[np.float64], float]:
    """Return the rotation, and the scale, that bring points closest (Umeyama 1991)."""
    one, other = _centred(source), _centred(target)
    left, extents, right = np.linalg.svd(other.T @ one)
    mirror = np.ones(len(extents))
    mirror[-1] = np.sign(np.linalg.det(left) * np.linalg.det(right))
    scale = float((extents * mirror).sum() / (one**2).sum()) if free_scale else 1.0
    return np.asarray(left * mirror @ right), scale


def _level(up_in_map: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a rotation, (3, 3), that brings up to z."""
    up = up_in_map / np.linalg.norm(up_in_map)
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first), up])
