"""GeoPackage 1.3 containers by the standard library's sqlite3: no GDAL needed to write what GDAL opens.

Coordinates are local metres without a place on Earth (``srs_id`` -1, undefined Cartesian). That also keeps the R*Tree
exact enough: it stores 32-bit floats, which are micrometres here and would be 0.4 m in degrees.

Source: OGC 12-128r17, GeoPackage Encoding Standard 1.3; annexes F.1-F.3 for the R*Tree.
"""

from __future__ import annotations

import math
import sqlite3
import struct
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from urllib.parse import quote

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "APPLICATION_ID",
    "LOCAL_METRES",
    "USER_VERSION",
    "WGS84",
    "add_functions",
    "add_index_triggers",
    "add_table",
    "add_view",
    "are_points",
    "connect",
    "create",
    "joined_points",
    "line",
    "line_of",
    "points",
    "points_of",
    "touch",
]

APPLICATION_ID = 0x47504B47  # "GPKG"
USER_VERSION = 10300

LOCAL_METRES = 'LOCAL_CS["local metres",UNIT["metre",1]]'
"""A frame without a place on Earth, as well-known text."""

UNDEFINED_CARTESIAN = -1
WGS84 = 4326
"""Reference systems by their number in a GeoPackage."""

LITTLE_ENDIAN = 1
WKB_POINT_Z = 1001
WKB_LINE_Z = 1002

POINT_Z = np.dtype(
    [
        ("magic", "S2"),
        ("version", "u1"),
        ("flags", "u1"),
        ("srs_id", "<i4"),
        ("wkb_order", "u1"),
        ("wkb_type", "<u4"),
        ("xyz", "<f8", 3),
    ]
)
"""The whole geometry of one point, section 2.1.3; packed, 37 bytes."""

POINT_HEAD = b"GP\0\x01" + struct.pack("<BI", LITTLE_ENDIAN, WKB_POINT_Z)
"""What every point begins with, but for the number of the reference system."""

LINE_HEAD, LINE_HEAD_BYTES = b"GP\0\x01" + struct.pack("<BI", LITTLE_ENDIAN, WKB_LINE_Z), 17
"""What every line begins with, without the reference system, and how long that is with it and the count."""

CORE_TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (
    srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY, organization TEXT NOT NULL,
    organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (
    table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE, description TEXT DEFAULT '',
    last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
    min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE,
    srs_id INTEGER REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (
    table_name TEXT NOT NULL UNIQUE REFERENCES gpkg_contents(table_name), column_name TEXT NOT NULL,
    geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL REFERENCES gpkg_spatial_ref_sys(srs_id),
    z TINYINT NOT NULL, m TINYINT NOT NULL, PRIMARY KEY (table_name, column_name));
CREATE TABLE gpkg_extensions (
    table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, definition TEXT NOT NULL, scope TEXT NOT NULL,
    UNIQUE (table_name, column_name, extension_name));
INSERT INTO gpkg_spatial_ref_sys VALUES
    ('Undefined Cartesian SRS', -1, 'NONE', -1, 'undefined', 'local metres'),
    ('Undefined geographic SRS', 0, 'NONE', 0, 'undefined', NULL),
    ('WGS 84 geodetic', 4326, 'EPSG', 4326, 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,
AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],
UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]', NULL);
"""

# {t} is a table with the primary key `id` and the geometry `geom`.
RTREE = "CREATE VIRTUAL TABLE rtree_{t}_geom USING rtree(id, minx, maxx, miny, maxy);"

RTREE_TRIGGERS = """
CREATE TRIGGER rtree_{t}_geom_insert AFTER INSERT ON {t}
WHEN NEW.geom NOT NULL AND NOT ST_IsEmpty(NEW.geom) BEGIN
    INSERT OR REPLACE INTO rtree_{t}_geom VALUES
        (NEW.id, ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom)); END;
CREATE TRIGGER rtree_{t}_geom_update1 AFTER UPDATE OF geom ON {t}
WHEN OLD.id = NEW.id AND (NEW.geom NOT NULL AND NOT ST_IsEmpty(NEW.geom)) BEGIN
    INSERT OR REPLACE INTO rtree_{t}_geom VALUES
        (NEW.id, ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom)); END;
CREATE TRIGGER rtree_{t}_geom_update2 AFTER UPDATE OF geom ON {t}
WHEN OLD.id = NEW.id AND (NEW.geom ISNULL OR ST_IsEmpty(NEW.geom)) BEGIN
    DELETE FROM rtree_{t}_geom WHERE id = OLD.id; END;
CREATE TRIGGER rtree_{t}_geom_update3 AFTER UPDATE ON {t}
WHEN OLD.id != NEW.id AND (NEW.geom NOT NULL AND NOT ST_IsEmpty(NEW.geom)) BEGIN
    DELETE FROM rtree_{t}_geom WHERE id = OLD.id;
    INSERT OR REPLACE INTO rtree_{t}_geom VALUES
        (NEW.id, ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom)); END;
CREATE TRIGGER rtree_{t}_geom_update4 AFTER UPDATE ON {t}
WHEN OLD.id != NEW.id AND (NEW.geom ISNULL OR ST_IsEmpty(NEW.geom)) BEGIN
    DELETE FROM rtree_{t}_geom WHERE id IN (OLD.id, NEW.id); END;
CREATE TRIGGER rtree_{t}_geom_delete AFTER DELETE ON {t} WHEN OLD.geom NOT NULL BEGIN
    DELETE FROM rtree_{t}_geom WHERE id = OLD.id; END;
"""


def connect(path: Path, *, create: bool = False, timeout_s: float = 10.0) -> sqlite3.Connection:
    """Open a file for transactions that the caller begins and ends; foreign keys are enforced.

    A reader opens it writable too where it may: only then can SQLite undo what a killed writer left in the journal.
    """
    uri = f"file:{quote(str(path.resolve()))}?mode={'rwc' if create else 'rw'}"
    connection = sqlite3.connect(uri, uri=True, timeout=timeout_s, isolation_level=None)
    # Bytes that are not UTF-8 come as lone surrogates, for whoever reads the cell to refuse.
    connection.text_factory = lambda raw: raw.decode("utf-8", "surrogateescape")
    connection.execute("PRAGMA foreign_keys = ON")
    add_functions(connection)
    return connection


def add_functions(connection: sqlite3.Connection) -> None:
    """Add the functions that the triggers of the spatial index call; a geometry that is no point has no bounds."""
    for name, corner in {"ST_MinX": 0, "ST_MaxX": 1, "ST_MinY": 2, "ST_MaxY": 3}.items():
        connection.create_function(name, 1, lambda blob, corner=corner: _bounds(blob)[corner], deterministic=True)
    connection.create_function("ST_IsEmpty", 1, lambda blob: _bounds(blob)[0] is None, deterministic=True)


def create(connection: sqlite3.Connection) -> None:
    """Make an empty database a GeoPackage, inside the transaction that is open."""
    connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    connection.execute(f"PRAGMA user_version = {USER_VERSION}")
    execute_all(connection, CORE_TABLES)


def add_table(connection: sqlite3.Connection, name: str, columns: str, description: str, geometry: str = "") -> None:
    """Add a layer with the primary key ``id``.

    Parameters
    ----------
    connection : sqlite3.Connection
        A GeoPackage with an open transaction.
    name : str
        Name of the table.
    columns : str
        SQL of the columns after ``id`` and ``geom``.
    description : str
        One line that other programs show.
    geometry : {"", "POINT", "LINESTRING", "POINT WGS84"}
        Type of the three-dimensional geometry ``geom``; nothing for a table without. In local metres, or else in
        degrees.
    """
    kind, srs_id = _kind_and_system(geometry)
    columns = f"geom {kind}, {columns}" if geometry else columns
    # AUTOINCREMENT: a number is never given out a second time, even after its row was deleted.
    connection.execute(f"CREATE TABLE {name} (id INTEGER PRIMARY KEY AUTOINCREMENT, {columns})")
    _register(connection, name, description, kind, srs_id)
    if geometry:
        connection.execute(
            "INSERT INTO gpkg_extensions VALUES (?, 'geom', 'gpkg_rtree_index', ?, 'write-only')",
            (name, "http://www.geopackage.org/spec120/#extension_rtree"),
        )
        connection.execute(RTREE.format(t=name))
        add_index_triggers(connection, name)


def add_view(connection: sqlite3.Connection, name: str, query: str, description: str, geometry: str) -> None:
    """Add a layer that shows what a query gives, with the column ``OGC_FID`` for its rows' numbers and ``geom``."""
    connection.execute(f"CREATE VIEW {name} AS {query}")
    _register(connection, name, description, *_kind_and_system(geometry))


def _kind_and_system(geometry: str) -> tuple[str, int]:
    kind, _, system = geometry.partition(" ")
    return kind, WGS84 if system else UNDEFINED_CARTESIAN


def _register(connection: sqlite3.Connection, name: str, description: str, kind: str, srs_id: int) -> None:
    """Tell other programs of a layer."""
    connection.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, srs_id) VALUES (?, ?, ?, ?, ?)",
        (name, "features" if kind else "attributes", name, description, srs_id if kind else None),
    )
    if kind:
        connection.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)", (name, kind, srs_id))


def add_index_triggers(connection: sqlite3.Connection, name: str) -> None:
    """Let the spatial index of a layer follow it."""
    execute_all(connection, RTREE_TRIGGERS.format(t=name))


def touch(connection: sqlite3.Connection, name: str, last_change: str) -> None:
    """Bring the extent and the time of a layer in the contents up to date; `last_change` is ISO 8601, UTC."""
    has_index = connection.execute("SELECT 1 FROM gpkg_extensions WHERE table_name = ?", (name,)).fetchone()
    extent = _extent(connection, name) if has_index else (None,) * 4
    connection.execute(
        "UPDATE gpkg_contents SET min_x = ?, min_y = ?, max_x = ?, max_y = ?, last_change = ? WHERE table_name = ?",
        (*extent, last_change, name),
    )


def _extent(connection: sqlite3.Connection, name: str) -> tuple[float | None, ...]:
    """Return the least x and y and the largest of a layer: the root of its spatial index bounds all that is in it.

    A node is its depth, the number of its cells, and of each a number and its least and largest x, then y.
    """
    (root,) = connection.execute(f"SELECT data FROM rtree_{name}_geom_node WHERE nodeno = 1").fetchone()
    (count,) = struct.unpack_from(">xxH", root)
    if not count:
        return (None,) * 4
    bounds = np.array([struct.unpack_from(">8x4f", root, 4 + 24 * cell) for cell in range(count)])
    low, high = bounds[:, ::2].min(axis=0).tolist(), bounds[:, 1::2].max(axis=0).tolist()
    return (*low, *high)


def execute_all(connection: sqlite3.Connection, script: str) -> None:
    """Run the statements of a script inside the open transaction (`executescript` would commit it)."""
    statement = ""
    for row in script.splitlines(keepends=True):
        statement += row
        if sqlite3.complete_statement(statement):
            connection.execute(statement)
            statement = ""


def points(positions: ArrayLike, srs_id: int = UNDEFINED_CARTESIAN) -> list[bytes]:
    """Encode (N, 3) coordinates as GeoPackage points, in local metres unless said otherwise."""
    xyz = np.asarray(positions, dtype=np.float64)
    blobs = np.zeros(len(xyz), dtype=POINT_Z)
    blobs["magic"], blobs["flags"], blobs["srs_id"] = b"GP", LITTLE_ENDIAN, srs_id
    blobs["wkb_order"], blobs["wkb_type"], blobs["xyz"] = LITTLE_ENDIAN, WKB_POINT_Z, xyz
    whole = blobs.tobytes()
    return [whole[start : start + POINT_Z.itemsize] for start in range(0, len(whole), POINT_Z.itemsize)]


def line(positions: ArrayLike) -> bytes:
    """Encode (N, 3) coordinates as one GeoPackage line."""
    xyz = np.asarray(positions, dtype="<f8")
    head = b"GP\0\x01" + struct.pack("<iBII", UNDEFINED_CARTESIAN, LITTLE_ENDIAN, WKB_LINE_Z, len(xyz))
    return head + xyz.tobytes()


def line_of(blob: bytes) -> NDArray[np.float64] | None:
    """Decode a line to (N, 3) coordinates, the inverse of `line`; None of anything else."""
    if len(blob) < LINE_HEAD_BYTES or (len(blob) - LINE_HEAD_BYTES) % 24:
        return None
    places = np.frombuffer(blob, "<f8", offset=LINE_HEAD_BYTES).reshape(-1, 3).astype(np.float64)
    return places if line(places) == blob else None


def points_of(blobs: Sequence[bytes]) -> NDArray[np.float64]:
    """Decode points to (N, 3) coordinates; the inverse of `points`. All must be points, see `are_points`."""
    return np.frombuffer(b"".join(blobs), dtype=POINT_Z)["xyz"].astype(np.float64)


def are_points(blobs: Sequence[bytes]) -> bool:
    """Tell whether all geometries are points as `points` encodes them, with finite coordinates."""
    return set(map(len, blobs)) <= {POINT_Z.itemsize} and joined_points(b"".join(blobs)) is not None


def joined_points(whole: bytes) -> NDArray[np.float64] | None:
    """Decode points, one after the other, to (N, 3); None where one is not as `points` encodes it, or not finite."""
    if len(whole) % POINT_Z.itemsize:
        return None
    decoded = np.frombuffer(whole, dtype=POINT_Z)
    ours = (decoded["magic"] == b"GP") & (decoded["flags"] == LITTLE_ENDIAN) & (decoded["wkb_type"] == WKB_POINT_Z)
    ours &= decoded["wkb_order"] == LITTLE_ENDIAN
    places = decoded["xyz"].astype(np.float64)
    return places if ours.all() and np.isfinite(places).all() else None


@lru_cache(maxsize=1)
def _bounds(geometry: object) -> tuple[float, float, float, float] | tuple[None, None, None, None]:
    """Return min x, max x, min y, max y of a point or line as this module writes it; None for anything else.

    A trigger asks five times for each geometry.
    """
    xs, ys = _plan(geometry) if isinstance(geometry, bytes) else ((), ())
    if not xs or not all(map(math.isfinite, (*xs, *ys))):
        return None, None, None, None
    return min(xs), max(xs), min(ys), max(ys)


def _plan(blob: bytes) -> tuple[Sequence[float], Sequence[float]]:
    """Return the x and the y of a point or line, V each; none of anything else."""
    head = blob[:4] + blob[8:13]
    if head == POINT_HEAD and len(blob) == POINT_Z.itemsize:
        x, y = struct.unpack_from("<2d", blob, POINT_Z.itemsize - 24)
        return (x,), (y,)
    if head == LINE_HEAD and len(blob) > LINE_HEAD_BYTES and (len(blob) - LINE_HEAD_BYTES) % 24 == 0:
        x, y, _ = np.frombuffer(blob, "<f8", offset=LINE_HEAD_BYTES).reshape(-1, 3).T.tolist()
        return x, y
    return (), ()
