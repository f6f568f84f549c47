"""Maps and sessions of strangers: damaged bytes, edited cells, edited schemas."""

from __future__ import annotations

import contextlib
import functools
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pomona import FruitCloud, PomonaError, Views
from pomona.orchard import (
    OrchardMap,
    Session,
    add_session,
    load_session,
    problems,
    remove_session,
    write_session,
)
from pomona.synth.clouds import scene_pair
from pomona.trajectory import Trajectory

__all__ = ["cell_edits", "schema_edits", "seeds", "target"]


def seeds() -> list[bytes]:
    """Return a session with everything that one can have, and a map with two."""
    pair = scene_pair("base", seed=3)
    clouds = [_full(cloud.select(np.arange(60))) for cloud in (pair.map, pair.query)]
    poses = np.tile(np.eye(4), (2, 1, 1))
    trajectory = Trajectory(np.array([4, 9]), np.array([0.0, 0.2]), poses)
    with tempfile.TemporaryDirectory() as folder:
        session, orchard = Path(folder) / "session.gpkg", Path(folder) / "orchard.gpkg"
        write_session(session, clouds[0], name="a", date="2024-08-01", recording="r", trajectory=trajectory)
        add_session(orchard, load_session(session))
        moved = clouds[0].transformed(np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]]))
        # Another visit, so off a little: the same to the millimetre is refused.
        scattered = moved.positions + np.random.default_rng(3).normal(0, 0.005, moved.positions.shape)
        moved = replace(moved, positions=scattered).select(np.arange(50))
        add_session(orchard, Session("b", "2024-09-01", "r", moved, trajectory))
        return [session.read_bytes(), orchard.read_bytes()]


def target(data: bytes) -> None:
    """Do everything with a file that Pomona does with one; only a `PomonaError` of one line may come of it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fuzzed.gpkg"
        path.write_bytes(data)
        for read in _readers():
            with _refusals():
                read(path)
            # A journal mode of the file may make SQLite put it in order, but never change what is in it.
            if path.read_bytes() != data:
                raise AssertionError(f"{read.__name__} changed the file")
        other = Path(folder) / "other.gpkg"
        with _refusals():
            add_session(other, load_session(path))
        with _refusals():
            add_session(path, _third_visit())
        with _refusals():
            remove_session(path, "a")


def _readers() -> tuple[Callable[[Path], object], ...]:
    def fruits(path: Path) -> object:
        return OrchardMap(path).fruits()

    def visits(path: Path) -> object:
        return OrchardMap(path).visits()

    def observations(path: Path) -> object:
        return OrchardMap(path).observations()

    return FruitCloud.read, load_session, fruits, visits, observations, problems


@contextlib.contextmanager
def _refusals() -> Iterator[None]:
    try:
        yield
    except PomonaError as error:
        if "\n" in str(error):
            raise AssertionError(f"more than one line: {error!r}") from error


def _full(cloud: FruitCloud) -> FruitCloud:
    n = len(cloud)
    return FruitCloud(
        positions=cloud.positions,
        ids=tuple(f"apple {row}" for row in range(n)),
        diameters_m=np.full(n, 0.07),
        covariances=np.tile(1e-4 * np.eye(3), (n, 1, 1)),
        n_views=np.full(n, 3),
        views=Views(frames=np.array([4, 4, 9]), fruits=np.array([0, 2, 2])),
        extras={"note": tuple(str(row) for row in range(n))},
    )


@functools.cache
def _third_visit() -> Session:
    cloud = scene_pair("base", seed=3).map.select(np.arange(60))
    return Session("c", "2024-10-01", "r", cloud)


TABLES = ("pomona_format", "sessions", "fruits", "observations", "sightings", "poses")

VALUES = (
    *("NULL", "'text'", "''", "x'00ff'", "zeroblob(37)", "x'00' || geom", "CAST(x'fffe41' AS TEXT)"),
    *("0", "1", "2", "-1", "9223372036854775807", "-9223372036854775808", "0.5", "3.0", "1e300", "1e-300"),
    *("9e999", "-9e999", "'NaN'", "'[]'", "'{}'", "'{\"a\": 1}'", "'\"\\ud800\"'", "'[[1]]'"),
    *("'[[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]'", "'[[1e999,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]'"),
    *("printf('%.*c', 20000, '[')", "printf('%.*c', 5000, '9')", "char(27) || char(10)", "'missed'"),
    *("'2024-01-01'", "'2024-13-45'", "'2024-08-09T14:30:00+02:00'"),
)
"""What another program, or a hand, may put into a cell."""

SCHEMAS = (
    "CREATE TRIGGER wipe AFTER INSERT ON sessions BEGIN DELETE FROM observations; END",
    "CREATE TRIGGER wide AFTER INSERT ON observations BEGIN UPDATE observations SET diameter_m = 1; END",
    "CREATE TRIGGER quoted AFTER INSERT ON 'fruits' BEGIN DELETE FROM sightings; END",
    "CREATE TABLE bait (a); CREATE TRIGGER late AFTER INSERT ON bait BEGIN DELETE FROM [fruits]; END",
    "ALTER TABLE sightings RENAME TO old; CREATE VIEW sightings AS WITH RECURSIVE n(i) AS "
    "(SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id, 1 AS observation_id, i AS frame FROM n",
    "CREATE TABLE notes (id INTEGER PRIMARY KEY, fruit_id REFERENCES fruits(id) ON DELETE CASCADE)",
    "CREATE UNIQUE INDEX one ON fruits (state)",
    "CREATE INDEX partial ON fruits (state) WHERE n_missed > 3",
    "DROP INDEX observations_by_fruit",
    "DROP TRIGGER rtree_fruits_geom_insert",
    "DROP TABLE poses",
    "DROP TABLE gpkg_contents",
    "ALTER TABLE fruits RENAME COLUMN diameter_m TO size_m",
    "ALTER TABLE fruits ADD COLUMN more TEXT DEFAULT (hex(zeroblob(1000000)))",
    "ALTER TABLE fruits ADD COLUMN twice GENERATED ALWAYS AS (n_missed * 2)",
    "ALTER TABLE observations DROP COLUMN label",
    "CREATE VIRTUAL TABLE words USING fts5(a)",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = 'CREATE TABLE fruits (id)' WHERE name = 'fruits'",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET rootpage = 2 WHERE name = 'fruits'",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = NULL WHERE name = 'fruits'",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET type = x'00' WHERE name = 'trees'",
    "PRAGMA writable_schema = ON; INSERT INTO sqlite_master VALUES "
    "('trigger', 'calm', 'bait', 0, 'CREATE TRIGGER wipe AFTER INSERT ON sessions BEGIN DELETE FROM fruits; END')",
    "PRAGMA writable_schema = ON; INSERT INTO sqlite_master SELECT * FROM sqlite_master WHERE name = 'fruits'",
    "UPDATE sqlite_sequence SET seq = -5",
    "UPDATE sqlite_sequence SET seq = 'x'",
    "UPDATE sqlite_sequence SET seq = 9223372036854775807",
    "DELETE FROM sqlite_sequence",
    "DELETE FROM gpkg_contents",
    "DELETE FROM gpkg_geometry_columns",
    "DELETE FROM sessions",
    "DELETE FROM sessions WHERE id = 1",
    "DELETE FROM observations",
    "DELETE FROM fruits",
    "DELETE FROM pomona_format",
    "INSERT INTO pomona_format VALUES (2, 1, 'map', '')",
    "DELETE FROM rtree_fruits_geom_node",
    "UPDATE rtree_fruits_geom_node SET data = x'00'",
    "UPDATE rtree_observations_geom_node SET data = zeroblob(4)",
    "INSERT INTO sightings SELECT NULL, 999, 1 FROM fruits",
    "PRAGMA user_version = 99",
    "PRAGMA journal_mode = WAL",
)
"""What a map that came by mail may do, or have lost."""


def cell_edits(data: bytes, every: int = 1) -> Iterator[tuple[str, bytes]]:
    """Give a file with one cell edited, for every column, odd value, and first and last row; or one of so many."""
    statements = [
        f"UPDATE {table} SET {name} = {value} WHERE id = (SELECT {row}(id) FROM {table})"
        for table in TABLES
        for name in _columns(data, table)
        for value in VALUES
        for row in ("min", "max")
    ]
    for statement in statements[::every]:
        if (changed := edited(data, statement)) is not None:
            yield statement, changed


def schema_edits(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Give a file with its schema, or a whole table, edited."""
    for script in SCHEMAS:
        if (changed := edited(data, script)) is not None:
            yield script, changed


def edited(data: bytes, script: str) -> bytes | None:
    """Return the file after a script of SQL that minds no constraint; None where SQLite itself refuses it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "edited.gpkg"
        path.write_bytes(data)
        connection = sqlite3.connect(path, isolation_level=None)
        for name in ("ST_MinX", "ST_MaxX", "ST_MinY", "ST_MaxY", "ST_IsEmpty"):
            connection.create_function(name, 1, lambda _: 0)
        try:
            connection.execute("PRAGMA ignore_check_constraints = ON")
            connection.executescript(script)
        except sqlite3.Error:
            return None
        finally:
            connection.close()
        return path.read_bytes()


def _columns(data: bytes, table: str) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "asked.gpkg"
        path.write_bytes(data)
        connection = sqlite3.connect(path)
        names = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
        connection.close()
        return names
