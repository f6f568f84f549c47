"""Where on Earth local metres lie: WGS 84, its tangent planes and its UTM zones, by formulas alone."""

from pomona.earth.anchor import Anchor, anchored
from pomona.earth.ellipsoid import east_north_up, ecef_from_geodetic, geodetic_from_ecef
from pomona.earth.utm import are_outside_zone, from_utm

__all__ = [
    "Anchor",
    "anchored",
    "are_outside_zone",
    "east_north_up",
    "ecef_from_geodetic",
    "from_utm",
    "geodetic_from_ecef",
]
