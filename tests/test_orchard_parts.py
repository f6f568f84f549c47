"""Parts of a map that know nothing of each other, and the visit that saw both."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchard_maker import frame_of_its_own, who_is_who
from pomona import FruitCloud
from pomona.growth.season_growth import grow_season
from pomona.orchard import OrchardMap, Session, add_session, problems, recognising, remove_session, seen_parts
from pomona.orchard.adding import _beside, _join
from pomona.orchard.evidence import Evidence
from pomona.orchard.parts import parts_of_map
from pomona.store.opening import snapshot, writing
from pomona.synth.clouds import scene_pair

DATES = ("2024-06-01", "2024-06-15", "2024-06-29", "2024-07-13")


def visit(number: int, low: float, high: float) -> Session:
    """Four of five fruits of a stretch of the row, 1 cm off, in a frame of their own."""
    rng = np.random.default_rng(number)
    row = scene_pair("base", seed=3).map
    along = row.positions @ np.linalg.svd(row.positions - row.positions.mean(axis=0))[2][0]
    from_m, to_m = np.quantile(along, (low, high))
    seen = np.flatnonzero((from_m <= along) & (along <= to_m) & (rng.random(len(row)) < 0.8))
    frame = frame_of_its_own(rng)
    cloud = FruitCloud(
        row.positions[seen] + rng.normal(0, 0.01, (len(seen), 3)),
        ids=tuple(f"{number}.{fruit}" for fruit in seen.tolist()),
    )
    return Session(DATES[number], DATES[number], "test", cloud.transformed(frame))


@pytest.fixture(scope="module")
def visits() -> list[Session]:
    """The left, the right, all of the row, and the left again."""
    return [visit(0, 0.0, 0.45), visit(1, 0.55, 1.0), visit(2, 0.0, 1.0), visit(3, 0.0, 0.45)]


@pytest.fixture(scope="module")
def most_and_little() -> list[Session]:
    """Most of the row, its end of some thirty fruits, and all of it."""
    return [visit(0, 0.0, 0.83), visit(1, 0.91, 1.0), visit(2, 0.0, 1.0)]


def two_parts(path: Path, visits: list[Session]) -> Path:
    add_session(path, visits[0])
    assert not add_session(path, visits[1]).is_added
    assert add_session(path, visits[1], new_part=True).is_added
    return path


def n_parts(path: Path) -> int:
    with snapshot(path) as (connection, _):
        return len(parts_of_map(connection))


def test_each_part_is_counted_by_itself(visits: list[Session], tmp_path: Path) -> None:
    """By the number that the map says of its sessions."""
    path = tmp_path / "orchard.gpkg"
    sizes_mm = (40.0, 44.0, 60.0, 66.0)
    days = ("2024-06-01", "2024-06-21", "2024-06-01", "2024-06-21")
    rng = np.random.default_rng(2)
    for number, (one, mm, day) in enumerate(
        zip([visits[0], visits[3], visits[1], visits[1]], sizes_mm, days, strict=True)
    ):
        places = one.cloud.positions + rng.normal(0.0, 0.006, (len(one.cloud), 3))
        sizes_m = 0.001 * mm * rng.lognormal(0.0, 0.05, len(places))
        cloud = replace(one.cloud, positions=places, diameters_m=sizes_m)
        session = Session(f"{number}", day, "test", cloud)
        assert add_session(path, session, new_part=True).is_added
    assert [(visit.name, visit.part) for visit in sorted(OrchardMap(path).visits(), key=lambda visit: visit.name)] == [
        ("0", 1), ("1", 1), ("2", 2), ("3", 2)
    ]  # fmt: skip
    growth = grow_season(path)
    parts = {block.name: block for block in growth.blocks if block.kind == "part"}
    assert list(parts) == ["1", "2"]
    assert sum(block.n_fruits for block in parts.values()) == pytest.approx(growth.blocks[0].n_fruits, abs=1)
    now_mm = growth.foretold.sizes_mm[:, -1]
    assert [parts[name].mean_of(now_mm) for name in ("1", "2")] == pytest.approx([44.0, 66.0], rel=0.05)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Fruits of each look for what a visit saw beyond a part, or in parts by themselves."""
    asked: list[int] = []
    looked_for = seen_parts.recognised

    def recognised(connection: object, cloud: FruitCloud, *rest: object) -> object:
        asked.append(len(cloud))
        return looked_for(connection, cloud, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(seen_parts, "recognised", recognised)
    return asked


def test_a_visit_that_saw_two_parts_makes_one_of_them(visits: list[Session], tmp_path: Path) -> None:
    path = two_parts(tmp_path / "orchard.gpkg", visits)
    assert n_parts(path) == 2
    added = add_session(path, visits[2])
    assert n_parts(path) == 1
    assert added.n_matched > 0.65 * len(visits[2].cloud)
    assert problems(path) == []
    # As if it had come before them.
    other = tmp_path / "other.gpkg"
    for number in (2, 1, 0):
        assert add_session(other, visits[number]).is_added
    assert who_is_who(path) == who_is_who(other)


def test_what_one_visit_joined_comes_apart_without_it(visits: list[Session], tmp_path: Path) -> None:
    path = two_parts(tmp_path / "orchard.gpkg", visits)
    before = who_is_who(path)
    add_session(path, visits[2])
    assert remove_session(path, visits[2].name) is not None
    assert n_parts(path) == 2
    assert who_is_who(path) == before
    assert problems(path) == []


def test_the_little_end_of_a_row_joins_its_part(
    most_and_little: list[Session], tmp_path: Path, asked: list[int]
) -> None:
    path = two_parts(tmp_path / "orchard.gpkg", most_and_little)
    assert add_session(path, visit(3, 0.1, 0.6)).is_added
    assert asked == []
    assert add_session(path, most_and_little[2]).is_added
    # The end is found beside the rest, as a part of its own: so each part of the map is asked by itself.
    assert asked == 2 * [len(most_and_little[2].cloud)]
    assert n_parts(path) == 1
    assert problems(path) == []


def test_what_a_visit_saw_beyond_one_part_of_a_large_map_is_looked_for_in_the_others(
    visits: list[Session], tmp_path: Path, asked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Of a large map only what lies around a part is matched with.
    monkeypatch.setattr(recognising, "LARGE", 100)
    path = two_parts(tmp_path / "orchard.gpkg", visits)
    assert add_session(path, visits[2]).is_added
    assert 0.4 < asked[0] / len(visits[2].cloud) < 0.6, asked
    assert n_parts(path) == 1
    assert problems(path) == []


def test_what_two_parts_tell_alike_joins_none(tmp_path: Path) -> None:
    path = tmp_path / "orchard.gpkg"
    add_session(path, visit(0, 0.0, 1.0))
    twin = replace(visit(1, 0.0, 1.0), name="twin")
    with writing(path, "map") as (connection, _):
        _join(connection, twin, Evidence((), ()), {}, map_from_session=_beside(connection, twin))
    assert n_parts(path) == 2
    assert not add_session(path, visit(2, 0.0, 1.0)).is_added
