"""The container itself: geometries, the spatial index, numbers that are not given out twice."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pomona import geopackage
from pomona.store.failures import told


@pytest.fixture
def layer(tmp_path: Path) -> Iterator[sqlite3.Connection]:
    """A GeoPackage with the layer `stones`, three points on a line."""
    connection = geopackage.connect(tmp_path / "stones.gpkg", create=True)
    geopackage.create(connection)
    geopackage.add_table(connection, "stones", "name TEXT", "stones on a line", "POINT")
    blobs = geopackage.points([[1, 10, 0], [2, 20, 0], [3, 30, 5]])
    connection.executemany("INSERT INTO stones (geom) VALUES (?)", ((blob,) for blob in blobs))
    yield connection
    connection.close()


def indexed(layer: sqlite3.Connection) -> list[tuple[int, float, float]]:
    return layer.execute("SELECT id, minx, maxy FROM rtree_stones_geom ORDER BY id").fetchall()


@given(arrays(np.float64, st.tuples(st.integers(0, 5), st.just(3)), elements=st.floats(allow_nan=False)))
def test_points_read_back_the_same(positions: np.ndarray) -> None:
    blobs = geopackage.points(positions)
    assert all(len(blob) == 37 and blob.startswith(b"GP\x00\x01") for blob in blobs)
    np.testing.assert_array_equal(geopackage.points_of(blobs), positions.reshape(-1, 3))


@pytest.mark.parametrize("damaged", [b"", b"GP", b"XX" + bytes(35), *geopackage.points([[np.nan, 0, 0]])])
def test_another_geometry_is_told_apart(layer: sqlite3.Connection, damaged: bytes) -> None:
    good = geopackage.points([[1, 2, 3]])
    assert geopackage.are_points(good)
    assert not geopackage.are_points([*good, damaged])
    # Nor does it come into the index, or stop the statement.
    layer.execute("UPDATE stones SET geom = ? WHERE id = 2", (damaged,))
    assert [fruit_id for fruit_id, *_ in indexed(layer)] == [1, 3]


def test_the_index_follows_every_change(layer: sqlite3.Connection) -> None:
    assert indexed(layer) == [(1, 1, 10), (2, 2, 20), (3, 3, 30)]
    (moved,) = geopackage.points([[7, 70, 0]])
    layer.execute("UPDATE stones SET geom = ? WHERE id = 1", (moved,))
    layer.execute("UPDATE stones SET geom = NULL WHERE id = 2")
    layer.execute("UPDATE stones SET id = 9 WHERE id = 3")
    assert indexed(layer) == [(1, 7, 70), (9, 3, 30)]
    layer.execute("DELETE FROM stones WHERE id = 9")
    layer.execute("UPDATE stones SET id = 11, geom = NULL WHERE id = 1")
    assert indexed(layer) == []


def test_a_number_is_given_out_once(layer: sqlite3.Connection) -> None:
    layer.execute("DELETE FROM stones")
    layer.execute("INSERT INTO stones (name) VALUES ('new')")
    assert layer.execute("SELECT id FROM stones").fetchall() == [(4,)]


def test_contents_know_extent_and_time(layer: sqlite3.Connection) -> None:
    geopackage.touch(layer, "stones", "2024-08-09T00:00:00.000Z")
    row = layer.execute(
        """SELECT min_x, min_y, max_x, max_y, last_change, data_type, srs_id FROM gpkg_contents
        WHERE table_name = 'stones'"""
    ).fetchone()
    assert row == (1, 10, 3, 30, "2024-08-09T00:00:00.000Z", "features", -1)


def test_a_bug_is_not_told_as_wrong_input(layer: sqlite3.Connection) -> None:
    with pytest.raises(sqlite3.OperationalError, match="no such table"), told(Path("a.gpkg")):
        layer.execute("SELECT * FROM pebbles")


def test_the_extent_of_a_layer_is_that_of_its_points(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    with closing(geopackage.connect(tmp_path / "a.gpkg", create=True)) as connection:
        connection.execute("BEGIN")
        geopackage.create(connection)
        geopackage.add_table(connection, "points", "name TEXT", "some points", "POINT")
        for geom in geopackage.points(rng.uniform(-50, 50, (1000, 3))):
            connection.execute("INSERT INTO points (geom) VALUES (?)", (geom,))
        for gone in ("id > 0 AND id % 3 = 0", "id < 900", "id > 0"):
            geopackage.touch(connection, "points", "2026-01-01T00:00:00.000Z")
            told = connection.execute("SELECT min_x, min_y, max_x, max_y FROM gpkg_contents WHERE min_x NOT NULL")
            bounds = connection.execute("SELECT min(minx), min(miny), max(maxx), max(maxy) FROM rtree_points_geom")
            assert told.fetchall() == bounds.fetchall()
            connection.execute(f"DELETE FROM points WHERE {gone}")
        geopackage.touch(connection, "points", "2026-01-01T00:00:00.000Z")
        assert connection.execute("SELECT count(min_x) FROM gpkg_contents").fetchone() == (0,)
