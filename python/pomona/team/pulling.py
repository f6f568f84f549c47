"""A map out of the team's store, as a file that was never away from it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pomona.atomic import new_file
from pomona.errors import PomonaError
from pomona.orchard.writing import update_layers
from pomona.store import schema
from pomona.store.opening import blank
from pomona.store.schema import LAYERS
from pomona.team.database_url import Database, connected
from pomona.team.geometry_bytes import geopackage_blob
from pomona.team.team_schema import Column, columns_of_layer, require_store

__all__ = ["pull_map"]

LOCAL_FRAME = -1
"""Reference system of a place in a map's own metres, as GeoPackage has it; PostGIS has 0."""


def pull_map(database: Database, name: str, output: str | Path) -> int:
    """Write a map of the team's store as a file; return how many fruits it has.

    Parameters
    ----------
    database : Database
        The store.
    name : str
        Of the map there.
    output : str or Path
        The file (.gpkg), where none is yet: no output replaces a map.

    Raises
    ------
    PomonaError
        The file is there already, the store has no such map, or the server refuses or goes away: no file is left.
    """
    output = Path(output)
    if output.suffix.lower() != ".gpkg":
        raise PomonaError(f"{output}: found suffix {output.suffix!r}, expected .gpkg for a map")
    if output.exists():
        raise PomonaError(f"{output}: is there already, expected a new file: no output replaces a map")
    with connected(database) as source:
        # One snapshot for all layers.
        source.run("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")
        require_store(source, database.shown)
        pushes = source.run(
            "SELECT last_ids FROM pomona.pushes WHERE map = :map ORDER BY push_id DESC LIMIT 1", map=name
        )
        if not pushes:
            there = [row[0] for row in source.run("SELECT map FROM pomona_now.maps ORDER BY map LIMIT 10")]
            raise PomonaError(f"{database.shown}: has no map {name}, it has {', '.join(there) or 'none'}")
        rows = {layer: _rows(source, layer, name) for layer, *_ in LAYERS}
        source.run("COMMIT")
    try:
        with new_file(output) as partial, blank(partial, output) as target:
            _write(target, rows, json.loads(pushes[0][0]))
    except FileExistsError:
        raise PomonaError(f"{output}: is there already, expected a new file: no output replaces a map") from None
    return len(rows["fruits"])


def _rows(source: Any, layer: str, name: str) -> list[tuple[Any, ...]]:
    columns = columns_of_layer(layer)
    wanted = ", ".join("ST_AsBinary(geom, 'NDR')" if one.srs_id is not None else one.name for one in columns)
    found = source.run(f"SELECT {wanted} FROM pomona_now.{layer} WHERE map = :map ORDER BY id", map=name)
    return [tuple(_cell(column, cell) for column, cell in zip(columns, row, strict=True)) for row in found]


def _cell(column: Column, cell: Any) -> Any:
    if column.srs_id is not None and cell is not None:
        return geopackage_blob(bytes(cell), column.srs_id or LOCAL_FRAME)
    return bytes(cell) if isinstance(cell, bytes | bytearray | memoryview) else cell


def _write(target: Any, rows: dict[str, list[tuple[Any, ...]]], ids: dict[str, int]) -> None:
    schema.create(target, "map")
    target.execute("PRAGMA defer_foreign_keys = ON")
    for layer, found in rows.items():
        marks = ", ".join("?" * len(columns_of_layer(layer)))
        target.executemany(f"INSERT INTO {layer} VALUES ({marks})", found)  # a name of ours
    for layer, last in ids.items():
        # An id that was given out stays given out, also when its row is gone.
        target.execute("DELETE FROM sqlite_sequence WHERE name = ?", (layer,))
        target.execute("INSERT INTO sqlite_sequence (name, seq) VALUES (?, ?)", (layer, last))
    update_layers(target)
