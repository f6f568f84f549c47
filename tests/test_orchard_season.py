"""A map over a season: the same whatever came first, whoever went and came again."""

from pathlib import Path

import numpy as np
import pytest

from command_line import Run, assert_refused
from orchard_maker import frame_of_its_own, grow_map, who_is_who
from pomona import FruitCloud, PomonaError, geopackage
from pomona.orchard import (
    Change,
    OrchardMap,
    Session,
    add_session,
    add_sessions,
    problems,
    remove_session,
    write_session,
)
from pomona.synth.clouds import scene_pair

DATES = ("2024-06-01", "2024-06-29", "2024-07-27", "2024-08-24")


@pytest.fixture(scope="module")
def row() -> FruitCloud:
    return scene_pair("base", seed=3).map


def visit(row: FruitCloud, number: int, shows: np.ndarray | None = None) -> Session:
    """Three of four fruits, larger each time, 1.2 cm off, among false points, in a frame of their own."""
    rng = np.random.default_rng(number)
    seen = np.flatnonzero(rng.random(len(row)) < 0.75 if shows is None else shows)
    sizes = (0.03 + 0.01 * number) * np.exp(np.random.default_rng(99).normal(0, 0.1, len(row))[seen])
    places = row.positions[seen] + rng.normal(0, 0.012, (len(seen), 3))
    strays = rng.uniform(row.positions.min(axis=0), row.positions.max(axis=0), (8, 3))
    frame = frame_of_its_own(rng)
    cloud = FruitCloud(
        np.vstack([places, strays]),
        ids=tuple(f"{number}.{fruit}" for fruit in [*seen.tolist(), *range(1000, 1008)]),
        diameters_m=np.concatenate([sizes, np.full(8, 0.05)]),
    )
    return Session(DATES[number], DATES[number], "test", cloud.transformed(frame))


@pytest.fixture(scope="module")
def visits(row: FruitCloud) -> list[Session]:
    return [visit(row, number) for number in range(4)]


def judged(path: Path) -> dict[str, tuple[str, ...]]:
    """State, hits, misses and probabilities of each fruit, by the name of its last sight."""
    orchard = OrchardMap(path)
    seen, fruits = orchard.observations(), orchard.fruits()
    last = {str(fruit): str(label) for fruit, label in zip(seen.fruit_ids.tolist(), seen.labels, strict=True)}
    facts = zip(*fruits.extras.values(), strict=True)
    return {last[name]: fact for name, fact in zip(fruits.ids or (), facts, strict=True)}


@pytest.fixture(scope="module")
def season(visits: list[Session], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map to which the visits came in the order of their dates; nobody writes to it."""
    return grow_map(tmp_path_factory.mktemp("season") / "orchard.gpkg", visits)


def test_a_fruit_has_one_identity_through_the_season(season: Path) -> None:
    tracks = [{name.split(".")[1] for name in sights} for sights in who_is_who(season)]
    whole = sum(len(track) == 1 for track in tracks)
    assert whole > 0.97 * len(tracks)
    n_sights = sum(len(sights) > 1 for sights in who_is_who(season))
    assert n_sights > 0.9 * 385 * 0.9
    assert problems(season) == []


@pytest.mark.parametrize("order", [(3, 2, 1, 0), (2, 0, 3, 1)])
def test_the_order_of_adding_changes_nothing(
    season: Path, visits: list[Session], order: tuple[int, ...], tmp_path: Path
) -> None:
    other = grow_map(tmp_path / "orchard.gpkg", [visits[number] for number in order])
    assert who_is_who(other) == who_is_who(season)
    assert judged(other) == judged(season)
    assert problems(other) == []
    # The frame is that of the first to come; within it all lies the same.
    ours, theirs = ({one.name: one.map_from_session for one in OrchardMap(path).visits()} for path in (season, other))
    theirs_from_ours = theirs[DATES[0]] @ np.linalg.inv(ours[DATES[0]])
    for name in DATES:
        np.testing.assert_allclose(theirs[name], theirs_from_ours @ ours[name], atol=1e-9)


@pytest.mark.parametrize("number", [0, 1, 3])
def test_one_that_goes_and_comes_again_leaves_all_as_it_was(
    season: Path, visits: list[Session], number: int, tmp_path: Path
) -> None:
    path = tmp_path / "orchard.gpkg"
    path.write_bytes(season.read_bytes())
    assert remove_session(path, DATES[number]) is not None
    assert problems(path) == []
    without = grow_map(tmp_path / "without.gpkg", [one for one in visits if one.name != DATES[number]])
    assert who_is_who(path) == who_is_who(without)
    assert judged(path) == judged(without)
    assert add_session(path, visits[number]).is_added
    assert who_is_who(path) == who_is_who(season)
    assert judged(path) == judged(season)
    assert problems(path) == []


def test_what_later_evidence_changes_is_told_and_kept(row: FruitCloud, tmp_path: Path) -> None:
    """Two fruits that touch, each seen once: taken for one, until a visit sees both."""
    path = tmp_path / "orchard.gpkg"
    rng = np.random.default_rng(1)
    # One more fruit beside the last, 3 cm off.
    beside = FruitCloud(np.vstack([row.positions, row.positions[-1] + [0.03, 0.0, 0.0]]))
    shows = [np.arange(len(beside)) != len(beside) - 1, np.arange(len(beside)) != len(beside) - 2, np.ones(len(beside))]
    sights = [
        FruitCloud(
            beside.positions[mask.astype(bool)] + rng.normal(0, 0.01, (int(mask.sum()), 3)),
            ids=tuple(map(str, np.flatnonzero(mask))),
        )
        for mask in shows
    ]
    answers = [add_session(path, Session(day, day, "test", cloud)) for day, cloud in zip(DATES, sights, strict=False)]
    taken_for_one = answers[0].fruit_ids[-1]
    assert answers[1].fruit_ids[-1] == taken_for_one
    seen = OrchardMap(path).observations()
    of_last = {
        (name, label): int(fruit)
        for fruit, name, label in zip(seen.fruit_ids, seen.sessions, seen.labels, strict=True)
        if label in (str(len(beside) - 1), str(len(beside) - 2))
    }
    assert of_last[DATES[0], str(len(beside) - 2)] == of_last[DATES[2], str(len(beside) - 2)] == taken_for_one
    split = of_last[DATES[1], str(len(beside) - 1)]
    assert split == of_last[DATES[2], str(len(beside) - 1)] > answers[1].fruit_ids.max()
    assert answers[2].changes == (Change("split", int(taken_for_one), split, 1),)
    assert OrchardMap(path).changes() == [("added", DATES[2], answers[2].changes[0])]
    remove_session(path, DATES[2])
    assert OrchardMap(path).changes()[1:] == [("removed", DATES[2], Change("joined", split, int(taken_for_one), 1))]
    assert problems(path) == []
    # The id was given out once and never is again.
    again = add_session(path, Session(DATES[2], DATES[2], "test", sights[2]))
    assert again.changes[0].to_fruit_id > split


def parts(row: FruitCloud) -> list[Session]:
    """One end of the row, the other end, and all of it."""
    along = row.positions @ np.linalg.svd(row.positions - row.positions.mean(axis=0))[2][0]
    low, high = np.quantile(along, [0.4, 0.6])
    return [visit(row, number, shows) for number, shows in enumerate((along < low, along > high, along == along))]


def test_of_several_one_that_lies_apart_waits_for_what_lies_between(row: FruitCloud, tmp_path: Path) -> None:
    one_end, other_end, whole = parts(row)
    path = tmp_path / "orchard.gpkg"
    assert add_session(path, one_end).is_added
    assert not add_session(path, other_end).is_added
    assert [added.is_added for added in add_sessions(path, [other_end, whole])] == [True, True]
    tracks = [{name.split(".")[1] for name in sights} for sights in who_is_who(path)]
    assert sum(len(track) == 1 for track in tracks) > 0.97 * len(tracks)
    assert problems(path) == []


def test_the_command_line_adds_several_and_tells_what_changed(
    visits: list[Session],
    tmp_path: Path,
    run_here: Run,
) -> None:
    files = []
    for one in visits[:3]:
        files.append(str(tmp_path / f"{one.name}.gpkg"))
        write_session(files[-1], one.cloud, name=one.name, date=one.date, recording="test")
    orchard = str(tmp_path / "orchard.gpkg")
    done = run_here("map", "add", orchard, *files)
    assert done.returncode == 0
    told = done.stdout.splitlines()
    assert [line.split(":")[0] for line in told if not line.startswith(" ")] == list(DATES[:3])
    changes = OrchardMap(orchard).changes()
    assert len([line for line in told if line.startswith("  fruit ")]) == len(changes)
    again = run_here("map", "add", orchard, *files, "--date", "2024-06-01")
    assert_refused(again, "--date: found it with 3 sessions, expected one")


@pytest.mark.parametrize(
    ("damage", "line"),
    [
        ("UPDATE fruits SET state = 'gone' WHERE id = 7", "fruit 7 has the state gone, from what the sessions saw"),
        ("UPDATE matches SET pairs = '[[1, 99999, 0.5]]' WHERE id = 1", "matches 1: pairs: found 99999, expected"),
        (
            "UPDATE matches SET pairs = '[[1, 2, 7.0]]' WHERE id = 1",
            "matches 1: pairs: found '[[1, 2, 7.0]]'",
        ),
        ("UPDATE matches SET first_session_id = 77 WHERE id = 1", "matches 1 points to a row of sessions"),
    ],
)
def test_check_asks_identities_of_the_evidence(season: Path, damage: str, line: str, tmp_path: Path) -> None:
    path = tmp_path / "orchard.gpkg"
    path.write_bytes(season.read_bytes())
    connection = geopackage.connect(path)
    connection.execute("PRAGMA foreign_keys = OFF")
    connection.execute(damage)
    connection.close()
    try:
        found = problems(path)
    except PomonaError as error:
        found = [str(error)]
    assert any(line in problem for problem in found)


def test_check_finds_an_identity_that_does_not_follow(season: Path, tmp_path: Path) -> None:
    path = tmp_path / "orchard.gpkg"
    path.write_bytes(season.read_bytes())
    connection = geopackage.connect(path)
    # Two fruits change places in one session: all counts still agree.
    twice = "SELECT fruit_id FROM observations WHERE session_id IN (1, 2, 3) GROUP BY fruit_id HAVING count(*) = 3"
    (one,), (other,) = connection.execute(f"{twice} LIMIT 2").fetchall()
    connection.execute("PRAGMA foreign_keys = OFF")
    swap = "UPDATE observations SET fruit_id = ? WHERE session_id = 1 AND fruit_id = ?"
    connection.execute(swap, (-1, one))
    connection.execute(swap, (one, other))
    connection.execute(swap, (other, -1))
    connection.close()
    line = f"fruit {one} has 1 observation that from what the sessions saw belong to fruit {other}"
    assert line in problems(path)


def test_gone_is_what_was_thinned(row: FruitCloud, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    thinned = rng.random(len(row)) < 0.3
    shows = [rng.random(len(row)) < 0.93 for _ in range(4)]
    visits = [visit(row, number, mask & ~(thinned & (number > 1))) for number, mask in enumerate(shows)]
    path = grow_map(tmp_path / "orchard.gpkg", visits)
    by_fruit = {label.split(".")[1]: facts[0] for label, facts in judged(path).items()}
    said = {int(name) for name, state in by_fruit.items() if state == "gone" and int(name) < len(row)}
    hung = {int(name) for name in by_fruit if int(name) < len(row)}
    gone = set(np.flatnonzero(thinned).tolist()) & hung
    assert len(said & gone) > 0.92 * len(gone)
    assert len(said - gone) < 0.02 * len(hung - gone)


def test_fruitlets_that_will_drop_keep_their_identity(row: FruitCloud, tmp_path: Path) -> None:
    """One in ten all but stands still, as those of which thinning is told."""
    rng = np.random.default_rng(6)
    slow = rng.random(len(row)) < 0.1
    at_first_m = 0.018 * np.exp(rng.normal(0.0, 0.12, len(row)))
    visits = []
    for number, days in enumerate((0, 10)):
        seen = np.flatnonzero(rng.random(len(row)) < 0.9)
        sizes_m = at_first_m + days * np.where(slow, 0.0002, 0.0008) + rng.normal(0.0, 0.0005, len(row))
        places = row.positions[seen] + rng.normal(0.0, 0.006, (len(seen), 3))
        cloud = FruitCloud(places, ids=tuple(map(str, seen)), diameters_m=sizes_m[seen])
        visits.append(Session(DATES[number], DATES[number], "test", cloud))
    orchard = OrchardMap(grow_map(tmp_path / "orchard.gpkg", visits))
    seen = orchard.observations()
    sights: dict[int, list[int]] = {}
    for fruit, label in zip(seen.labels, seen.fruit_ids.tolist(), strict=True):
        sights.setdefault(int(str(fruit)), []).append(label)
    twice = {fruit: ids for fruit, ids in sights.items() if len(ids) == 2}
    kept = [np.mean([ids[0] == ids[1] for fruit, ids in twice.items() if slow[fruit] == which]) for which in (1, 0)]
    assert kept[0] > 0.9
    assert kept[1] > 0.97
