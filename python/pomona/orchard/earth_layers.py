"""The layers of a map that lie on Earth, kept up with the others where the map has a georeference."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterable

import numpy as np

from pomona import geopackage
from pomona.earth import Anchor
from pomona.store.cells import finite_json
from pomona.store.failures import WrongContentError
from pomona.store.rows import columns_of, one_of

__all__ = ["stored_anchor", "write_earth_layers"]

LAYERS = {
    "fruits": ("state", "last_seen", "n_sessions", "diameter_m", "growth_mm_per_day", "tree_id"),
    "trees": ("name", "row_id", "number", "kind", "n_fruits"),
}
"""What the layers `fruits_wgs84` and `trees_wgs84` have besides the place."""


def stored_anchor(connection: sqlite3.Connection) -> Anchor | None:
    """Return where on Earth a map lies, None where nobody has said."""
    names = ("enu_from_map", "longitude_deg", "latitude_deg", "height_m")
    rows = list(zip(*columns_of(connection, "georeference", names), strict=True))
    if len(rows) > 1:
        raise WrongContentError(f"georeference: found {len(rows)} rows, expected one or none")
    if not rows:
        return None
    transform, longitude_deg, latitude_deg, height_m = rows[0]
    return Anchor(np.array(finite_json(transform), np.float64), longitude_deg, latitude_deg, height_m)


def write_earth_layers(connection: sqlite3.Connection, fruit_ids: Collection[int] | None = None) -> None:
    """Write what is another than before, of all fruits or of some; without a georeference there is nothing to do."""
    anchor = stored_anchor(connection)
    if anchor is None:
        return
    for layer, names in LAYERS.items():
        some = None if layer != "fruits" else fruit_ids
        which, which_on_earth = (
            "" if some is None else one_of(f"{t}.id", sorted(some)) for t in (layer, f"{layer}_wgs84")
        )
        ids, geoms, *columns = columns_of(connection, layer, ("id", "geom", *names), which)
        there = [row for row, geom in enumerate(geoms) if geom is not None]
        places = anchor.geodetic(geopackage.points_of([geoms[row] for row in there])) if there else np.empty((0, 3))
        blobs = geopackage.points(places, geopackage.WGS84)
        rows = {ids[row]: (blob, *(column[row] for column in columns)) for row, blob in zip(there, blobs, strict=True)}
        _bring_up(connection, f"{layer}_wgs84", ("geom", *names), rows, which_on_earth)


def _bring_up(
    connection: sqlite3.Connection, table: str, names: tuple[str, ...], rows: dict[int, tuple[object, ...]], which: str
) -> None:
    cells = connection.execute(f"SELECT id, {', '.join(names)} FROM {table} {which}")
    before = {row_id: tuple(others) for row_id, *others in cells}
    connection.executemany(f"DELETE FROM {table} WHERE id = ?", _ids(before.keys() - rows.keys()))
    marks = ", ".join("?" * (len(names) + 1))
    connection.executemany(
        f"INSERT OR REPLACE INTO {table} (id, {', '.join(names)}) VALUES ({marks})",
        ((row_id, *cells) for row_id, cells in rows.items() if before.get(row_id) != cells),
    )


def _ids(ids: Iterable[int]) -> list[tuple[int]]:
    return [(row_id,) for row_id in sorted(ids)]
