"""Rows that are torn apart, where a camera lost its way: laid part by part, and put together in a map."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orchard_maker import who_is_who
from pomona import FruitCloud, Match, PomonaError, laid_in_parts, match
from pomona.orchard import OrchardMap, Session, add_session, problems
from pomona.orchard.mending import mended
from pomona.orchard.replacing import holds
from pomona.store.opening import snapshot
from pomona.synth.clouds import scene_pair
from pomona.torn_rows import parts_of_fruits
from pomona.trajectory import Trajectory

ROW = scene_pair("base", seed=3).map
ALONG = np.linalg.svd(ROW.positions - ROW.positions.mean(axis=0))[2][0]
TEAR = np.eye(4)
TEAR[:3, :3] = Rotation.from_euler("z", 25, degrees=True).as_matrix()
TEAR[:3, 3] = [1.5, -4.0, 0.3]


def seen(number: int, *, is_torn: bool) -> tuple[FruitCloud, np.ndarray]:
    """Four of five fruits of the row, 1 cm off, the farther half elsewhere where it is torn; and which these are."""
    rng = np.random.default_rng(number)
    cloud = ROW.select(rng.random(len(ROW)) < 0.8)
    cloud = replace(cloud, positions=cloud.positions + rng.normal(0, 0.01, cloud.positions.shape))
    behind = (cloud.positions - ROW.positions.mean(axis=0)) @ ALONG > 0.0
    torn = cloud.transformed(TEAR).positions
    return (replace(cloud, positions=np.where(behind[:, None] & is_torn, torn, cloud.positions)), behind)


def visit(number: int, *, is_torn: bool) -> Session:
    return Session(f"{number}", f"2024-06-{number + 1:02d}", "test", seen(number, is_torn=is_torn)[0])


@pytest.fixture(scope="module")
def found() -> tuple[FruitCloud, np.ndarray, Match]:
    query, behind = seen(1, is_torn=True)
    return query, behind, match(query, seen(0, is_torn=False)[0])


def test_each_fruit_belongs_to_its_part_and_lies_by_its_pose(found) -> None:
    query, behind, answer = found
    assert answer.n_parts == len(answer.parts) == 2
    assert np.array_equal(answer.parts[0], answer.map_from_query)
    parts = parts_of_fruits(answer, query)
    first_is_behind = bool(parts[behind].mean() < 0.5)
    assert ((parts == 1) == (behind ^ first_is_behind)).mean() > 0.99
    laid = laid_in_parts(answer, query)
    places = dict(zip(ROW.ids, ROW.positions, strict=True))
    off_m = np.linalg.norm(laid.positions - [places[fruit] for fruit in query.ids], axis=1)
    assert np.quantile(off_m, 0.95) < 0.04
    # By the pose of the first alone half of the row lies metres off.
    by_one = np.linalg.norm(query.transformed(answer.map_from_query).positions - laid.positions, axis=1)
    assert np.quantile(by_one, 0.7) > 1.0


def test_pairs_say_which_part_they_belong_to(found) -> None:
    query, _, answer = found
    known = seen(0, is_torn=False)[0]
    ends = [
        answer.parts[part] @ [*query.positions[row], 1.0]
        for part, (row, _) in zip(answer.part_of_pairs, answer.pairs, strict=True)
    ]
    off_m = np.linalg.norm(np.array(ends)[:, :3] - known.positions[answer.pairs[:, 1]], axis=1)
    assert np.median(off_m) < 0.03
    assert set(answer.part_of_pairs.tolist()) == {0, 1}


def test_of_a_row_in_one_piece_all_lies_by_one_pose() -> None:
    query = seen(1, is_torn=False)[0]
    answer = match(query, seen(0, is_torn=False)[0])
    assert answer.n_parts == 1
    assert not answer.part_of_pairs.any()
    laid = laid_in_parts(answer, query)
    assert np.array_equal(laid.positions, query.transformed(answer.map_from_query).positions)


def young_trees(seed: int) -> list[np.ndarray]:
    """Two visits to eight trees of a dozen to two dozen fruits, 2.5 m apart, each of which leans by a centimetre."""
    rng = np.random.default_rng(seed)
    crowns = [rng.normal([2.5 * tree, 0, 1.5], [0.2, 0.2, 0.32], (rng.integers(12, 25), 3)) for tree in range(8)]
    rng = np.random.default_rng([seed, 1])
    fruits = np.vstack(crowns)
    visits = []
    for leans_m in (0.0, 0.012):
        seen = fruits[rng.random(len(fruits)) > 0.3]
        tree = np.clip(np.round(seen[:, 0] / 2.5).astype(int), 0, 7)
        visits.append(seen + rng.normal(0, 0.014, seen.shape) + rng.normal(0, leans_m, (8, 3))[tree])
    return visits


@pytest.mark.parametrize("seed", [35, 50, 61, 67])
def test_trees_that_stand_apart_and_hardly_moved_are_one_part(seed: int) -> None:
    """The tree that is found first has enough evidence alone; the others are found beyond gaps, or on their own."""
    first, second = young_trees(seed)
    answer = match(second, first)
    assert answer.n_parts == 1
    np.testing.assert_allclose(answer.map_from_query, np.eye(4), atol=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_a_branch_that_was_tied_elsewhere_is_a_part_amid_the_row(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = rng.uniform([0.0, -0.5, 0.0], [10.0, 0.5, 2.0], (400, 3))
    moved = abs(places[:, 0] - 5.0) < 0.5
    visits = [places + rng.normal(0, 0.01, places.shape) for _ in range(2)]
    visits[0][moved] += [0.5, 0.2, 0.2]
    shown = [np.flatnonzero(rng.random(len(places)) < 0.9) for _ in range(2)]
    answer = match(*(FruitCloud(visit[rows]) for visit, rows in zip(visits, shown, strict=True)))
    right = {shown[0][i] for i, j in answer.pairs if shown[0][i] == shown[1][j]}
    common = np.intersect1d(*shown)
    assert answer.n_parts == 2
    assert np.mean([fruit in right for fruit in common[moved[common]]]) > 0.9


def test_what_was_not_found_lies_nowhere() -> None:
    query = seen(1, is_torn=False)[0]
    answer = match(query, scene_pair("base", seed=4).map)
    assert answer.parts == ()
    with pytest.raises(PomonaError, match="found NoMatch, expected one that lays the query on the map"):
        laid_in_parts(answer, query)
    answer = match(query, seen(0, is_torn=False)[0])
    with pytest.raises(PomonaError, match=r"query: found 4 fruits, expected the \d+ of the match"):
        laid_in_parts(answer, query.select(range(4)))


def test_covariances_turn_with_their_part() -> None:
    query, behind = seen(1, is_torn=True)
    long = np.diag([9e-4, 1e-4, 1e-4])
    torn = TEAR[:3, :3] @ long @ TEAR[:3, :3].T
    query = replace(query, covariances=np.where(behind[:, None, None], torn, long))
    laid = laid_in_parts(match(query, seen(0, is_torn=False)[0]), query)
    assert laid.covariances is not None
    off = np.abs(laid.covariances - long).max(axis=(1, 2))
    assert np.quantile(off, 0.95) < 5e-5


def test_cameras_go_with_the_fruits_next_to_them(found) -> None:
    query, behind, answer = found
    # A camera 1.5 m before each tenth fruit, in whichever part.
    aside = np.array([0.0, 1.5, 0.0])
    poses = np.tile(np.eye(4), (len(query), 1, 1))[::10]
    poses[:, :3, 3] = query.positions[::10] + np.where(behind[:, None], TEAR[:3, :3] @ aside, aside)[::10]
    way = Trajectory(np.arange(len(poses)), np.arange(len(poses)) / 10.0, poses)
    whole = mended(Session("a", "2024-06-01", "test", query, way), answer)
    assert whole.trajectory is not None
    after = whole.trajectory.session_from_camera[:, :3, 3] - whole.cloud.positions[::10]
    assert np.quantile(np.abs(np.linalg.norm(after, axis=1) - 1.5), 0.9) < 0.01
    # As in the row they now all look from one side.
    assert np.quantile(np.linalg.norm(after - np.median(after, axis=0), axis=1), 0.8) < 0.1
    noted = whole.configuration["mended"]
    assert noted["parts"] == 2
    (tear,) = noted["tears"]
    is_tear = [np.allclose(tear, motion, atol=0.1) for motion in (TEAR, np.linalg.inv(TEAR))]
    assert any(is_tear)


def test_a_second_visit_tells_that_it_is_the_map_that_is_torn(tmp_path: Path) -> None:
    path = tmp_path / "row.gpkg"
    told = [add_session(path, visit(number, is_torn=number == 0)) for number in range(3)]
    assert [len(added.torn_near) for added in told] == [0, 1, 1]
    assert [added.torn_like for added in told] == [None, None, "1"]


def test_a_torn_visit_does_not_make_the_map_torn(tmp_path: Path) -> None:
    path = tmp_path / "row.gpkg"
    told = [add_session(path, visit(number, is_torn=number == 1)) for number in range(3)]
    assert [(len(added.torn_near), added.torn_like) for added in told] == [(0, None), (1, None), (0, None)]


def test_the_tear_is_where_the_parts_meet(tmp_path: Path) -> None:
    path = tmp_path / "row.gpkg"
    add_session(path, visit(0, is_torn=False))
    (near,) = add_session(path, visit(1, is_torn=True)).torn_near
    fruits = OrchardMap(path).fruits()
    assert fruits.ids is not None
    place = fruits.positions[fruits.ids.index(near)]
    assert abs((place - ROW.positions.mean(axis=0)) @ ALONG) < 0.3


@pytest.mark.parametrize("torn", [(False, True, False), (True, False, False), (True, True, False)])
def test_a_torn_visit_lies_in_the_map_part_by_part(tmp_path: Path, torn: tuple[bool, ...]) -> None:
    path = tmp_path / "row.gpkg"
    visits = [visit(number, is_torn=is_torn) for number, is_torn in enumerate(torn)]
    for one in visits:
        assert add_session(path, one).is_added
    assert problems(path) == []
    several = [sights for sights in who_is_who(path) if len(sights) > 1]
    of_all = [set(one.cloud.ids) for one in visits]
    common = len({fruit for fruit in ROW.ids if sum(fruit in ids for ids in of_all) > 1})
    assert len(several) < 0.04 * common  # who_is_who goes by names, and one fruit has one name
    sights: dict[int, list[str]] = {}
    seen_there = OrchardMap(path).observations()
    for fruit, label in zip(seen_there.fruit_ids.tolist(), seen_there.labels, strict=True):
        sights.setdefault(fruit, []).append(str(label))
    again = sum(len(labels) > 1 and len(set(labels)) == 1 for labels in sights.values())
    assert again > 0.95 * common


def test_a_mended_visit_is_known_by_what_it_saw(tmp_path: Path) -> None:
    path = tmp_path / "row.gpkg"
    add_session(path, visit(0, is_torn=False))
    torn = visit(1, is_torn=True)
    assert add_session(path, torn).match.n_parts == 2
    with snapshot(path) as (connection, _):
        assert holds(connection, torn)
    assert add_session(path, torn, replacing=True).was_there
    with pytest.raises(PomonaError, match="is in the map already"):
        add_session(path, replace(torn, name="again"))
