"""Files of format 1, written by the program of then, are read as they are and brought up to date when written."""

import gzip
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from pomona import FruitCloud, geopackage
from pomona.orchard import (
    Observations,
    OrchardMap,
    Session,
    add_session,
    load_session,
    problems,
    read_session,
    remove_session,
)

MAPS = Path(__file__).parents[1] / "testdata" / "maps"
VISITS = [("2024-06-01", 50, 0), ("2024-07-01", 54, 54), ("2024-08-01", 58, 48)]


def unpacked(kind: str, folder: Path) -> Path:
    path = folder / f"{kind}.gpkg"
    path.write_bytes(gzip.decompress((MAPS / f"version_1_{kind}.gpkg.gz").read_bytes()))
    return path


@pytest.fixture
def orchard(tmp_path: Path) -> Path:
    """Three visits to 60 fruits, the one of July added last."""
    return unpacked("map", tmp_path)


def asked(path: Path, question: str) -> list[tuple[object, ...]]:
    connection = sqlite3.connect(path)
    answer = connection.execute(question).fetchall()
    connection.close()
    return answer


def identities(seen: Observations) -> dict[tuple[str, str | None], int]:
    return dict(zip(zip(seen.sessions, seen.labels, strict=True), seen.fruit_ids.tolist(), strict=True))


def next_visit(orchard: Path) -> Session:
    fruits = OrchardMap(orchard).fruits()
    return Session("2024-09-01", "2024-09-01", "test", FruitCloud(fruits.positions[5:], diameters_m=np.full(55, 0.08)))


def test_a_reader_leaves_the_file_as_it_is(orchard: Path) -> None:
    before = orchard.read_bytes()
    read = OrchardMap(orchard)
    assert [(visit.name, visit.n_fruits, visit.n_matched) for visit in read.visits()] == VISITS
    assert len(read.fruits()) == 60
    assert set(read.fruits().extras["state"]) == {"seen"}
    assert sorted(set(read.fruits().extras["n_missed"])) == ["0", "1"]
    assert len(read.observations()) == 162
    assert read.changes() == []
    assert problems(orchard) == []
    assert orchard.read_bytes() == before


def test_a_session_is_read_too(tmp_path: Path) -> None:
    path = unpacked("session", tmp_path)
    before = path.read_bytes()
    session = read_session(path)
    assert (len(session.cloud), session.name) == (50, "2024-06-01")
    assert session.trajectory is not None
    assert add_session(tmp_path / "new.gpkg", load_session(path)).is_added
    assert path.read_bytes() == before


def test_a_writer_brings_it_up_to_date(orchard: Path) -> None:
    before = OrchardMap(orchard).observations()
    added = add_session(orchard, next_visit(orchard))
    assert added.is_added
    assert asked(orchard, "SELECT format_version FROM pomona_format") == [(2,)]
    assert asked(orchard, "SELECT count(*) FROM matches") == [(6,)]
    after = OrchardMap(orchard).observations()
    # No evidence has come against an identity of then.
    assert identities(before).items() <= identities(after).items()
    assert problems(orchard) == []


def test_what_people_added_stays(orchard: Path) -> None:
    connection = geopackage.connect(orchard)
    geopackage.execute_all(
        connection,
        """ALTER TABLE fruits ADD COLUMN "my note" TEXT;
        CREATE INDEX by_size ON fruits (diameter_m);
        CREATE TABLE mine (a TEXT);
        INSERT INTO mine VALUES ('b');
        """,
    )
    connection.execute("""UPDATE fruits SET "my note" = 'red' WHERE id = 7""")
    connection.execute("UPDATE sqlite_sequence SET seq = 90 WHERE name = 'fruits'")
    connection.close()
    visit = next_visit(orchard)
    stray = FruitCloud(np.vstack([visit.cloud.positions, [[40.0, 0.0, 0.0]]]))
    added = add_session(orchard, Session("later", "2024-09-02", "test", stray))
    # The ids up to 90 were given out once, whoever has them now.
    assert added.fruit_ids.max() == 91
    assert asked(orchard, """SELECT "my note" FROM fruits WHERE id = 7""") == [("red",)]
    assert asked(orchard, "SELECT name FROM sqlite_master WHERE name = 'by_size'") == [("by_size",)]
    assert asked(orchard, "SELECT a FROM mine") == [("b",)]
    assert problems(orchard) == []


def test_the_spatial_index_follows_the_new_table(orchard: Path) -> None:
    removed = remove_session(orchard, "2024-08-01")
    assert removed is not None
    assert removed.n_gone > 0
    assert asked(orchard, "SELECT count(*) FROM rtree_fruits_geom") == asked(orchard, "SELECT count(*) FROM fruits")
    assert problems(orchard) == []


def test_a_refused_session_leaves_the_old_format_or_the_new_one_whole(orchard: Path) -> None:
    elsewhere = FruitCloud(np.random.default_rng(1).uniform(0, 5, (60, 3)))
    assert not add_session(orchard, Session("elsewhere", "2024-09-01", "test", elsewhere)).is_added
    assert problems(orchard) == []
    assert [(visit.name, visit.n_fruits, visit.n_matched) for visit in OrchardMap(orchard).visits()] == VISITS
