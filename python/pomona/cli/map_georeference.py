"""`pomona map georeference`: where on Earth a map lies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.cli.map_words import orchard_argument
from pomona.cli.terminal import say, say_json

if TYPE_CHECKING:
    from typing import Any

    import numpy as np
    from numpy.typing import NDArray

    from pomona.orchard.georeferencing import Georeferenced

_MOST_POINTS = 20
"""A line each; fixes of a whole way are more than anybody reads."""


def map_georeference(
    orchard: Path = orchard_argument,
    points: Path = typer.Option(
        ...,
        "--points",
        metavar="FILE",
        help="Known points: a table (.csv) with x,y,z in the map, or frame or time of a session, and lon,lat or "
        "easting,northing; name and height where known.",
    ),
    epsg: int | None = typer.Option(None, metavar="CODE", help="UTM zone of easting,northing, as 32632."),
    session: str | None = typer.Option(None, metavar="NAME", help="Session whose frames or times FILE tells."),
    up: str | None = typer.Option(None, metavar="X,Y,Z", help="The vertical in the map; else that of the cameras."),
    within_m: float = typer.Option(1.0, "--within", metavar="METRES", help="A point that is farther off is refused."),
    free_scale: bool = typer.Option(False, "--free-scale", help="The map's metres may be longer or shorter."),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Say where on Earth ORCHARD lies, by two or more known points or by fixes along the way of its camera.

    Fruits stay in local metres; layers and exports for GIS get longitude and latitude (WGS 84). Two points tell the
    heading; the vertical is then that of the cameras. A point that contradicts the others is refused.
    """
    from pomona.orchard.control_points import read_control_points
    from pomona.orchard.georeferencing import georeference

    found = georeference(
        orchard,
        read_control_points(points, epsg),
        session=session,
        up_in_map=None if up is None else _vector(up),
        within_m=within_m,
        free_scale=free_scale,
    )
    if json:
        say_json(_anchor_as_json(found))
    else:
        say(*_anchor_as_lines(found))


def _vector(text: str) -> NDArray[np.float64]:
    import numpy as np

    from pomona.errors import PomonaError

    try:
        vector = np.array([float(cell) for cell in text.split(",")])
    except ValueError:
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise PomonaError(f"--up: found {text!r}, expected three numbers as 0,-1,0")
    return vector


def _anchor_as_json(found: Georeferenced) -> dict[str, Any]:
    anchor = found.anchor
    return {
        "enu_from_map": anchor.enu_from_map.tolist(),
        "longitude_deg": anchor.longitude_deg,
        "latitude_deg": anchor.latitude_deg,
        "height_m": anchor.height_m,
        "scale": found.scale,
        "rms_m": found.rms_m,
        "points": [
            {"name": name, "off_m": [None if metres != metres else metres for metres in off]}
            for name, off in zip(found.names, found.off_m.tolist(), strict=True)
        ],
    }


def _anchor_as_lines(found: Georeferenced) -> list[str]:
    anchor = found.anchor
    height = "no heights" if anchor.height_m is None else f"height {anchor.height_m:.2f} m"
    lines = [
        f"origin {anchor.latitude_deg:.8f} N, {anchor.longitude_deg:.8f} E, {height}; {len(found.names)} known points, "
        f"{100 * found.rms_m:.1f} cm off (root mean square), scale {found.scale:.5f}"
    ]
    for name, off in list(zip(found.names, found.off_m.tolist(), strict=True))[:_MOST_POINTS]:
        east, north, up = ("     ?" if metres != metres else f"{100 * metres:+6.1f}" for metres in off)
        lines.append(f"  {name}: {east} cm east, {north} cm north, {up} cm up")
    more = len(found.names) - _MOST_POINTS
    return [*lines, f"  and {more} more"] if more > 0 else lines
