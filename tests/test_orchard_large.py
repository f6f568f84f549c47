"""What a large map costs: a session is looked for where it seems to lie, and only its part is read and written."""

import json
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from orchard_maker import frame_of_its_own
from pomona import FruitCloud, geopackage
from pomona.orchard import (
    OrchardMap,
    Session,
    add_session,
    earth_layers,
    joining,
    problems,
    recognising,
    remove_session,
    tree_tables,
)
from pomona.orchard.evidence import Evidence
from pomona.orchard.writing import update_layers
from pomona.store import rows
from pomona.store.failures import WrongContentError
from pomona.store.opening import writing
from pomona.store.stored_fruits import fruit_places
from pomona.synth.clouds import scene_pair

N_ROWS = 4


def visit(number: int, day: str) -> Session:
    """Four of five fruits of a row, 1 cm off, in a frame of their own."""
    row = scene_pair("base", seed=number).map
    rng = np.random.default_rng([number, *map(int, day.split("-"))])
    seen = np.flatnonzero(rng.random(len(row)) < 0.8)
    frame = frame_of_its_own(rng)
    places = row.positions[seen] + rng.normal(0, 0.01, (len(seen), 3))
    cloud = FruitCloud(places, ids=tuple(f"{number} {day} {fruit}" for fruit in seen.tolist()))
    return Session(f"{number} {day}", day, "drawn", cloud.transformed(frame))


@pytest.fixture
def orchard(tmp_path: Path) -> Path:
    path = tmp_path / "orchard.gpkg"
    for number in range(N_ROWS):
        assert add_session(path, visit(number, "2024-06-01"), new_part=True).is_added
    return path


def test_a_session_is_found_among_what_is_near(orchard: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    matched = recognising.Settings.match

    def match(settings: recognising.Settings, query: FruitCloud, known: FruitCloud) -> object:
        asked.append(len(known))
        return matched(settings, query, known)

    monkeypatch.setattr(recognising, "LARGE", 100)
    monkeypatch.setattr(recognising.Settings, "match", match)
    later = visit(2, "2024-07-01")
    added = add_session(orchard, later)
    assert added.n_matched > 0.7 * len(later.cloud)
    # Once with what lies there, never with the four rows; where the visit to that row lies is known then.
    n_fruits = len(OrchardMap(orchard).fruits())
    assert len(asked) == 1
    assert max(asked) < n_fruits / 2
    stranger = visit(9, "2024-07-01")
    assert not add_session(orchard, stranger).is_added
    assert asked[-1] == n_fruits
    assert problems(orchard) == []


def test_what_a_visit_more_makes_no_surer_is_not_written_again(orchard: Path) -> None:
    for day in ("2024-07-01", "2024-08-01", "2024-09-01"):
        assert add_session(orchard, visit(2, day)).is_added
    before = {row[0]: row[1:] for row in sights(orchard)}
    assert all(p is None or (p <= 0.9999 and p == round(p, 4)) for p, _ in before.values())
    assert add_session(orchard, visit(2, "2024-10-01")).is_added
    after = {row[0]: row[1:] for row in sights(orchard)}
    same = sum(after[row] == cells for row, cells in before.items())
    assert same > 0.9 * len(before)


def sights(path: Path) -> list[tuple[object, ...]]:
    with sqlite3.connect(path) as connection:
        return connection.execute("SELECT id, match_probability, match_distance_m FROM observations").fetchall()


def test_places_that_come_in_one_text_are_those_of_the_rows(orchard: Path) -> None:
    with writing(orchard, "map") as (connection, _):
        for which in ("", rows.one_of("last_session_id", [2, 3])):
            listed, geoms = rows.columns_of(connection, "fruits", ("id", "geom"), which)
            ids, places = fruit_places(connection, which)
            assert ids.tolist() == listed
            np.testing.assert_array_equal(places, geopackage.points_of(geoms))
        geom = connection.execute("SELECT geom FROM fruits WHERE id = 7").fetchone()
        connection.execute("UPDATE fruits SET geom = NULL WHERE id = 7")
        with pytest.raises(WrongContentError, match="fruits 7: geom: found None, expected a little-endian POINT Z"):
            fruit_places(connection)
        connection.execute("UPDATE fruits SET geom = ? WHERE id = 7", geom)
    assert problems(orchard) == []


def test_only_the_part_of_the_session_is_read_and_written(orchard: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    joined: list[int] = []
    settled = joining.settlement_of

    def settlement_of(connection: object, evidence: Evidence) -> object:
        joined.append(len(evidence.visits))
        return settled(connection, evidence)  # type: ignore[arg-type]

    monkeypatch.setattr(joining, "settlement_of", settlement_of)
    before = OrchardMap(orchard).observations()
    add_session(orchard, visit(1, "2024-07-01"))
    add_session(orchard, visit(3, "2024-07-01"))
    add_session(orchard, visit(1, "2024-08-01"))
    assert joined == [2, 2, 3]
    after = OrchardMap(orchard).observations()
    now = dict(zip(after.labels, after.fruit_ids.tolist(), strict=True))
    still = [label for label in before.labels if str(label).startswith(("0 ", "2 "))]
    told = dict(zip(before.labels, before.fruit_ids.tolist(), strict=True))
    assert {label: now[label] for label in still} == {label: told[label] for label in still}


def with_trees_on_earth(path: Path) -> None:
    """Make each row one tree, and say where on Earth the map lies."""
    with writing(path, "map") as (connection, _):
        for session_id in range(1, N_ROWS + 1):
            where = geopackage.points([[float(session_id), 0.0, 0.0]])[0]
            connection.execute("INSERT INTO rows (id, name, number) VALUES (?, ?, ?)", (session_id,) * 3)
            connection.execute("INSERT INTO trees (id, geom, row_id) VALUES (?, ?, ?)", (session_id, where, session_id))
        connection.execute("UPDATE fruits SET tree_id = last_session_id, tree_probability = 1.0")
        connection.execute(
            """INSERT INTO georeference (enu_from_map, longitude_deg, latitude_deg, height_m, source, n_points, rms_m)
            VALUES (?, 9.0, 47.0, 400.0, 'points', 3, 0.01)""",
            (json.dumps(np.eye(4).tolist()),),
        )
        update_layers(connection)


def test_trees_and_places_on_earth_follow_the_part_alone(orchard: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_trees_on_earth(orchard)
    n_before = len(OrchardMap(orchard).fruits())
    read: list[int] = []
    told = rows.columns_of

    def columns_of(connection: sqlite3.Connection, table: str, *asked: object) -> list[list[object]]:
        columns = told(connection, table, *asked)  # type: ignore[arg-type]
        read.append(len(columns[0]) if table == "fruits" else 0)
        return columns

    for room in (earth_layers, tree_tables):
        monkeypatch.setattr(room, "columns_of", columns_of)
    monkeypatch.setattr(recognising, "LARGE", 100)
    assert add_session(orchard, visit(2, "2024-07-15")).n_matched > 100
    assert add_session(orchard, visit(1, "2024-07-16")).n_matched > 100
    assert remove_session(orchard, "1 2024-07-16") is not None
    monkeypatch.undo()
    n_fruits = len(OrchardMap(orchard).fruits())
    assert 0 < max(read) < 0.5 * n_fruits
    with writing(orchard, "map") as (connection, _):
        alone = connection.execute("SELECT count(*) FROM fruits WHERE tree_id IS NULL").fetchone()
        wrong = connection.execute(
            "SELECT id FROM trees WHERE n_fruits IS NOT (SELECT count(*) FROM fruits WHERE tree_id = trees.id)"
        ).fetchall()
        before = connection.total_changes
        earth_layers.write_earth_layers(connection)
        assert connection.total_changes == before
    # Fruits that came hang on the trees of those around them.
    assert n_fruits > n_before + 20
    assert alone == (0,)
    # The rows at the ends were never counted.
    assert wrong == [(1,), (4,)]
    assert problems(orchard) == []


def test_one_fruit_s_series_and_one_moment(orchard: Path) -> None:
    add_session(orchard, visit(0, "2024-07-01"))
    with OrchardMap(orchard) as held:
        all_seen = held.observations()
        twice = next(i for i in all_seen.fruit_ids.tolist() if (all_seen.fruit_ids == i).sum() == 2)
        series = held.series(twice)
        assert series.dates == ("2024-06-01", "2024-07-01")
        assert set(series.fruit_ids.tolist()) == {twice}
        mine = all_seen.fruit_ids == twice
        np.testing.assert_array_equal(series.positions_in_map, all_seen.positions_in_map[mine])
        assert len(held.series(10**6)) == 0
        n_visits = len(held.visits())
    add_session(orchard, visit(0, "2024-08-01"))
    assert len(held.visits()) == n_visits + 1
