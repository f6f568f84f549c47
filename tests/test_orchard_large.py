"""What a large map costs: a session is looked for where it seems to lie, and only its part is read and written."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pomona import FruitCloud
from pomona.orchard import OrchardMap, Session, add_session, joining, problems, recognising
from pomona.orchard.evidence import Evidence
from pomona.synth.clouds import scene_pair

N_ROWS = 4


def visit(number: int, day: str) -> Session:
    """Four of five fruits of a row, 1 cm off, in a frame of their own."""
    row = scene_pair("base", seed=number).map
    rng = np.random.default_rng([number, int(day[-2:])])
    seen = np.flatnonzero(rng.random(len(row)) < 0.8)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.uniform(-5, 5, 3)
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
    # Once with what lies there, once with the visit to that row: never with the four rows.
    n_fruits = len(OrchardMap(orchard).fruits())
    assert len(asked) == 2
    assert max(asked) < n_fruits / 2
    stranger = visit(9, "2024-07-01")
    assert not add_session(orchard, stranger).is_added
    assert asked[-1] == n_fruits
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
