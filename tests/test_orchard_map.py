"""Identities over visits: who keeps an id, who gets one, and what a map refuses."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchard_maker import frame_of_its_own, scattered
from pomona import FruitCloud, PomonaError, geopackage
from pomona.orchard import (
    FORMAT_VERSION,
    OrchardMap,
    Session,
    add_session,
    load_session,
    problems,
    recognising,
    write_session,
)
from pomona.settings import Settings
from pomona.synth.clouds import scene_pair


def turned(cloud: FruitCloud, seed: int) -> FruitCloud:
    """The cloud as another visit sees it: in a random other frame, its fruits scattered."""
    rng = np.random.default_rng(seed)
    return scattered(cloud.transformed(frame_of_its_own(rng)), rng)


def visit(cloud: FruitCloud, date: str, **about: object) -> Session:
    return replace(Session(name=date, date=date, recording="test", cloud=cloud), **about)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def scenes() -> list[FruitCloud]:
    """Two visits to one row, ids true; the second in another frame."""
    pair = scene_pair("base", seed=3)
    return [pair.map, pair.query]


@pytest.fixture
def grown(tmp_path: Path, scenes: list[FruitCloud]) -> Path:
    """A map with both visits."""
    path = tmp_path / "orchard.gpkg"
    for month, cloud in enumerate(scenes, start=8):
        assert add_session(path, visit(cloud, f"2024-{month:02d}-01")).is_added
    return path


def test_the_first_session_starts_the_map(tmp_path: Path, scenes: list[FruitCloud]) -> None:
    path = tmp_path / "orchard.gpkg"
    added = add_session(path, visit(scenes[0], "2024-08-01"))
    n = len(scenes[0])
    np.testing.assert_array_equal(added.fruit_ids, np.arange(1, n + 1))
    assert (added.n_matched, added.n_new, added.n_missed, added.match) == (0, n, 0, None)
    fruits = OrchardMap(path).fruits()
    np.testing.assert_array_equal(fruits.positions, scenes[0].positions)
    assert set(fruits.extras["state"]) == {"seen"}
    assert problems(path) == []


def test_known_fruits_keep_their_ids_and_new_ones_get_the_next(tmp_path: Path, scenes: list[FruitCloud]) -> None:
    path = tmp_path / "orchard.gpkg"
    first = add_session(path, visit(scenes[0], "2024-08-01"))
    second = add_session(path, visit(scenes[1], "2024-09-01"))
    assert second.match is not None
    assert second.n_matched + second.n_new == len(scenes[1])
    assert len(set(second.fruit_ids.tolist())) == len(scenes[1])
    new = second.fruit_ids[second.fruit_ids > len(scenes[0])]
    np.testing.assert_array_equal(new, np.arange(len(scenes[0]) + 1, len(scenes[0]) + 1 + second.n_new))

    # The ids of the scenes are the truth, which the map must not look at.
    truth = dict(zip(first.fruit_ids.tolist(), scenes[0].ids or (), strict=True))
    pairs = [(truth.get(i), label) for i, label in zip(second.fruit_ids.tolist(), scenes[1].ids or (), strict=True)]
    right = sum(known == label for known, label in pairs)
    common = len(set(scenes[0].ids or ()) & set(scenes[1].ids or ()))
    assert right >= 0.9 * common
    assert right >= 0.8 * second.n_matched
    assert problems(path) == []


def test_the_same_visits_make_the_same_file(grown: Path, tmp_path: Path, scenes: list[FruitCloud]) -> None:
    again = tmp_path / "again.gpkg"
    for month, cloud in enumerate(scenes, start=8):
        add_session(again, visit(cloud, f"2024-{month:02d}-01"))
    assert again.read_bytes() == grown.read_bytes()


def test_the_map_moves_with_the_tree(grown: Path, scenes: list[FruitCloud]) -> None:
    orchard = OrchardMap(grown)
    first, second = orchard.visits()
    np.testing.assert_array_equal(first.map_from_session, np.eye(4))
    in_map = scenes[1].transformed(second.map_from_session).positions
    seen = orchard.observations()
    of_second = [row for row, name in enumerate(seen.sessions) if name == second.name]
    by_label = dict(zip(scenes[1].ids or (), in_map, strict=True))
    fruits = orchard.fruits()
    place = dict(zip(fruits.ids or (), fruits.positions, strict=True))
    for row in of_second:
        np.testing.assert_allclose(seen.positions_in_map[row], by_label[str(seen.labels[row])], atol=1e-12)
        np.testing.assert_array_equal(place[str(seen.fruit_ids[row])], seen.positions_in_map[row])
    assert np.isfinite(seen.probabilities[of_second]).sum() == second.n_matched


def test_neither_names_nor_order_of_the_fruits_matter(tmp_path: Path, scenes: list[FruitCloud]) -> None:
    order = np.random.default_rng(1).permutation(len(scenes[1]))
    shuffled = replace(scenes[1].select(order), ids=None)
    answers = []
    for name, cloud in {"named": scenes[1], "nameless": shuffled}.items():
        path = tmp_path / f"{name}.gpkg"
        add_session(path, visit(scenes[0], "2024-08-01"))
        answers.append(add_session(path, visit(cloud, "2024-09-01")).fruit_ids)
    known = answers[0] <= len(scenes[0])
    np.testing.assert_array_equal(answers[1][known[order]], answers[0][order][known[order]])


def test_an_older_visit_added_late_leaves_fruits_where_they_are(tmp_path: Path, scenes: list[FruitCloud]) -> None:
    path = tmp_path / "orchard.gpkg"
    add_session(path, visit(scenes[0], "2024-09-01"))
    late = add_session(path, visit(scenes[1], "2024-08-01"))
    assert late.n_matched > 0
    fruits = OrchardMap(path).fruits()
    n = len(scenes[0])
    np.testing.assert_array_equal(fruits.positions[:n], scenes[0].positions)
    assert set(fruits.extras["last_seen"][:n]) == {"2024-09-01"}
    # What the older visit had not seen is new; what only it saw was missed by the newer one.
    assert set(fruits.extras["state"][:n]) == {"seen", "new"}
    assert set(fruits.extras["state"][n:]) <= {"seen", "missed", "gone"}
    assert sum(count == "2" for count in fruits.extras["n_sessions"]) == late.n_matched
    assert [one.date for one in OrchardMap(path).visits()] == ["2024-08-01", "2024-09-01"]
    assert problems(path) == []


def test_a_fruit_in_view_that_is_not_seen_is_missed_until_it_is_back(tmp_path: Path, scenes: list[FruitCloud]) -> None:
    path = tmp_path / "orchard.gpkg"
    cloud = scenes[0]
    middle = int(np.argmin(np.linalg.norm(cloud.positions - cloud.positions.mean(axis=0), axis=1)))
    everyone = np.arange(len(cloud))
    add_session(path, visit(cloud, "2024-08-01"))
    without = add_session(path, visit(turned(cloud.select(everyone != middle), 1), "2024-08-08"))
    assert (without.n_matched, without.n_new, without.n_missed) == (len(cloud) - 1, 0, 1)
    fruits = OrchardMap(path).fruits()
    assert fruits.extras["state"][middle] == "missed"
    assert fruits.extras["last_seen"][middle] == "2024-08-01"
    back = add_session(path, visit(turned(cloud, 2), "2024-08-15"))
    assert (back.n_matched, back.n_new, back.n_missed) == (len(cloud), 0, 0)
    fruits = OrchardMap(path).fruits()
    hits_and_misses = [fruits.extras[name][middle] for name in ("state", "n_sessions", "n_missed")]
    assert hits_and_misses == ["seen", "2", "1"]
    assert problems(path) == []


def test_fruits_out_of_view_are_not_missed(tmp_path: Path, scenes: list[FruitCloud]) -> None:
    path = tmp_path / "orchard.gpkg"
    cloud = scenes[0]
    along = cloud.positions @ np.linalg.svd(cloud.positions - cloud.positions.mean(axis=0))[2][0]
    half = cloud.select(along > np.median(along))
    add_session(path, visit(cloud, "2024-08-01"))
    added = add_session(path, visit(turned(half, 3), "2024-08-08"))
    assert added.n_matched == len(half)
    # Only at the cut can a fruit have more neighbours on the seen side than on its own.
    assert added.n_missed < 0.1 * len(half)


def test_a_visit_that_only_the_map_knows_keeps_fruits_whole(
    tmp_path: Path, scenes: list[FruitCloud], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no visit has enough of its fruits, those of the map have sights before the last one too.

    A visit that shares one last sight with the first visit, and all others with the second, was said to have been
    matched with the first: all that this match left out spoke against the fruits that the first two visits share.
    """
    monkeypatch.setattr(recognising, "matches_between", lambda *_, **__: {})
    path, cloud = tmp_path / "orchard.gpkg", scenes[0]
    rng = np.random.default_rng(4)
    for month in range(6, 10):
        seen = np.flatnonzero(rng.random(len(cloud)) < 0.9)
        assert add_session(path, visit(turned(cloud.select(seen), month), f"2024-{month:02d}-01")).is_added
    identities: dict[str, set[int]] = defaultdict(set)
    observed = OrchardMap(path).observations()
    for label, fruit in zip(observed.labels, observed.fruit_ids.tolist(), strict=True):
        identities[label].add(fruit)
    split = [label for label, fruits in identities.items() if len(fruits) > 1]
    assert len(split) <= 0.01 * len(identities)


def test_a_session_that_is_not_found_leaves_the_map_alone(grown: Path) -> None:
    before = grown.read_bytes()
    elsewhere = scene_pair("noov", seed=11).query
    added = add_session(grown, visit(elsewhere, "2024-10-01"))
    assert added.match is not None
    assert added.match.status != "Found"
    assert not added.is_added
    assert grown.read_bytes() == before


def test_a_session_is_added_once(grown: Path, scenes: list[FruitCloud]) -> None:
    before = grown.read_bytes()
    again = visit(scenes[1], "2024-09-01")
    for session, reason in {
        again: "session 2024-09-01 is in the map already",
        replace(again, name="other"): "session other is in the map already, as 2024-09-01: the same fruits",
    }.items():
        with pytest.raises(PomonaError) as caught:
            add_session(grown, session)
        assert str(caught.value) == f"{grown}: {reason}"
    assert grown.read_bytes() == before


def nameless_and_backwards(cloud: FruitCloud) -> FruitCloud:
    return replace(cloud.select(np.arange(len(cloud))[::-1]), ids=None)


RNG = np.random.default_rng(7)

COPIES: dict[str, Callable[[FruitCloud], FruitCloud]] = {
    "in another order, without names": nameless_and_backwards,
    "rounded to millimetres": lambda cloud: replace(cloud, positions=np.round(cloud.positions, 3)),
    "rounded to centimetres": lambda cloud: replace(cloud, positions=np.round(cloud.positions, 2)),
    "five fruits fewer": lambda cloud: cloud.select(np.arange(5, len(cloud))),
    "with numbers of views": lambda cloud: replace(cloud, n_views=np.full(len(cloud), 5)),
    "in another frame": lambda cloud: cloud.transformed(frame_of_its_own(np.random.default_rng(2))),
    "with sizes": lambda cloud: replace(cloud, diameters_m=np.full(len(cloud), 0.07)),
    "2 mm off": lambda cloud: scattered(cloud, np.random.default_rng(5), 0.002),
    "1 mm off and a fifth fewer": lambda cloud: scattered(cloud.select(np.arange(70, len(cloud))), RNG, 0.001),
}


@pytest.mark.parametrize("how", COPIES)
def test_a_copy_of_a_visit_is_refused(grown: Path, scenes: list[FruitCloud], how: str) -> None:
    before = grown.read_bytes()
    with pytest.raises(PomonaError, match=r"session copy is in the map already, as 2024-09-01: .*\d of \d+ fruits lie"):
        add_session(grown, visit(COPIES[how](scenes[1]), "2024-10-01", name="copy"))
    assert grown.read_bytes() == before


def test_what_may_be_a_copy_is_told_in_the_frame_of_the_other(tmp_path: Path, scenes: list[FruitCloud]) -> None:
    rng = np.random.default_rng(8)
    fewer = scattered(scenes[1].select(np.flatnonzero(rng.random(len(scenes[1])) < 0.8)), rng, 0.003)
    for number, (cloud, copied) in enumerate([(fewer, "2024-09-01"), (turned(fewer, 4), None)]):
        path = tmp_path / f"{number}.gpkg"
        add_session(path, visit(scenes[1], "2024-09-01"))
        assert add_session(path, visit(cloud, "2024-10-01")).copy_of == copied


def test_the_same_fruits_in_another_order_are_the_same_session(grown: Path, scenes: list[FruitCloud]) -> None:
    backwards = scenes[1].select(np.arange(len(scenes[1]))[::-1])
    with pytest.raises(PomonaError, match="session copy is in the map already, as 2024-09-01: the same fruits"):
        add_session(grown, visit(backwards, "2024-10-01", name="copy"))


@pytest.mark.parametrize("scatter_m", [0.001, 0.003])
def test_a_visit_of_the_next_hour_is_another_one(tmp_path: Path, scenes: list[FruitCloud], scatter_m: float) -> None:
    """A good sensor and no wind: on one day only the sensor errs."""
    path, rng, n = tmp_path / "orchard.gpkg", np.random.default_rng(5), len(scenes[1])
    for hour in (10, 11):
        seen = np.flatnonzero(rng.random(n) < 0.95)
        again = scattered(scenes[1].select(seen), rng, scatter_m)
        assert add_session(path, visit(again, f"2024-09-01T{hour}:00:00")).is_added


def test_another_session_of_the_same_name_is_told_from_the_same_one(grown: Path, scenes: list[FruitCloud]) -> None:
    before = grown.read_bytes()
    with pytest.raises(PomonaError, match=r"another session is called 2024-09-01, with other fruits, expected a name"):
        add_session(grown, visit(scenes[1].select(np.arange(60)), "2024-09-01"))
    assert grown.read_bytes() == before


def test_a_recording_is_added_once_whatever_was_made_of_it(tmp_path: Path, scenes: list[FruitCloud]) -> None:
    path = tmp_path / "orchard.gpkg"
    hashes = {"left/0000.png": "ab"}
    add_session(path, visit(scenes[0], "2024-08-01", input_hashes=hashes))
    with pytest.raises(PomonaError, match="is in the map already, as 2024-08-01: the same input files"):
        add_session(path, visit(scenes[0].select(np.arange(100)), "2024-08-02", input_hashes=hashes))


def test_a_map_and_a_session_are_not_each_other(tmp_path: Path, grown: Path, scenes: list[FruitCloud]) -> None:
    session_file = tmp_path / "visit.gpkg"
    write_session(session_file, scenes[0], name="visit", date="2024-08-01", recording="test")
    with pytest.raises(PomonaError, match="is the file of one session, expected a map"):
        add_session(session_file, visit(scenes[1], "2024-09-01"))
    with pytest.raises(PomonaError, match="is a map, expected the file of one session"):
        load_session(grown)
    with pytest.raises(PomonaError, match=r"found suffix '.csv', expected .gpkg for a map"):
        add_session(tmp_path / "orchard.csv", visit(scenes[1], "2024-09-01"))
    with pytest.raises(PomonaError, match="has no fruits, expected at least one"):
        add_session(tmp_path / "orchard.gpkg", visit(scenes[1].select([]), "2024-09-01"))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            "UPDATE pomona_format SET format_version = 99",
            f"has format 99, this program reads up to {FORMAT_VERSION}: update pomona",
        ),
        ("DROP TABLE pomona_format", "is a GeoPackage but not one of pomona: it has no table pomona_format"),
        ("PRAGMA application_id = 0", "is not a GeoPackage: application id 0x0, expected 'GPKG'"),
    ],
)
def test_a_map_of_another_program_is_left_alone(
    grown: Path, scenes: list[FruitCloud], change: str, reason: str
) -> None:
    connection = geopackage.connect(grown)
    connection.execute(change)
    connection.close()
    before = grown.read_bytes()
    with pytest.raises(PomonaError) as caught:
        add_session(grown, visit(scenes[1], "2024-10-01"))
    assert str(caught.value) == f"{grown}: {reason}"
    assert grown.read_bytes() == before


def test_nothing_is_left_of_a_map_that_could_not_be_started(
    tmp_path: Path, scenes: list[FruitCloud], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pomona.orchard.joining.update_layers", interrupted)
    with pytest.raises(KeyboardInterrupt):
        add_session(tmp_path / "orchard.gpkg", visit(scenes[0], "2024-08-01"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("damage", "line"),
    [
        ("DELETE FROM observations WHERE fruit_id = 7 ", "fruit 7 was never observed"),
        ("UPDATE fruits SET n_sessions = 9 WHERE id = 7", "fruit 7 counts 9 sessions, observed in"),
        (
            "UPDATE fruits SET geom = (SELECT geom FROM fruits WHERE id = 8) WHERE id = 7",
            "fruit 7 is not where session",
        ),
        ("UPDATE sessions SET date = '2025-01-01' WHERE id = 1", "was last seen on 2024-"),
        (
            "UPDATE observations SET match_probability = 1.5 WHERE id = 1",
            "observations 1: match_probability: found 1.5, expected",
        ),
        ("DELETE FROM rtree_fruits_geom WHERE id = 7", "fruit 7 is not in the spatial index"),
        ("DELETE FROM sessions WHERE id = 1", "points to a row of sessions that is not there"),
        ("UPDATE pomona_format SET kind = 'session'", "the file of a session holds 2 sessions"),
    ],
)
def test_check_finds(grown: Path, damage: str, line: str) -> None:
    assert problems(grown) == []
    connection = geopackage.connect(grown)
    connection.execute("PRAGMA foreign_keys = OFF")
    connection.execute(damage)
    connection.close()
    assert any(line in problem for problem in problems(grown))


@pytest.mark.parametrize("method", ["verified", "paper"])
def test_real_captures_give_one_identity_an_apple(tmp_path: Path, shared_data: Path, method: str) -> None:
    """Four captures of the same 25-26 apples and two balls; the laboratory's ids are the truth."""
    path = tmp_path / "orchard.gpkg"
    captures = sorted((shared_data / "kinect_apples").glob("*_fruits.csv"))
    for seed, capture in enumerate(captures):
        hour, minute, second = (capture.name[i : i + 2] for i in (0, 2, 4))
        session = load_session(capture, date=f"2021-09-27T{hour}:{minute}:{second}")
        turned_session = replace(session, cloud=turned(session.cloud, seed))
        added = add_session(path, turned_session, settings=Settings.load(None, {"method": method}))
        assert added.is_added
    seen = OrchardMap(path).observations()
    identities, apples = defaultdict(set), defaultdict(set)
    for fruit_id, label in zip(seen.fruit_ids.tolist(), seen.labels, strict=True):
        identities[label].add(fruit_id)
        apples[fruit_id].add(label)
    splits = [label for label, ids in identities.items() if len(ids) > 1]
    merges = [fruit_id for fruit_id, labels in apples.items() if len(labels) > 1]
    assert (splits, merges) == ([], [])
    assert len(apples) == len(identities) == 28
    assert problems(path) == []
