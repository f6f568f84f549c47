"""Files of formats 1 and 2, written by the programs of then, are read as they are, brought up to date when written."""

import gzip
import sqlite3
from pathlib import Path

import numpy as np
import pyogrio
import pytest

from pomona import FruitCloud, PomonaError, geopackage
from pomona.orchard import (
    FORMAT_VERSION,
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


def unpacked(kind: str, folder: Path, version: int = 1) -> Path:
    path = folder / f"{kind}.gpkg"
    path.write_bytes(gzip.decompress((MAPS / f"version_{version}_{kind}.gpkg.gz").read_bytes()))
    return path


@pytest.fixture
def orchard(tmp_path: Path) -> Path:
    """Three visits to 60 fruits, the one of July added last."""
    return unpacked("map", tmp_path)


@pytest.fixture
def orchard_2(tmp_path: Path) -> Path:
    """Three visits to 40 fruits on three trees, the one of July added last."""
    return unpacked("map", tmp_path, 2)


def asked(path: Path, question: str) -> list[tuple[object, ...]]:
    connection = sqlite3.connect(path)
    answer = connection.execute(question).fetchall()
    connection.close()
    return answer


def identities(seen: Observations) -> dict[tuple[str, str | None], int]:
    return dict(zip(zip(seen.sessions, seen.labels, strict=True), seen.fruit_ids.tolist(), strict=True))


def next_visit(orchard: Path) -> Session:
    places = OrchardMap(orchard).fruits().positions[5:]
    scattered = places + np.random.default_rng(1).normal(0.0, 0.005, places.shape)
    return Session("2024-09-01", "2024-09-01", "test", FruitCloud(scattered, diameters_m=np.full(55, 0.08)))


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
    assert asked(orchard, "SELECT format_version FROM pomona_format") == [(FORMAT_VERSION,)]
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
    scattered = visit.cloud.positions + np.random.default_rng(1).normal(0, 0.005, (len(visit.cloud), 3))
    stray = FruitCloud(np.vstack([scattered, [[40.0, 0.0, 0.0]]]))
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


# Format 2: identities and states as they are, but no crops, no georeference, and trees that only people drew.


def rewritten(path: Path) -> None:
    """Bring a map up to date: whatever is written does it first."""
    assert remove_session(path, "2024-08-01", dry=True) is not None


def test_format_2_is_read_as_it_is(orchard_2: Path, tmp_path: Path) -> None:
    before = orchard_2.read_bytes()
    assert [(visit.name, visit.n_fruits) for visit in OrchardMap(orchard_2).visits()] == [
        ("2024-06-01", 34),
        ("2024-07-01", 36),
        ("2024-08-01", 32),
    ]
    assert problems(orchard_2) == []
    assert orchard_2.read_bytes() == before
    session = read_session(unpacked("session", tmp_path, 2))
    assert (len(session.cloud), session.trajectory is not None) == (34, True)


def test_format_2_comes_up_to_date_with_all_it_has(orchard_2: Path) -> None:
    wanted = "SELECT id, hex(geom), state, last_seen, n_missed, diameter_m, state_probability FROM fruits ORDER BY id"
    before = (
        asked(orchard_2, wanted),
        asked(orchard_2, "SELECT * FROM matches"),
        asked(orchard_2, "SELECT * FROM poses"),
    )
    rewritten(orchard_2)
    after = asked(orchard_2, wanted), asked(orchard_2, "SELECT * FROM matches"), asked(orchard_2, "SELECT * FROM poses")
    assert after == before
    assert asked(orchard_2, "SELECT format_version FROM pomona_format") == [(FORMAT_VERSION,)]
    assert asked(orchard_2, "SELECT count(*) FROM rtree_fruits_geom") == asked(orchard_2, "SELECT count(*) FROM fruits")
    for table in ("crops", "georeference", "control_points", "fruits_wgs84", "trees_wgs84"):
        assert asked(orchard_2, f"SELECT count(*) FROM {table}") == [(0,)]
    assert problems(orchard_2) == []


@pytest.mark.parametrize("version", [1, 2])
def test_an_older_file_becomes_word_for_word_a_new_one(tmp_path: Path, version: int) -> None:
    new, old = tmp_path / "new.gpkg", unpacked("map", tmp_path, version)
    add_session(new, load_session(unpacked("session", tmp_path, version)))
    rewritten(old)
    tables = "SELECT type, name, tbl_name FROM sqlite_master WHERE name NOT LIKE 'sqlite_%' ORDER BY type, name"
    assert asked(old, tables) == asked(new, tables)
    layers = "SELECT table_name, data_type, description, srs_id FROM gpkg_contents ORDER BY table_name"
    assert asked(old, layers) == asked(new, layers)
    assert dict(pyogrio.list_layers(old).tolist()) == dict(pyogrio.list_layers(new).tolist())


def test_drawn_trees_keep_what_people_wrote(orchard_2: Path) -> None:
    connection = geopackage.connect(orchard_2)
    geopackage.execute_all(
        connection,
        """ALTER TABLE trees ADD COLUMN planted INTEGER;
        ALTER TABLE trees ADD COLUMN number INTEGER;
        INSERT INTO rows (id, name) VALUES (4, 'north');
        INSERT INTO trees (id, name, row_id, planted, number) VALUES (9, 'T9', 4, 2015, 3);
        UPDATE fruits SET tree_id = 9 WHERE id = 5;
        """,
    )
    connection.close()
    rewritten(orchard_2)
    assert asked(orchard_2, "SELECT id, name, row_id, planted, number, source FROM trees") == [
        (9, "T9", 4, 2015, 3, None)
    ]
    assert asked(orchard_2, "SELECT id FROM fruits WHERE tree_id = 9") == [(5,)]
    assert problems(orchard_2) == []


@pytest.mark.parametrize(
    "own",
    [
        "CREATE TABLE Crops (a TEXT)",
        "CREATE VIEW fruit_series AS SELECT 1",
        "CREATE INDEX fruits_by_tree ON trees (name)",
    ],
)
def test_a_name_that_is_taken_is_told(orchard_2: Path, own: str) -> None:
    with sqlite3.connect(orchard_2) as connection:
        connection.execute(own)
    connection.close()
    before = orchard_2.read_bytes()
    with pytest.raises(PomonaError, match=r"that is not Pomona's, and format 3 needs the name: rename it$"):
        OrchardMap(orchard_2).fruits()
    with pytest.raises(PomonaError, match=r"rename it$"):
        rewritten(orchard_2)
    assert orchard_2.read_bytes() == before


def test_styles_that_people_made_stay(orchard_2: Path) -> None:
    with sqlite3.connect(orchard_2) as connection:
        connection.execute("CREATE TABLE layer_styles (id INTEGER PRIMARY KEY, styleQML TEXT)")
        connection.execute("INSERT INTO layer_styles VALUES (1, 'mine')")
    connection.close()
    rewritten(orchard_2)
    assert asked(orchard_2, "SELECT * FROM layer_styles") == [(1, "mine")]
    assert problems(orchard_2) == []
