"""A session in the place of the one of its name: a recording that was scanned again."""

from dataclasses import replace
from pathlib import Path

import pytest

from pomona import FruitCloud
from pomona.orchard import OrchardMap, Session, add_session, problems
from pomona.synth.clouds import scene_pair

Sessions = tuple[Session, Session]


@pytest.fixture(scope="module")
def visits() -> Sessions:
    pair = scene_pair("base", 3)
    return Session("august", "2024-08-01", "a", pair.map), Session("september", "2024-09-01", "b", pair.query)


@pytest.fixture
def orchard(tmp_path: Path, visits: Sessions) -> Path:
    path = tmp_path / "orchard.gpkg"
    assert all(add_session(path, visit).is_added for visit in visits)
    return path


def fewer(visit: Session, count: int) -> Session:
    cloud: FruitCloud = visit.cloud
    return replace(visit, cloud=cloud.select(range(len(cloud) - count)))


def test_the_very_same_session_is_left_as_it_is(orchard: Path, visits: Sessions) -> None:
    before = orchard.read_bytes()
    again = add_session(orchard, visits[1], replacing=True)
    assert again.is_added
    assert again.was_there
    assert orchard.read_bytes() == before
    assert again.n_matched + again.n_new == len(visits[1].cloud)
    seen = OrchardMap(orchard).observations()
    of_september = [
        fruit for fruit, name in zip(seen.fruit_ids.tolist(), seen.sessions, strict=True) if name == "september"
    ]
    assert sorted(again.fruit_ids.tolist()) == sorted(of_september)


@pytest.mark.parametrize("number", [0, 1])
def test_another_look_takes_its_place_and_the_map_is_as_if_it_had_been_the_first(
    orchard: Path, visits: Sessions, tmp_path: Path, number: int
) -> None:
    changed = fewer(visits[number], 5)
    added = add_session(orchard, changed, replacing=True)
    assert added.is_added
    assert not added.was_there
    assert problems(orchard) == []
    assert sorted(visit.name for visit in OrchardMap(orchard).visits()) == ["august", "september"]
    assert sum(visit.n_fruits for visit in OrchardMap(orchard).visits()) == sum(len(v.cloud) for v in visits) - 5
    anew = tmp_path / "anew.gpkg"
    for visit in (visits[1 - number], changed):
        add_session(anew, visit)
    assert len(OrchardMap(anew).fruits()) == len(OrchardMap(orchard).fruits())


def test_where_the_new_look_is_not_found_the_old_one_stays(orchard: Path, visits: Sessions) -> None:
    before = OrchardMap(orchard).observations()
    elsewhere = replace(visits[1], cloud=scene_pair("noov", 5).query)
    refused = add_session(orchard, elsewhere, replacing=True)
    assert not refused.is_added
    after = OrchardMap(orchard).observations()
    assert (after.fruit_ids == before.fruit_ids).all()
    assert (after.positions_in_map == before.positions_in_map).all()


def test_the_only_session_of_a_map_is_replaced_by_whatever_has_its_name(tmp_path: Path, visits: Sessions) -> None:
    path = tmp_path / "orchard.gpkg"
    first = add_session(path, visits[0])
    again = add_session(path, replace(visits[1], name="august"), replacing=True)
    assert again.is_added
    assert problems(path) == []
    assert len(OrchardMap(path).fruits()) == len(visits[1].cloud)
    assert not set(again.fruit_ids.tolist()) & set(first.fruit_ids.tolist()), "an id is never given out twice"
