"""The seeded generator: what its cells promise."""

import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from command_line import assert_refused
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.synth.clouds import CELLS, ScenePair, scene_pair
from pomona.synth.disturbances import bent, left_after_picking, left_after_thinning, merged, split, torn
from pomona.synth.named_cells import ROWS
from pomona.synth.planting import RowShape, grow_row
from pomona.synth.scenes import draw_scene


def common(pair: ScenePair) -> tuple[np.ndarray, np.ndarray]:
    row_in_map = {name: row for row, name in enumerate(pair.map.ids)}
    rows = [(row, row_in_map[name]) for row, name in enumerate(pair.query.ids) if name in row_in_map]
    return np.array(rows, dtype=int).reshape(-1, 2).T


def residuals(pair: ScenePair) -> np.ndarray:
    query, map_ = common(pair)
    in_map = pair.query.positions[query] @ pair.map_from_query[:3, :3].T + pair.map_from_query[:3, 3]
    return in_map - pair.map.positions[map_]


@pytest.mark.parametrize("name", [name for name, cell in CELLS.items() if cell.seen <= 48])
def test_the_same_seed_draws_the_same_pair(name: str) -> None:
    first, again = scene_pair(name, 5), scene_pair(name, 5)
    for side in ("query", "map"):
        one, two = getattr(first, side), getattr(again, side)
        assert one.ids == two.ids
        np.testing.assert_array_equal(one.positions, two.positions)
    assert first.map_from_query.tolist() == again.map_from_query.tolist()


def test_another_seed_and_another_cell_draw_other_pairs() -> None:
    poses = [scene_pair(name, seed).map_from_query.tolist() for name, seed in (("six", 0), ("six", 1), ("grid", 0))]
    assert poses[0] != poses[1]
    assert poses[0] != poses[2]


@pytest.mark.parametrize("name", ["base", "o45s4", "o45s8", "part1", "sim3", "big5k", "plane", "mirror", "wall"])
def test_common_fruits_lie_on_each_other_but_for_the_noise(name: str) -> None:
    errors = np.concatenate([residuals(scene_pair(name, seed)) for seed in range(3)])
    expected = CELLS[name].noise_m
    assert errors.std() == pytest.approx(expected, rel=4.0 / np.sqrt(2 * errors.size))
    assert np.abs(errors.mean(axis=0)).max() < 4.5 * expected / np.sqrt(len(errors))


def test_sag_moves_common_fruits_down_and_only_in_its_cell() -> None:
    up_in_map = []
    for seed in range(4):
        pair = scene_pair("sag8", seed)
        shift = residuals(pair)
        # The mean shift points down; its length is near 0.65 x 8 cm x E[t^2].
        mean = shift.mean(axis=0)
        up_in_map.append(np.linalg.norm(mean))
        assert shift.std(axis=0).max() > 0.022
    assert 0.010 < np.mean(up_in_map) < 0.035


@pytest.mark.parametrize(("name", "trees"), [("base", 5), ("part45", 2), ("part1", 1), ("noov", 0), ("wide-noov", 0)])
def test_visits_share_the_fruits_of_the_trees_they_share(name: str, trees: int) -> None:
    cell = CELLS[name]
    shared = [common(scene_pair(name, seed)).shape[1] for seed in range(6)]
    expected = trees * 105 * (1 - cell.hidden) ** 2
    assert np.mean(shared) == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("name", ["base", "o45s4", "big5k"])
def test_a_visit_misses_fruits_and_adds_false_ones_at_the_stated_rates(name: str) -> None:
    cell = CELLS[name]
    pair = scene_pair(name, 1)
    false = sum(not fruit.startswith("f") for fruit in pair.query.ids)
    seen = len(pair.query) - false
    assert false == round(cell.false_rate * seen)
    assert seen == pytest.approx(cell.seen * 105 * (1 - cell.hidden), rel=0.35)
    assert all(fruit[0] in "fq" for fruit in pair.query.ids)
    assert all(fruit[0] in "fm" for fruit in pair.map.ids)


def test_neither_order_nor_ids_tell_where_a_fruit_hangs() -> None:
    pair = scene_pair("big5k", 0)
    query, map_ = common(pair)
    along_row = pair.map.positions[map_] @ np.linalg.svd(pair.map.positions - pair.map.positions.mean(0))[2][0]
    numbers = np.array([int(pair.map.ids[row][1:]) for row in map_])
    limit = 4.5 / np.sqrt(len(query))
    for order in (query, map_, numbers):
        assert abs(np.corrcoef(order, along_row)[0, 1]) < limit
    assert abs(np.corrcoef(query, map_)[0, 1]) < limit


def test_fruits_hang_in_clusters_and_keep_their_distance() -> None:
    row = grow_row(np.random.default_rng(0), 12)
    nearest = cKDTree(row.positions).query(row.positions, k=2)[0][:, 1]
    assert nearest.min() >= 0.068
    # Clusters hold 2 fruits on average and 40 % of them only one: 80 % of the fruits hang in company, some by chance.
    assert 0.78 < (nearest < 0.10).mean() < 0.92
    counts = np.bincount(row.tree)
    assert counts.min() >= 60
    assert counts.max() <= 150
    # Branches start at 0.5-3.2 m and rise by up to 0.3 m; clusters scatter by 8-10 cm.
    assert row.positions[:, 2].min() > 0.0
    assert row.positions[:, 2].max() < 4.0


@pytest.mark.parametrize("name", ROWS)
def test_other_rows_have_the_statistics_they_are_named_for(name: str) -> None:
    shape: RowShape = ROWS[name]
    row = grow_row(np.random.default_rng(1), 4, shape)
    counts = np.bincount(row.tree)
    assert counts.min() >= shape.fruits_per_tree[0]
    assert counts.max() <= shape.fruits_per_tree[1]
    nearest = cKDTree(row.positions).query(row.positions, k=2)[0][:, 1]
    assert nearest.min() >= shape.least_gap_m
    if name == "single":
        assert (nearest < 0.10).mean() < 0.5
    if name == "wall":
        assert row.positions[:, 1].std() < 0.08


def test_a_v_trellis_has_two_walls_that_lean_apart() -> None:
    shape = CELLS["vtrellis-noov"].row
    row = grow_row(np.random.default_rng(3), 6, shape)
    wall_m = shape.reach_depth_m / 2 + np.tan(shape.lean_rad) * row.positions[:, 2]
    across_m = row.positions[:, 1]
    assert np.quantile(np.abs(np.abs(across_m) - wall_m), 0.95) < 0.2
    assert 0.3 < (across_m > 0).mean() < 0.7


def test_a_cone_is_narrower_above_and_bears_in_tiers() -> None:
    shape = CELLS["cone-noov"].row
    row = grow_row(np.random.default_rng(3), 30, shape)
    away_m = np.linalg.norm(row.positions[:, :2] - np.outer(row.tree * shape.spacing_m, [1.0, 0.0]), axis=1)
    height_m = row.positions[:, 2]
    assert away_m[height_m > 2.0].mean() < 0.7 * away_m[height_m < 1.0].mean()
    from_tier_m = np.abs(height_m[:, None] - shape.wires_m).min(axis=1)
    assert np.median(from_tier_m) < 0.06 < 0.35 / 4


def test_a_free_scale_turns_the_query_into_other_units() -> None:
    scales = [scene_pair("sim3", seed).scale for seed in range(20)]
    assert 0.5 <= min(scales) < 0.8
    assert 1.3 < max(scales) <= 2.0
    pair = scene_pair("sim3", 0)
    assert np.cbrt(np.linalg.det(pair.map_from_query[:3, :3])) == pytest.approx(pair.scale, rel=1e-12)


def test_upright_visits_are_turned_about_the_vertical_and_else_the_same() -> None:
    upright, turned = scene_pair("part1o45up", 2), scene_pair("part1o45", 2)
    np.testing.assert_allclose(upright.map_from_query[:3, :3] @ upright.up, upright.up, atol=1e-12)
    assert turned.up is None
    assert upright.query.ids == turned.query.ids
    np.testing.assert_allclose(residuals(upright).std(), residuals(turned).std(), rtol=0.2)


def test_sizes_are_those_of_the_same_fruits_after_a_common_growth() -> None:
    pair, blind = scene_pair("o45s4size", 0), scene_pair("o45s4", 0)
    np.testing.assert_array_equal(pair.query.positions, blind.query.positions)
    assert blind.query.diameters_m is None
    query, map_ = common(pair)
    growth = pair.query.diameters_m[query] - pair.map.diameters_m[map_]
    assert growth.mean() == pytest.approx(0.012, abs=0.001)
    assert growth.std() == pytest.approx(0.002 * np.sqrt(2), rel=0.3)
    assert pair.map.diameters_m.std() == pytest.approx(0.006, rel=0.3)


def test_a_mirrored_query_is_no_rotation_away() -> None:
    assert np.linalg.det(scene_pair("mirror", 0).map_from_query[:3, :3]) == pytest.approx(-1.0)
    assert np.linalg.det(scene_pair("base", 0).map_from_query[:3, :3]) == pytest.approx(1.0)


def test_a_twin_stands_two_trees_from_its_original() -> None:
    pair = scene_pair("twins", 0)
    in_map = pair.query.positions @ pair.map_from_query[:3, :3].T + pair.map_from_query[:3, 3]
    tree = cKDTree(pair.map.positions)
    axis = np.linalg.svd(pair.map.positions - pair.map.positions.mean(axis=0))[2][0]
    hits = {shift: (tree.query(in_map + shift * axis)[0] < 0.06).mean() for shift in (-2.4, -1.2, 0.0, 1.2, 2.4)}
    twin = max(hits[-2.4], hits[2.4])
    assert twin > 2.5 * max(hits[-1.2], hits[1.2])
    assert hits[0.0] > 0.5


def test_an_unknown_cell_is_told_with_the_ones_there_are() -> None:
    with pytest.raises(PomonaError, match=rf"'bsae'; expected one of {len(CELLS)}, as base(, \w+){{0,4}}$"):
        scene_pair("bsae", 0)
    with pytest.raises(PomonaError, match=rf"'orange'; expected one of {len(CELLS)}, as "):
        scene_pair("orange", 0)
    with pytest.raises(PomonaError, match="negative"):
        scene_pair("base", -1)


def test_the_command_writes_what_scene_pair_draws(tmp_path, run_here) -> None:
    assert run_here("synth", "clouds", "part45", "--seed", 3, "-o", tmp_path / "one").returncode == 0
    pair = scene_pair("part45", 3)
    truth = json.loads((tmp_path / "one" / "truth.json").read_text())
    np.testing.assert_allclose(truth["map_from_query"], pair.map_from_query)
    query = FruitCloud.read(tmp_path / "one" / "query.csv")
    assert query.ids == pair.query.ids
    np.testing.assert_allclose(query.positions, pair.query.positions, atol=1e-6)

    assert run_here("synth", "clouds", "six", "--seeds", "4:6", "-o", tmp_path / "many").returncode == 0
    assert sorted(path.name for path in (tmp_path / "many").iterdir()) == sorted(
        f"{side}_{seed}{suffix}"
        for side, suffix in (("query", ".csv"), ("map", ".csv"), ("truth", ".json"))
        for seed in (4, 5)
    )


def test_the_command_refuses_an_empty_range_of_seeds(tmp_path, run_here) -> None:
    done = run_here("synth", "clouds", "base", "--seeds", "6:6", "-o", tmp_path / "none")
    assert_refused(done, "'6:6', expected FIRST:END")
    assert not (tmp_path / "none").exists()


def shares_in_common(name: str) -> float:
    pairs = [scene_pair(name, seed) for seed in range(6)]
    seen = [sum(fruit[0] == "f" for fruit in cloud.ids) for pair in pairs for cloud in (pair.query, pair.map)]
    return sum(2 * common(pair).shape[1] for pair in pairs) / sum(seen)


@pytest.mark.parametrize(("name", "share"), [("opposite25", 0.25), ("opposite15", 0.15), ("opposite8", 0.08)])
def test_opposite_sides_have_that_share_of_fruits_in_common(name: str, share: float) -> None:
    assert shares_in_common(name) == pytest.approx(share, abs=0.025)


def test_noise_along_the_line_of_sight_is_larger_and_across_it_as_everywhere() -> None:
    errors = np.concatenate([residuals(scene_pair("opposite25", seed)) for seed in range(6)])
    pooled = [np.cov(residuals(scene_pair("opposite25", seed)).T) for seed in range(6)]
    spreads = np.sqrt(np.mean([np.linalg.eigvalsh(covariance) for covariance in pooled], axis=0))
    assert len(errors) > 200
    assert spreads[2] == pytest.approx(0.04, rel=0.15)
    assert spreads[:2] == pytest.approx(0.02, rel=0.2)


@pytest.mark.parametrize(("name", "left"), [("thinned30", 0.7), ("thinned70", 0.3)])
def test_thinning_takes_whole_clusters_of_the_second_visit(name: str, left: float) -> None:
    pairs = [scene_pair(name, seed) for seed in range(6)]
    assert sum(len(pair.query) for pair in pairs) / sum(len(pair.map) for pair in pairs) == pytest.approx(
        left, abs=0.06
    )
    row = grow_row(np.random.default_rng(2), 3)
    kept = left_after_thinning(np.random.default_rng(3), row, 1.0 - left)
    place = np.stack([row.branch, row.along_branch])
    _, cluster = np.unique(place, axis=1, return_inverse=True)
    of_each = [set(kept[cluster.ravel() == number]) for number in range(cluster.max() + 1)]
    assert all(len(fates) == 1 for fates in of_each)


def test_picking_takes_single_fruits_of_the_second_visit() -> None:
    pairs = [scene_pair("picked80", seed) for seed in range(6)]
    assert sum(len(pair.query) for pair in pairs) / sum(len(pair.map) for pair in pairs) == pytest.approx(0.2, abs=0.03)
    row = grow_row(np.random.default_rng(2), 3)
    kept = left_after_picking(np.random.default_rng(3), row, 0.5)
    _, cluster = np.unique(np.stack([row.branch, row.along_branch]), axis=1, return_inverse=True)
    whole = [kept[cluster.ravel() == number].mean() in (0.0, 1.0) for number in range(cluster.max() + 1)]
    assert np.mean(whole) < 0.8


@pytest.mark.parametrize(("name", "stands"), [("replanted50", 0.5), ("replanted80", 0.2)])
def test_trees_give_way_to_others_whole(name: str, stands: float) -> None:
    standing = []
    for seed in range(20):
        truth = draw_scene(np.random.default_rng(seed), CELLS[name])
        old = [truth.in_query[truth.in_map & (truth.row.tree == tree)] for tree in range(10)]
        new = [np.count_nonzero(truth.in_query & ~truth.in_map & (truth.row.tree == tree)) for tree in range(10)]
        assert all(left.all() != (left.sum() == 0) for left in old)
        assert [left.all() for left in old] == [others == 0 for others in new]
        assert any(left.all() for left in old)
        standing += [left.all() for left in old]
    assert np.mean(standing) == pytest.approx(stands, abs=0.1)


def test_a_row_is_torn_in_its_last_third() -> None:
    row = np.linspace([0.0, 0.0, 1.0], [9.0, 0.0, 1.0], 10)
    moved = torn(np.random.default_rng(0), row, 1.0) - row
    np.testing.assert_allclose(moved[:7], 0.0)
    steps = np.diff(moved[7:], axis=0)
    assert np.all(np.abs(np.linalg.norm(moved[7:], axis=1) - 1.0) < 0.6)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), 2.0 * np.sin(np.radians(5.0)), rtol=1e-6)


@pytest.mark.parametrize(("name", "drift"), [("drift1", 0.01), ("drift3", 0.03)])
def test_drift_moves_the_ends_of_the_row_by_that_share_of_its_half(name: str, drift: float) -> None:
    row = np.linspace([0.0, 0.0, 1.0], [8.0, 0.0, 1.0], 9)
    moved = bent(np.random.default_rng(0), row, drift) - row
    np.testing.assert_allclose(np.abs(moved[[0, -1]]), 4.0 * drift)
    np.testing.assert_allclose(moved[4], 0.0, atol=1e-12)
    assert residuals(scene_pair(name, 0)).std() > residuals(scene_pair("base", 0)).std()


def test_doubles_add_a_place_beside_a_fruit_and_take_two_for_one() -> None:
    places = np.array([[0.0, 0.0, 0.0], [0.08, 0.0, 0.0], [1.0, 0.0, 0.0]])
    left, moved = merged(np.random.default_rng(0), places, 1.0)
    assert left.sum() == 2
    np.testing.assert_allclose(moved[left], [[0.04, 0.0, 0.0], [1.0, 0.0, 0.0]])
    extra = split(np.random.default_rng(0), places, 1.0)
    away_m = cKDTree(places).query(extra)[0]
    assert len(extra) == 3
    assert ((away_m >= 0.03) & (away_m <= 0.05)).all()


@pytest.mark.parametrize("name", ["frame12", "frame25", "frame40"])
def test_a_frame_shows_so_many_neighbouring_fruits(name: str) -> None:
    pair = scene_pair(name, 1)
    fruits = pair.query.positions[[fruit[0] == "f" for fruit in pair.query.ids]]
    assert len(fruits) == CELLS[name].frame
    assert len(pair.map) > 200
    assert np.linalg.norm(fruits - fruits.mean(axis=0), axis=1).max() < 1.2


@pytest.mark.parametrize(("name", "factors"), [("grown175", (1.75, 1.75)), ("grownmixed", (1.5, 2.0))])
def test_fruits_grow_by_their_factors(name: str, factors: tuple[float, float]) -> None:
    pair = scene_pair(name, 0)
    query, map_ = common(pair)
    found = np.quantile(pair.query.diameters_m[query] / pair.map.diameters_m[map_], [0.05, 0.95])
    assert found == pytest.approx(factors, rel=0.08)
