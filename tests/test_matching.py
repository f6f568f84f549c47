"""`pomona.match` and `pomona.Index`: what both methods must keep to."""

from pathlib import Path

import numpy as np
import pytest
from benchmarks.pose import pose_error
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import pomona
from pomona import FruitCloud
from pomona.evaluate import score_pairs
from pomona.matching import Match
from pomona.synth.clouds import scene_pair

TESTDATA = Path(__file__).parents[1] / "testdata"
METHODS = ["paper", "verified"]
TURN = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix()
SHIFT = np.array([3.0, -1.0, 0.5])
UP = (0.0, 0.0, 1.0)


def row(n: int = 120, seed: int = 0) -> NDArray[np.float64]:
    """Fruits of two trees, no two nearer than 7 cm."""
    random = np.random.default_rng(seed)
    fruits: list[NDArray[np.float64]] = []
    while len(fruits) < n:
        fruit = random.uniform([0.0, -0.5, 0.5], [2.4, 0.5, 3.0])
        if all(np.linalg.norm(fruit - other) > 0.07 for other in fruits):
            fruits.append(fruit)
    return np.array(fruits)


def as_tuple(match: Match) -> tuple[object, ...]:
    assert match.map_from_query is not None
    return match.status, match.map_from_query.tolist(), match.pairs.tolist(), match.probabilities.tolist()


def test_rows_that_lie_on_each_other_by_chance_are_no_answer() -> None:
    """Two rows without a common fruit."""
    query, map = (FruitCloud.read(TESTDATA / f"matching/outline_of_strangers_{name}.csv") for name in ("query", "map"))
    match = pomona.match(query, map, up=UP)
    assert match.status == "NoMatch"
    assert match.map_from_query is None


def test_which_pairs_are_reported_does_not_decide_what_is_found() -> None:
    fruits = row()
    noisy = fruits + np.random.default_rng(1).normal(0.0, 0.01, fruits.shape)
    all_pairs, none = (
        pomona.match(noisy, fruits, config={"verified": {"min_probability": least}}) for least in (0.25, 1.0)
    )
    assert (none.status, len(none.pairs)) == ("Found", 0)
    assert len(all_pairs.pairs) > 0
    np.testing.assert_array_equal(none.map_from_query, all_pairs.map_from_query)


@pytest.mark.parametrize("seed", [32, 34, 112, 169, 200, 214, 264, 272])
def test_a_thin_wall_of_single_fruits_is_not_found_in_another(seed: int) -> None:
    """Fruits 3 cm deep on five wires, 9 cm apart at least: a wrong pose lays them on others anywhere along the row."""
    draw = np.random.default_rng([seed, 5])

    def wall() -> NDArray[np.float64]:
        x_m = np.cumsum(0.09 + draw.exponential(0.09, (5, 28)), axis=1)
        heights_m = 0.6 + 0.45 * np.arange(5)[:, None] + draw.normal(-0.04, 0.025, x_m.shape)
        places = np.stack([x_m, draw.normal(0, 0.015, x_m.shape), heights_m], axis=-1).reshape(-1, 3)
        return places[draw.random(len(places)) < 0.75]

    match = pomona.match(wall(), wall())
    assert match.status == "NoMatch"


@pytest.mark.parametrize("seed", [11, 72])
def test_a_frame_that_stands_out_of_all_other_poses_is_found(seed: int) -> None:
    pair = scene_pair("frame25", seed)
    match = pomona.match(pair.query, pair.map)
    assert match.status == "Found"
    assert match.map_from_query is not None
    error_m = (match.map_from_query - pair.map_from_query) @ [*pair.query.positions.mean(axis=0), 1.0]
    assert np.linalg.norm(error_m) < 0.05
    stages = dict(match.stages)
    # The threshold for clouds of this size is 42 nats; here the second pose says what chance reaches.
    assert stages["threshold_nats"] < stages["best_nats"] < 42.0


def test_a_frame_is_found_among_a_thousand_trees() -> None:
    """Shapes that five trees show rarely are common in so large a map, and all that there is to go by."""
    pair = scene_pair("frame40-trees1000", 10)
    match = pomona.match(pair.query, pair.map)
    assert match.status == "Found"
    assert match.map_from_query is not None
    error_m = (match.map_from_query - pair.map_from_query) @ [*pair.query.positions.mean(axis=0), 1.0]
    assert np.linalg.norm(error_m) < 0.05


def dozen(seed: int) -> list[FruitCloud]:
    """Two visits to twelve fruits of a flat tree: ten of them each and a false one, 2 cm of noise."""
    random = np.random.default_rng(seed)
    low, high = (-0.5, -0.4, 0.0), (0.5, 0.4, 0.12)
    tree = random.uniform(low, high, (12, 3))
    visits = []
    for side, turn in (("q", TURN), ("m", np.eye(3))):
        kept = random.permutation(12)[:10]
        fruits = np.r_[tree[kept] + random.normal(0.0, 0.02, (10, 3)), random.uniform(low, high, (1, 3))]
        visits.append(FruitCloud(fruits @ turn.T, ids=(*map(str, kept), side)))
    return visits


@pytest.mark.parametrize("seed", [0, 3])
def test_opposite_sides_with_one_fruit_in_seven_in_common_are_found(seed: int) -> None:
    """Of four neighbours hardly ever all are seen from both sides."""
    pair = scene_pair("opposite15", seed)
    match = pomona.match(pair.query, pair.map)
    assert match.status == "Found"
    assert match.map_from_query is not None
    assert pose_error(match.map_from_query, pair.map_from_query, pair.query.positions).success


def test_what_seeds_find_in_part_is_found_in_full_from_the_other_side_too() -> None:
    """What seeds found ended with the trees that they began with, 16 of 47 fruits."""
    pair = scene_pair("opposite15fine", 3)
    match = pomona.match(pair.query, pair.map)
    assert score_pairs(match.pairs.tolist(), pair.query.ids or (), pair.map.ids or ()).recall > 0.9


def test_a_branch_that_sank_is_followed_to_its_tip() -> None:
    """20 cm at the tips: the means of neighbours, which hang nearer the stem, fall short there."""
    pairs = [scene_pair("sag20", seed) for seed in range(3)]
    matches = [pomona.match(pair.query, pair.map) for pair in pairs]
    scores = [
        score_pairs(match.pairs.tolist(), pair.query.ids or (), pair.map.ids or ())
        for match, pair in zip(matches, pairs, strict=True)
    ]
    # With the means of neighbours it is 0.834.
    assert np.mean([score.recall for score in scores]) > 0.842


@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_a_noise_that_is_told_wrongly_costs_hardly_anything(factor: float) -> None:
    pair = scene_pair("part45", 0)
    told = [pomona.match(pair.query, pair.map, noise_m=noise_m) for noise_m in (None, factor * pair.noise_m)]
    alone, wrong = (score_pairs(one.pairs.tolist(), pair.query.ids or (), pair.map.ids or ()) for one in told)
    assert wrong.recall > alone.recall - 0.03
    assert wrong.precision > alone.precision - 0.03
    assert told[1].noise_m == pytest.approx(told[0].noise_m, rel=0.15)


def test_a_dozen_fruits_are_found_as_often_as_they_can_be_told() -> None:
    """Few fruits lie flat by chance; so do the best wrong poses, which share fruits with the right one."""
    answered = 0
    for query, map in (dozen(seed) for seed in range(40)):
        match = pomona.match(query, map)
        if match.status == "Found":
            answered += 1
            right = sum(query.ids[i] == map.ids[j] for i, j in match.pairs)
            assert 2 * right > len(match.pairs)
    assert answered >= 17


def test_the_false_alarm_rate_is_the_share_of_unrelated_frames_that_are_answered() -> None:
    pairs = [scene_pair("frame25-noov", seed) for seed in range(24)]

    def answered(rate: float) -> int:
        config = {"verified": {"false_alarm_rate": rate}}
        return sum(pomona.match(pair.query, pair.map, config=config).status == "Found" for pair in pairs)

    assert answered(3e-4) == 0
    assert 7 <= answered(0.5) <= 17


@pytest.mark.parametrize("seed", [9, 24, 53, 64, 99])
def test_rows_on_wires_without_a_common_fruit_are_no_match(seed: int) -> None:
    pair = scene_pair("trellis-noovup", seed)
    assert pomona.match(pair.query, pair.map, up=UP).status == "NoMatch"


def spurs(seed: int) -> NDArray[np.float64]:
    """Fruits on a quarter of the spurs, 15 cm apart, of five wires, and five more elsewhere."""
    random = np.random.default_rng(seed)
    places = np.array([(x, 0.0, z) for x in np.arange(0.0, 8.0, 0.15) for z in 0.6 + 0.4 * np.arange(5)])
    taken = places[random.random(len(places)) < 0.25]
    elsewhere = random.uniform((0.0, -0.1, 0.5), (8.0, 0.1, 2.3), (5, 3))
    return np.vstack([taken + random.normal(0.0, 0.03, taken.shape), elsewhere])


def test_a_mirrored_row_of_which_a_part_fits_is_not_found() -> None:
    pair = scene_pair("mirror", 84)
    match = pomona.match(pair.query, pair.map)
    assert match.status == "NoMatch"
    # A part of a crown lies on another: the mirror image has more evidence.
    assert dict(match.stages)["mirrored"] == 1.0


@pytest.mark.parametrize(("clips", "seed"), [(10, 27), (12, 16), (16, 16), (16, 35), (20, 19)])
def test_things_at_equal_steps_on_a_line_are_no_answer(clips: int, seed: int) -> None:
    """Unrelated walls of 150 fruits; both visits took the clips of a wire, half a metre apart, for fruits too."""
    rng = np.random.default_rng([seed, clips])
    visits = []
    for _ in range(2):
        fruits = np.column_stack(
            [rng.uniform(0, 0.5 * clips, 150), 0.25 * rng.normal(size=150), rng.uniform(0.5, 2.5, 150)]
        )
        rng.random(clips)  # an outsider's draw of the clips that are seen: all; its seeds were answered wrongly
        along = 0.5 * np.arange(clips) + rng.uniform(0, 0.5)
        line = np.column_stack([along, np.zeros(clips), np.full(clips, 0.4)]) + 0.01 * rng.normal(size=(clips, 3))
        visits.append(np.vstack([fruits, line]))
    assert pomona.match(*visits).status == "NoMatch"


@pytest.mark.parametrize("seed", [5, 12, 14])
def test_a_planting_that_meets_itself_everywhere_is_not_found(seed: int) -> None:
    """Two rows without a common fruit: each step from spur to spur is as good as the next."""
    match = pomona.match(spurs(2 * seed), spurs(2 * seed + 1), up=UP)
    assert match.status in ("NoMatch", "Ambiguous")


def shells(seed: int) -> NDArray[np.float64]:
    """Three in four fruits of four round crowns of citrus, which bear in the outermost 17 cm."""
    random = np.random.default_rng(seed)
    outwards = random.normal(size=(800, 3))
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    middles = np.repeat(3.5 * np.arange(4), 200)[:, None] * [1.0, 0.0, 0.0]
    fruits = middles + 1.4 * outwards * random.uniform(0.88, 1.0, (800, 1))
    return fruits[random.random(800) > 0.25] + random.normal(0.0, 0.01, 3)


@pytest.mark.parametrize("seed", [5, 16, 23])
def test_crowns_that_bear_on_their_outside_are_not_found_in_others(seed: int) -> None:
    """A curved sheet that is turned lies on itself, and strangers are as dense there as the sheet is thin."""
    assert pomona.match(shells(2 * seed), shells(2 * seed + 1), up=UP).status == "NoMatch"


@pytest.mark.parametrize("method", METHODS)
def test_a_moved_copy_is_found(method: str) -> None:
    fruits = row()
    match = pomona.match(fruits[::-1], fruits @ TURN.T + SHIFT, method=method)
    assert match.status == "Found"
    np.testing.assert_allclose(match.map_from_query[:3, :3], TURN, atol=1e-6)
    np.testing.assert_allclose(match.map_from_query[:3, 3], SHIFT, atol=1e-6)
    np.testing.assert_array_equal(match.pairs.sum(axis=1), len(fruits) - 1)
    assert len(match.pairs) == match.n_query == match.n_map == len(fruits)


@pytest.mark.parametrize("method", METHODS)
def test_threads_and_an_index_change_nothing(method: str) -> None:
    fruits = row()
    query = fruits[10:] + np.random.default_rng(1).normal(0.0, 0.01, (110, 3))
    alone = as_tuple(pomona.match(query, fruits, method=method, threads=1))
    assert as_tuple(pomona.match(query, fruits, method=method, threads=4)) == alone
    assert as_tuple(pomona.Index(fruits, method=method).match(query)) == alone


@pytest.mark.parametrize("method", METHODS)
def test_strangers_are_no_match(method: str) -> None:
    match = pomona.match(row(seed=1), row(seed=2), method=method)
    assert match.status == "NoMatch"
    assert match.map_from_query is None
    assert match.pairs.shape == (0, 2)


def test_votes_support_the_papers_pairs() -> None:
    fruits = row()
    match = pomona.match(fruits, fruits, method="paper")
    assert match.support.min() >= 1.0
    assert dict(match.stages)["assigned pairs"] == len(fruits)


def test_frames_get_their_own_transforms() -> None:
    fruits = row(200)
    order = np.argsort(fruits[:, 0])
    windows = [order[start : start + 60] for start in range(0, 141, 20)]
    views = pomona.Views(frames=np.repeat(np.arange(len(windows)), 60), fruits=np.concatenate(windows))
    query = pomona.FruitCloud(positions=fruits, views=views)
    match = pomona.match(query, fruits @ TURN.T, method="paper", per_frame=True)
    assert match.status == "Found"
    assert dict(match.stages)["views"] == len(windows)
    np.testing.assert_array_equal(match.pairs[:, 0], match.pairs[:, 1])
    assert len(match.pairs) == len(fruits)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"per_frame": True}, "the query does not know which frame saw which fruit"),
        ({"noise_m": -1.0}, "^noise_m: found -1"),
        ({"config": {"paper": {"inlier_mm": 80}}}, "inlier_mm"),
        ({"config": {"constellation": {"k": 8}}}, "constellation.k: found 8, expected 4 to 7"),
        ({"scale": "feet"}, "^scale: found 'feet', expected 'metric' or 'free'"),
        ({"up": [[0, 0, 0], [0, 0, 1]]}, "^up: expected a finite vector"),
    ],
)
def test_wrong_settings_are_named(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(pomona.PomonaError, match=message):
        pomona.match(row(), row(), method="paper", **arguments)


@pytest.mark.parametrize("which", ["query", "map"])
def test_clouds_that_cannot_be_in_metres_are_told_of(which: str) -> None:
    clouds = {"query": row(), "map": row()} | {which: 1000 * row()}
    with pytest.warns(pomona.PomonaWarning, match=rf"^{which}: neighbouring fruits are .* m apart .* scale='free'"):
        assert not pomona.match(**clouds)
    assert pomona.match(**clouds, scale="free")  # a warning would fail here
    made = {name: FruitCloud(positions=cloud) for name, cloud in clouds.items()}
    with pytest.warns(pomona.PomonaWarning, match=rf"^{which}: neighbouring fruits are "):
        assert not pomona.match(**made)
    assert not pomona.match(**made)  # told once


def test_clouds_that_are_found_are_looked_at_too() -> None:
    with pytest.warns(pomona.PomonaWarning, match="m apart") as told:
        assert pomona.match(1000 * row(), 1000 * row())
    assert [str(one.message).split(":")[0] for one in told] == ["query", "map"]
    # A localiser or a loop over frames asks an index, which looks at arrays where it finds nothing.
    assert pomona.Index(1000 * row()).match(1000 * row())


def test_a_cloud_that_holds_every_fruit_twice_is_told_of() -> None:
    with pytest.warns(
        pomona.PomonaWarning, match=r"^query: \d+ of \d+ fruits lie where another one does, .* each once$"
    ):
        assert pomona.match(np.concatenate([row(), row()]), row())


@pytest.mark.parametrize("turned", [False, True])
def test_coordinates_in_steps_as_coarse_as_the_spacing_are_told_of(turned: bool, tmp_path: Path) -> None:
    """Those of UTM in 32 bits, be the row along the northing or across."""
    utm = row()[:, [1, 0, 2] if turned else [0, 1, 2]] + [512_345.0, 5_312_345.0, 420.0]
    coarse = utm.astype(np.float32)
    with pytest.warns(pomona.PomonaWarning, match="^query: y goes in steps of 0.5 m, where neighbouring fruits are"):
        pomona.match(coarse, utm)
    FruitCloud(coarse).write(tmp_path / "coarse.csv")
    with pytest.warns(pomona.PomonaWarning, match="coarse.csv: y goes in steps of 0.5 m"):
        FruitCloud.read(tmp_path / "coarse.csv")
    # Heights of wires, and what is rounded to centimetres, are as they should be.
    on_wires = np.column_stack([utm[:, :2], np.round(utm[:, 2])])
    assert pomona.match(np.round(utm, 2), utm)
    FruitCloud(on_wires).write(tmp_path / "wires.csv")
    FruitCloud.read(tmp_path / "wires.csv")


def test_no_cloud_is_named_as_none() -> None:
    with pytest.raises(pomona.PomonaError, match=r"^query: found None, expected fruits"):
        pomona.match(None, row())  # type: ignore[arg-type]


def test_more_fruits_than_the_paper_can_hold_are_refused() -> None:
    lattice = np.stack(np.meshgrid(np.arange(1000.0), np.arange(2000.0), [0.0]), axis=-1).reshape(-1, 3)
    lattice[:, :2] += 1e-4 * lattice[:, 1::-1]
    with pytest.raises(pomona.PomonaError, match="2000000 fruits of the map give up to 420000000 constellations"):
        pomona.match(row(), lattice, method="paper")


def test_a_pose_that_was_written_with_four_decimals_goes_back_in() -> None:
    query = row()
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = TURN, SHIFT
    found = pomona.Index(query @ TURN.T + SHIFT).pairs_under(query, np.round(pose, 4))
    assert found.pairs.tolist() == [[fruit, fruit] for fruit in range(len(query))]
    sheared = pose.copy()
    sheared[0, 1] += 0.02
    with pytest.raises(pomona.PomonaError, match="sheared"):
        pomona.Index(query).pairs_under(query, sheared)
