"""Two maps into one: as if all sessions had been added to the first; no input is ever lost."""

import json
import sqlite3
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command_line import Run, assert_refused
from orchard_maker import frame_of_its_own, grow_map, who_is_who
from pomona import FruitCloud, PomonaError, geopackage
from pomona.orchard import OrchardMap, Session, add_session, merge_maps, merging, problems, recognising
from pomona.orchard.writing import update_layers
from pomona.store.opening import snapshot, writing
from pomona.synth.clouds import scene_pair

DATES = ("2024-06-01", "2024-06-29", "2024-07-27", "2024-08-24", "2024-09-07")


@pytest.fixture(scope="module")
def row() -> FruitCloud:
    return scene_pair("base", seed=3).map


def visit(row: FruitCloud, number: int, part: slice = slice(None)) -> Session:
    """Three of four fruits of a stretch, 1.2 cm off, in a frame of their own."""
    rng = np.random.default_rng(number)
    along = np.argsort(row.positions @ np.linalg.svd(row.positions - row.positions.mean(axis=0))[2][0])
    seen = along[part][rng.random(len(along[part])) < 0.75]
    frame = frame_of_its_own(rng)
    cloud = FruitCloud(
        row.positions[seen] + rng.normal(0, 0.012, (len(seen), 3)),
        ids=tuple(f"{number}.{fruit}" for fruit in seen.tolist()),
    )
    return Session(DATES[number], DATES[number], "test", cloud.transformed(frame))


@pytest.fixture(scope="module")
def visits(row: FruitCloud) -> list[Session]:
    """The middle of the row thrice, and either end with what is next to it."""
    n = len(row)
    stretches = [slice(None), slice(0, 2 * n // 3), slice(None), slice(n // 3, n), slice(None)]
    return [visit(row, number, stretch) for number, stretch in enumerate(stretches)]


def states(path: Path) -> list[tuple[str, ...]]:
    extras = OrchardMap(path).fruits().extras
    return sorted(zip(extras["state"], extras["n_sessions"], extras["n_missed"], strict=True))


@pytest.fixture(scope="module")
def together(visits: list[Session], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return grow_map(tmp_path_factory.mktemp("together") / "orchard.gpkg", visits)


@pytest.mark.parametrize("ours", [[0, 1], [0, 2, 4], [3, 4], [0, 1, 2, 3]])
@pytest.mark.parametrize("shared", [[], [2]])
def test_a_merged_map_is_that_of_all_sessions(
    visits: list[Session], together: Path, ours: list[int], shared: list[int], tmp_path: Path
) -> None:
    first = sorted({*ours, *shared})
    second = [number for number in range(5) if number not in ours or number in shared]
    path = grow_map(tmp_path / "ours.gpkg", [visits[number] for number in first])
    other = grow_map(tmp_path / "theirs.gpkg", [visits[number] for number in second])
    kept = other.read_bytes()
    ids = dict(zip(OrchardMap(path).fruits().ids or (), OrchardMap(path).fruits().positions.tolist(), strict=True))
    merged = merge_maps(path, other)
    assert merged.is_merged
    assert {*merged.sessions, *merged.shared} == {visits[number].name for number in second}
    assert set(merged.shared) == {visits[number].name for number in second if number in first}
    assert who_is_who(path) == who_is_who(together)
    assert states(path) == states(together)
    assert problems(path) == []
    assert other.read_bytes() == kept
    assert set(ids) <= set(OrchardMap(path).fruits().ids or ()) | {
        str(change.from_fruit_id) for change in merged.changes
    }


def test_maps_whose_visits_do_not_match_by_themselves_are_joined_by_all_sights(
    row: FruitCloud, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    visits = [visit(row, number) for number in range(4)]
    path, other = grow_map(tmp_path / "ours.gpkg", visits[:2]), grow_map(tmp_path / "theirs.gpkg", visits[2:])
    for module in (merging, recognising):
        monkeypatch.setattr(module, "matches_between", lambda *_, **__: {})
    assert merge_maps(path, other).is_merged
    sights_of = [{label.split(".")[1] for label in sights} for sights in who_is_who(path)]
    identities = Counter(fruit for fruits in sights_of for fruit in fruits)
    assert sum(n > 1 for n in identities.values()) <= 0.03 * len(identities)
    assert sum(len(fruits) > 1 for fruits in sights_of) <= 0.03 * len(identities)


def test_what_the_other_s_fruits_became_is_told_and_kept(visits: list[Session], tmp_path: Path) -> None:
    path = grow_map(tmp_path / "ours.gpkg", visits[:2])
    other = grow_map(tmp_path / "theirs.gpkg", visits[2:])
    before = {str(i) for i in OrchardMap(path).fruits().ids or ()}
    merged = merge_maps(path, other)
    seen, theirs = OrchardMap(path).observations(), OrchardMap(other).observations()
    now = dict(zip(seen.labels, seen.fruit_ids.tolist(), strict=True))
    kept = [(session, one) for cause, session, one in OrchardMap(path).changes() if cause == "merged"]
    assert {session for session, _ in kept} == {"theirs"}
    assert sum(change.n_observations for _, change in kept) == len(theirs)
    told = {(change.from_fruit_id, change.to_fruit_id) for _, change in kept}
    assert {(old, now[label]) for old, label in zip(theirs.fruit_ids.tolist(), theirs.labels, strict=True)} == told
    assert merged.n_known == sum(str(fruit) in before for fruit in merged.fruit_ids.values()) > 100
    assert {change.event for _, change in kept} >= {"joined", "moved"}


def test_maps_that_do_not_overlap_stay_as_they_are(visits: list[Session], tmp_path: Path) -> None:
    path = grow_map(tmp_path / "ours.gpkg", visits[:2])
    stranger = visit(scene_pair("base", seed=9).map, 4)
    other = grow_map(tmp_path / "theirs.gpkg", [stranger])
    before = path.read_bytes(), other.read_bytes()
    output = tmp_path / "merged.gpkg"
    assert not merge_maps(path, other).is_merged
    assert not merge_maps(path, other, output=output).is_merged
    assert (path.read_bytes(), other.read_bytes()) == before
    assert not output.exists()


def test_into_another_file(visits: list[Session], together: Path, tmp_path: Path) -> None:
    path = grow_map(tmp_path / "ours.gpkg", visits[:3])
    other = grow_map(tmp_path / "theirs.gpkg", visits[3:])
    before = path.read_bytes(), other.read_bytes()
    output = tmp_path / "merged.gpkg"
    assert merge_maps(path, other, output=output).is_merged
    assert (path.read_bytes(), other.read_bytes()) == before
    assert who_is_who(output) == who_is_who(together)
    assert problems(output) == []
    with pytest.raises(PomonaError, match="is an orchard map, which no output replaces"):
        merge_maps(path, other, output=output)


def test_all_sessions_in_both_changes_nothing(visits: list[Session], tmp_path: Path) -> None:
    path = grow_map(tmp_path / "ours.gpkg", visits[:3])
    other = grow_map(tmp_path / "theirs.gpkg", [visits[2], visits[0]])
    before = who_is_who(path)
    merged = merge_maps(path, other)
    assert (merged.sessions, set(merged.shared)) == ((), {visits[0].name, visits[2].name})
    assert who_is_who(path) == before
    assert problems(path) == []


def test_another_session_of_a_name_gets_another_name_which_is_told(
    visits: list[Session],
    together: Path,
    tmp_path: Path,
    run_here: Run,
) -> None:
    called = ["row 1", "row 1 (theirs)", "row 1", "july", "row 1 (theirs)"]
    named = [replace(one, name=name) for one, name in zip(visits, called, strict=True)]
    path = grow_map(tmp_path / "ours.gpkg", named[:2])
    # The first visit is in both, under two names; its name there is another one's here.
    first = replace(visits[0], name="row 1 (theirs, 2)")
    other = grow_map(tmp_path / "theirs.gpkg", [first, named[2], named[3], named[4]])
    with writing(on_earth(other, 9.0), "map") as (connection, _):
        connection.execute("DELETE FROM changes")
        one = int((OrchardMap(other).fruits().ids or ())[0])
        connection.execute(
            """INSERT INTO changes (cause, session, event, from_fruit_id, to_fruit_id, n_observations)
            VALUES ('added', 'row 1', 'joined', 9999, ?, 2)""",
            (one,),
        )
        connection.execute("UPDATE control_points SET session = 'row 1'")
    merged = json.loads(run_here("map", "merge", path, other, "--json").stdout)
    now = {"row 1": "row 1 (theirs, 3)", "row 1 (theirs)": "row 1 (theirs) (theirs)"}
    assert merged["renamed"] == now
    assert merged["shared"] == ["row 1 (theirs, 2)"]
    assert merged["sessions"] == ["row 1 (theirs, 3)", "july", "row 1 (theirs) (theirs)"]
    assert sorted(visit.name for visit in OrchardMap(path).visits()) == sorted([*called[:2], *merged["sessions"]])
    assert who_is_who(path) == who_is_who(together)
    assert problems(path) == []
    assert ("row 1 (theirs, 3)", 2) in [
        (session, change.n_observations) for _, session, change in OrchardMap(path).changes()
    ]
    assert asked(path, "SELECT session FROM control_points") == [("row 1 (theirs, 3)",)]
    # Merged again, all of it is there.
    merged = json.loads(run_here("map", "merge", path, other, "--json").stdout)
    assert (merged["sessions"], merged["renamed"], len(merged["shared"])) == ([], {}, 4)


def test_names_that_changed_are_said_a_line_each(visits: list[Session], tmp_path: Path, run_here: Run) -> None:
    path = grow_map(tmp_path / "ours.gpkg", visits[:1])
    other = grow_map(tmp_path / "theirs.gpkg", [replace(visits[2], name=DATES[0])])
    done = run_here("map", "merge", path, other)
    line = f"{DATES[0]}: another session is called so, here it is {DATES[0]} (theirs)"
    assert line in done.stdout.splitlines()


def test_parts_that_know_nothing_of_each_other(row: FruitCloud, visits: list[Session], tmp_path: Path) -> None:
    strangers = [visit(scene_pair("base", seed=9).map, number) for number in (1, 3)]
    path = grow_map(tmp_path / "orchard.gpkg", [visits[0]])
    assert not add_session(path, strangers[0]).is_added
    added = add_session(path, strangers[0], new_part=True)
    assert (added.is_added, added.n_matched, added.n_new) == (True, 0, len(strangers[0].cloud))
    alone = states(path)
    assert add_session(path, strangers[1]).n_matched > 50
    assert add_session(path, visits[4]).n_matched > 50
    # A part says nothing of the fruits of another: those of the row are as they would be alone.
    only = grow_map(tmp_path / "row.gpkg", [visits[0], visits[4]])
    assert who_is_who(only) < who_is_who(path)
    row_labels = {label for fruit in who_is_who(only) for label in fruit}
    assert row_labels.isdisjoint({label for fruit in who_is_who(path) - who_is_who(only) for label in fruit})
    assert len(states(path)) == len(states(only)) + len({*who_is_who(path)} - {*who_is_who(only)})
    assert problems(path) == []
    assert alone != states(path)


def test_what_cannot_be_merged_is_said_in_a_line(
    visits: list[Session],
    tmp_path: Path,
    run_here: Run,
) -> None:
    other = grow_map(tmp_path / "theirs.gpkg", [visits[2]])
    again = {"june.svo2": "0" * 64}
    path = grow_map(tmp_path / "made.gpkg", [replace(visits[0], input_hashes=again), visits[1]])
    rescanned = grow_map(tmp_path / "rescanned.gpkg", [replace(visits[3], input_hashes=again)])
    said = [
        (path, f"{path}: is the map itself, expected another one to merge with {path}"),
        (tmp_path / "none.gpkg", f"{tmp_path / 'none.gpkg'}: is not there, expected a session or a map (.gpkg)"),
        (rescanned, f"{path}: session {DATES[3]} is in the map already, as {DATES[0]}: the same input files"),
    ]
    for with_whom, line in said:
        assert_refused(run_here("map", "merge", path, with_whom), f"pomona: {line}\n")
    damaged = tmp_path / "damaged.gpkg"
    content = bytearray(path.read_bytes())
    content[11 * 4096 : 12 * 4096] = bytes(4096)  # of a table: the file still opens
    damaged.write_bytes(content)
    assert_refused(run_here("map", "merge", damaged, other, "-o", tmp_path / "whole.gpkg"), f"pomona: {damaged}: ")
    assert_refused(run_here("map", "merge", path, other, "-o", other), "is the input")
    done = run_here("map", "merge", path, other)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{other}: sessions that came: 1, in both: 0; ")
    assert run_here("map", "check", path).returncode == 0
    with sqlite3.connect(path) as connection:
        assert connection.execute("SELECT count(*) FROM sessions").fetchone() == (3,)


def with_trees(path: Path, n_trees: int = 2) -> Path:
    """Part the fruits by where they hang into trees of one row that is called as people call it."""
    with writing(path, "map") as (connection, _):
        ids, geoms = zip(*connection.execute("SELECT id, geom FROM fruits ORDER BY id"), strict=True)
        places = geopackage.points_of(geoms)
        along = places @ np.linalg.svd(places - places.mean(axis=0))[2][0]
        of_fruit = np.searchsorted(np.quantile(along, np.linspace(0, 1, n_trees + 1)[1:-1]), along)
        connection.execute("INSERT INTO rows (id, name, number, source) VALUES (1, 'row 1', 1, 'found')")
        for tree in range(n_trees):
            foot = geopackage.points(places[of_fruit == tree].mean(axis=0)[None])[0]
            cells = (tree + 1, foot, f"1-{tree + 1}", tree + 1)
            connection.execute(
                "INSERT INTO trees (id, geom, name, row_id, number, source) VALUES (?, ?, ?, 1, ?, 'found')", cells
            )
        connection.executemany(
            "UPDATE fruits SET tree_id = ?, tree_probability = 1.0 WHERE id = ?",
            zip((of_fruit + 1).tolist(), ids, strict=True),
        )
        update_layers(connection)
    return path


def on_earth(path: Path, longitude_deg: float) -> Path:
    with writing(path, "map") as (connection, _):
        place = (json.dumps(np.eye(4).tolist()), longitude_deg)
        connection.execute(
            """INSERT INTO georeference (enu_from_map, longitude_deg, latitude_deg, height_m, source, n_points, rms_m)
            VALUES (?, ?, 47.0, 400.0, 'points', 2, 0.01)""",
            place,
        )
        cells = (geopackage.points([[1.0, 2.0, 3.0]])[0], longitude_deg)
        connection.execute(
            """INSERT INTO control_points (geom, name, longitude_deg, latitude_deg, east_off_m, north_off_m)
            VALUES (?, 'post', ?, 47.0, 0.0, 0.0)""",
            cells,
        )
        update_layers(connection)
    return path


def asked(path: Path, question: str) -> list[tuple[object, ...]]:
    with snapshot(path) as (connection, _):
        return connection.execute(question).fetchall()


def fruit_places(path: Path, table: str) -> dict[str, np.ndarray]:
    """Where each sight's fruit lies, by the sight's name."""
    rows = asked(
        path,
        f"""SELECT label, f.geom FROM observations JOIN sessions s ON s.id = session_id
        JOIN {table} f ON f.id = fruit_id AND s.id = (SELECT last_session_id FROM fruits WHERE id = fruit_id)""",
    )
    return dict(zip((label for label, _ in rows), geopackage.points_of([geom for _, geom in rows]), strict=True))


def test_trees_and_the_place_on_earth_come_along(visits: list[Session], tmp_path: Path) -> None:
    path = grow_map(tmp_path / "ours.gpkg", visits[:2])
    other = on_earth(with_trees(grow_map(tmp_path / "theirs.gpkg", visits[2:])), 9.0)
    merged = merge_maps(path, other)
    assert merged.left_out == ()
    assert problems(path) == []
    assert asked(path, "SELECT name, number FROM trees ORDER BY id") == [("1-1", 1), ("1-2", 2)]
    (without,) = asked(path, "SELECT count(*) FROM fruits WHERE tree_id IS NULL")[0]
    assert without < 0.1 * len(OrchardMap(path).fruits())
    assert asked(path, "SELECT sum(n_fruits) FROM trees") == asked(path, "SELECT count(tree_id) FROM fruits")
    # Who hung together hangs together.
    hung, hangs = (
        dict(asked(one, "SELECT label, tree_id FROM observations JOIN fruits ON fruits.id = fruit_id"))
        for one in (other, path)
    )
    same = [hung[label] == hangs[label] for label in hung]
    assert np.mean(same) > 0.97
    there, here = (fruit_places(one, "fruits_wgs84") for one in (other, path))
    common = sorted(there.keys() & here.keys())
    assert len(common) > 100
    off_deg = np.array([here[label] - there[label] for label in common])[:, :2]
    assert np.abs(off_deg).max() < 0.05 / 75_000.0


def test_what_the_map_has_its_own_of_is_left_out_and_told(visits: list[Session], tmp_path: Path) -> None:
    path = on_earth(with_trees(grow_map(tmp_path / "ours.gpkg", visits[:3])), 9.0)
    other = on_earth(with_trees(grow_map(tmp_path / "theirs.gpkg", visits[3:])), 9.1)
    before = asked(path, "SELECT id, geom, name FROM trees"), asked(path, "SELECT * FROM georeference")
    merged = merge_maps(path, other)
    assert merged.is_merged
    row, place = merged.left_out
    assert row == "row 1 with 2 trees: the map has trees there"
    assert place.startswith("its place on Earth, ")
    assert (asked(path, "SELECT id, geom, name FROM trees"), asked(path, "SELECT * FROM georeference")) == before


def test_history_comes_along_by_ids_that_nobody_else_gets(visits: list[Session], tmp_path: Path) -> None:
    path = grow_map(tmp_path / "ours.gpkg", visits[:2])
    other = grow_map(tmp_path / "theirs.gpkg", visits[2:])
    known = int((OrchardMap(other).fruits().ids or ())[0])
    with writing(other, "map") as (connection, _):
        connection.execute("DELETE FROM changes")
        connection.execute(
            """INSERT INTO changes (cause, session, event, from_fruit_id, to_fruit_id, n_observations)
            VALUES ('added', ?, 'joined', 9999, ?, 2), ('added', ?, 'joined', 9998, ?, 1)""",
            (visits[2].name, known, "of long ago", known),
        )
    ours_before = [int(name) for name in OrchardMap(path).fruits().ids or ()]
    merged = merge_maps(path, other)
    told = [(session, one) for _, session, one in OrchardMap(path).changes() if one.from_fruit_id > max(ours_before)]
    told = [(session, one) for session, one in told if session in (visits[2].name, "of long ago")]
    assert [session for session, _ in told] == [visits[2].name, "of long ago"]
    assert {one.to_fruit_id for _, one in told} == {merged.fruit_ids[known]}
    lost = {one.from_fruit_id for _, one in told}
    assert len(lost) == 2
    assert lost.isdisjoint({*ours_before, *merged.fruit_ids.values()})
    added = add_session(path, replace(visit(scene_pair("base", seed=9).map, 4), name="x"), new_part=True)
    assert min(added.fruit_ids) > max(lost)
    assert problems(path) == []
