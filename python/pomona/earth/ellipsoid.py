"""The ellipsoid WGS 84: longitude, latitude and height to Cartesian coordinates and back.

Source: NGA.STND.0036 (WGS 84); B. R. Bowring, Transformation from spatial to geographical coordinates, Survey Review 23
(1976), iterated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["EQUATOR_M", "FLATTENING", "east_north_up", "ecef_from_geodetic", "geodetic_from_ecef"]

EQUATOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563

_E2 = FLATTENING * (2.0 - FLATTENING)
_POLE_M = EQUATOR_M * (1.0 - FLATTENING)

_ROUNDS = 3
"""The second is exact to nanometres up to some kilometres of height."""


def ecef_from_geodetic(geodetic: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Cartesian coordinates, (N, 3) metres, of (N, 3) longitudes and latitudes in degrees and heights."""
    longitude, latitude = np.radians(geodetic[:, 0]), np.radians(geodetic[:, 1])
    across = EQUATOR_M / np.sqrt(1.0 - _E2 * np.sin(latitude) ** 2)
    from_axis = (across + geodetic[:, 2]) * np.cos(latitude)
    return np.stack(
        [
            from_axis * np.cos(longitude),
            from_axis * np.sin(longitude),
            (across * (1.0 - _E2) + geodetic[:, 2]) * np.sin(latitude),
        ],
        axis=1,
    )


def geodetic_from_ecef(ecef: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return longitudes and latitudes in degrees and heights in metres, (N, 3): the inverse of the above."""
    x, y, z = ecef.T
    from_axis = np.hypot(x, y)
    reduced = np.arctan2(z * EQUATOR_M, from_axis * _POLE_M)
    for _ in range(_ROUNDS):
        latitude = np.arctan2(
            z + _E2 / (1.0 - _E2) * _POLE_M * np.sin(reduced) ** 3,
            from_axis - _E2 * EQUATOR_M * np.cos(reduced) ** 3,
        )
        reduced = np.arctan2((1.0 - FLATTENING) * np.sin(latitude), np.cos(latitude))
    across = EQUATOR_M / np.sqrt(1.0 - _E2 * np.sin(latitude) ** 2)
    # Of the two forms each is exact where the other divides by nothing.
    height = from_axis * np.cos(latitude) + z * np.sin(latitude) - EQUATOR_M**2 / across
    return np.stack([np.degrees(np.arctan2(y, x)), np.degrees(latitude), height], axis=1)


def east_north_up(longitude_deg: float, latitude_deg: float) -> NDArray[np.float64]:
    """Return the axes east, north and up at a place as rows, (3, 3)."""
    longitude, latitude = np.radians(longitude_deg), np.radians(latitude_deg)
    east = [-np.sin(longitude), np.cos(longitude), 0.0]
    up = [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    return np.array([east, np.cross(up, east), up])
