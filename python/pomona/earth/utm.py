"""UTM zones: easting and northing to longitude and latitude, by Krüger's series in the third flattening.

Source: C. F. F. Karney, Transverse Mercator with an accuracy of a few nanometers, Journal of Geodesy 85 (2011),
equations 7 to 11 and 36, to the fourth order: 0.1 micrometres within a zone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.earth.ellipsoid import EQUATOR_M, FLATTENING
from pomona.errors import PomonaError

__all__ = ["are_outside_zone", "from_utm"]

_N = FLATTENING / (2.0 - FLATTENING)
_RADIUS_M = EQUATOR_M / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_BETA = (
    _N / 2.0 - 2.0 * _N**2 / 3.0 + 37.0 * _N**3 / 96.0 - _N**4 / 360.0,
    _N**2 / 48.0 + _N**3 / 15.0 - 437.0 * _N**4 / 1440.0,
    17.0 * _N**3 / 480.0 - 37.0 * _N**4 / 840.0,
    4397.0 * _N**4 / 161280.0,
)
_E = np.sqrt(FLATTENING * (2.0 - FLATTENING))
_SCALE, _EASTING_M, _NORTHING_SOUTH_M = 0.9996, 500_000.0, 10_000_000.0

_ZONES = {326: (1, 60), 327: (1, 60), 258: (28, 38)}
"""First three digits of an EPSG code: WGS 84 north and south, ETRS89, whose ellipsoid is the same to 0.1 mm."""

_ROUNDS = 6


def are_outside_zone(epsg: int, easting_m: NDArray[np.float64], northing_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which places, (N,), are far outside of a UTM zone.

    Raises
    ------
    PomonaError
        When the code is none of a UTM zone.
    """
    _require_zone(epsg)
    return np.asarray((np.abs(easting_m - _EASTING_M) > 500_000.0) | (northing_m < -1.0) | (northing_m > 10_000_001.0))


def from_utm(epsg: int, easting_m: NDArray[np.float64], northing_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return longitudes and latitudes in degrees, (N, 2).

    Raises
    ------
    PomonaError
        When the code is none of a UTM zone.
    """
    family, zone = _require_zone(epsg)
    south = _NORTHING_SOUTH_M if family == 327 else 0.0
    eta, xi = (easting_m - _EASTING_M) / (_SCALE * _RADIUS_M), (northing_m - south) / (_SCALE * _RADIUS_M)
    plain_xi, plain_eta = xi.copy(), eta.copy()
    for order, beta in enumerate(_BETA, 1):
        plain_xi -= beta * np.sin(2 * order * xi) * np.cosh(2 * order * eta)
        plain_eta -= beta * np.cos(2 * order * xi) * np.sinh(2 * order * eta)
    conformal = np.sin(plain_xi) / np.hypot(np.sinh(plain_eta), np.cos(plain_xi))
    longitude = np.degrees(np.arctan2(np.sinh(plain_eta), np.cos(plain_xi))) + 6.0 * zone - 183.0
    return np.stack([longitude, np.degrees(np.arctan(_geodetic_tangent(conformal)))], axis=1)


def _require_zone(epsg: int) -> tuple[int, int]:
    """Return the family of a code and the zone in it."""
    family, zone = divmod(epsg, 100)
    first, last = _ZONES.get(family, (1, 0))
    if not first <= zone <= last:
        raise PomonaError(f"--epsg: found {epsg}, expected a UTM zone: 32601 to 32660, 32701 to 32760, 25828 to 25838")
    return family, zone


def _geodetic_tangent(conformal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the tangent of the latitude from that of the conformal latitude, by Newton's method."""
    tangent = conformal / (1.0 - _E**2)
    for _ in range(_ROUNDS):
        root = np.hypot(1.0, tangent)
        sigma = np.sinh(_E * np.arctanh(_E * tangent / root))
        found = tangent * np.hypot(1.0, sigma) - sigma * root
        slope = (1.0 + (1.0 - _E**2) * tangent**2) / ((1.0 - _E**2) * np.hypot(1.0, found) * root)
        tangent = tangent + (conformal - found) * slope
    return np.asarray(tangent)
