"""Where the camera is in a map: poses, covariances that are honest, tracking, and what cannot be found."""

import copy
import gc
import pickle
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.localize_lies import Case, drive
from benchmarks.row_drive import Row, drawn_row, pose_at, seen_from, step_to
from scipy.spatial.transform import Rotation

from pomona import FruitCloud, Index, Localizer, PomonaError, PomonaWarning, Verdict

EMPTY = FruitCloud(positions=np.empty((0, 3)))


@pytest.fixture(scope="module")
def row() -> Row:
    return drawn_row(0)


@pytest.fixture(scope="module")
def localizer(row: Row) -> Localizer:
    return Localizer(row.map, threads=1)


@pytest.fixture
def fresh(localizer: Localizer) -> Localizer:
    localizer.reset()
    return localizer


def assert_near(found, true, within_m=0.05, within_deg=2.0):
    assert found.status is Verdict.FOUND
    step = step_to(found.map_from_camera, true)
    assert np.linalg.norm(step[:3]) < within_m
    assert np.degrees(np.linalg.norm(step[3:])) < within_deg


@pytest.mark.parametrize("x_m", [1.5, 4.0, 6.5])
def test_a_frame_is_found_from_nothing(row, localizer, x_m):
    true = pose_at(x_m, turn_deg=7.0)
    found = localizer.locate(seen_from(row, true, 1))
    assert_near(found, true)
    assert not found.tracked
    assert found.log_odds > 50
    assert np.linalg.eigvalsh(found.covariance).min() > 0
    assert len(found.pairs) > 20
    assert (found.probabilities > 0.25).all()
    assert all(len(set(rows)) == len(rows) for rows in found.pairs.T.tolist())


def test_pairs_are_the_fruits_that_were_seen(row, localizer):
    true = pose_at(4.0)
    seen = seen_from(row, true, 2, share=1.0)
    found = localizer.locate(seen)
    seen_in_map = seen.positions @ true[:3, :3].T + true[:3, 3]
    distances_m = np.linalg.norm(seen_in_map[found.pairs[:, 0]] - row.today[found.pairs[:, 1]], axis=1)
    assert (distances_m < 0.06).mean() > 0.97


@pytest.mark.parametrize(("all_m", "near_m"), [(0.008, 1e-6), (0.008, 0.004), (0.0, 0.008)])
def test_covariances_are_those_of_the_errors(all_m, near_m):
    """Squared errors under the own covariances are as chi^2 with 6 degrees: 6 on average, 5 % over 12.6.

    What all fruits share is told, `shared_m`; what neighbours share besides is found in the residuals.
    """
    squared = []
    for seed in range(12):
        row = drawn_row(seed, shared_m=near_m, all_m=all_m)
        localizer = Localizer(row.map, config={"localization": {"shared_m": max(all_m, 0.001)}}, threads=1)
        for number, x_m in enumerate((1.5, 4.0, 6.5)):
            true = pose_at(x_m, turn_deg=3.0)
            found = localizer.locate(seen_from(row, true, 100 * seed + number))
            assert found
            step = step_to(found.map_from_camera, true)
            squared.append(step @ np.linalg.solve(found.covariance, step))
    # The mean of 36 has a standard deviation of sqrt(12 / 36) = 0.58.
    assert 4.0 < np.mean(squared) < 8.0
    assert np.mean(np.array(squared) > 12.6) < 0.2


@pytest.mark.parametrize("told", [0.25, 9.0])
def test_how_far_sightings_err_is_seen_in_their_residuals(row, told):
    """Variances of sightings that are told several times too small or too large give much the same covariance."""
    config = {"localization": {"shared_m": 0.001, "own_m": 0.001}}
    sigmas_m = []
    for part in (1.0, told):
        localizer = Localizer(replace(row.map, covariances=part * row.map.covariances), config=config, threads=1)
        seen = seen_from(row, pose_at(4.0), 3)
        # What the map's day and the fruits' own ways add is in the told variances here: 1 cm each.
        spread = part * (seen.covariances + 0.01**2 * np.eye(3))
        sigmas_m.append(localizer.locate(replace(seen, covariances=spread)).sigma_m)
    assert sigmas_m[1] == pytest.approx(sigmas_m[0], rel=0.25)


def test_shared_errors_do_not_average_out(row):
    """What all fruits share moves the camera by as much, however many they are."""
    true = pose_at(4.0)
    seen = seen_from(row, true, 3)
    sigmas_m = []
    for shared_m in (0.002, 0.02):
        config = {"localization": {"shared_m": shared_m}}
        sigmas_m.append(Localizer(row.map, config=config, threads=1).locate(seen).sigma_m)
    assert sigmas_m[1] ** 2 - sigmas_m[0] ** 2 == pytest.approx(3 * (0.02**2 - 0.002**2), rel=0.05)


def test_where_the_vertical_is_known_fruits_are_thought_to_sink(row):
    """What all fruits share is whole along the vertical and half of it aside."""
    true, up = pose_at(4.0), np.array([0.0, 0.0, 1.0])
    seen, in_map = seen_from(row, true, 3), []
    for shared_m in (0.002, 0.02):
        localizer = Localizer(row.map, config={"localization": {"shared_m": shared_m}}, threads=1)
        found = localizer.locate(seen, up=[(true[:3, :3].T @ up).tolist(), (2 * up).tolist()])
        turn = found.map_from_camera[:3, :3]
        in_map.append(turn @ found.covariance[:3, :3] @ turn.T)
    aside, more = 0.25, 0.02**2 - 0.002**2
    assert in_map[1] - in_map[0] == pytest.approx(more * np.diag([aside, aside, 1.0]), abs=0.05 * more)


def test_a_told_covariance_is_that_of_the_motion(row, fresh):
    """A frame without fruits is as uncertain as the one before and the motion together."""
    motion, covariances = np.linalg.solve(pose_at(4.0), pose_at(4.1)), []
    for sigma_m in (0.001, 0.03):
        fresh.reset()
        fresh.update(seen_from(row, pose_at(4.0), 1))
        spread = np.diag([sigma_m**2] * 3 + [1e-5] * 3)
        covariances.append(fresh.update(EMPTY, motion, covariance=spread).covariance)
    more = np.diag([0.03**2 - 0.001**2] * 3 + [0.0] * 3)
    assert covariances[1] - covariances[0] == pytest.approx(more, abs=1e-8)


def test_poses_by_poor_odometry_are_as_uncertain_as_it_is_told_to_be():
    """Motions that err by three times what is usual, with six fruits in view: told so, covariances still hold."""
    told, untold, sigmas = [], [], 3.0 * np.repeat([0.007, 0.005], 3)
    for seed in range(40, 44):
        row, rng, before = drawn_row(seed), np.random.default_rng(seed), None
        localizers = [Localizer(row.map, threads=1) for _ in range(2)]
        for number, x_m in enumerate(np.arange(1.5, 5.0, 0.1)):
            true, spread, moved = pose_at(x_m), None, None
            if before is not None:
                noise, spread = rng.normal(size=6) * sigmas, np.diag(sigmas**2)
                error = np.eye(4)
                error[:3, :3], error[:3, 3] = Rotation.from_rotvec(noise[3:]).as_matrix(), noise[:3]
                moved = np.linalg.solve(before, true) @ error
            seen, before = seen_from(row, true, 500 + number, most=60 if number < 4 else 6), true
            for localizer, covariance, squared in zip(localizers, (spread, None), (told, untold), strict=True):
                found = localizer.update(seen, moved, covariance=covariance)
                if found and number >= 4:
                    step = step_to(found.map_from_camera, true)
                    squared.append(step @ np.linalg.solve(found.covariance, step))
    # A camera whose fruits lie far from where they should is looked for anew: without that the untold have 7.
    assert np.mean(told) < 5.0 < np.mean(untold)


@pytest.mark.parametrize("moved_is_known", [True, False])
def test_frames_are_tracked(row, fresh, moved_is_known):
    before = None
    for number, x_m in enumerate(np.arange(1.5, 6.5, 0.15)):
        true = pose_at(x_m)
        moved = np.linalg.solve(before, true) if moved_is_known and before is not None else None
        found = fresh.update(seen_from(row, true, 200 + number), moved)
        assert_near(found, true)
        assert found.tracked == (number > 0)
        before = true


@pytest.mark.parametrize(("fruits", "lie_m"), [(3, (0.02, 0.0)), (3, (0.05, 0.0)), (3, (0.0, -0.1)), (9, (0.05, 0.0))])
def test_odometry_that_lies_steadily_is_noticed(fruits, lie_m):
    """Told motions too long by centimetres were believed until the camera was metres off, with a NEES of hundreds."""
    frames = drive(Case(fruits, 0.5, (*lie_m, 0.0)), seed=20)
    found = np.isfinite(frames.off_m)
    assert found.mean() > 0.8
    assert frames.off_m[found].max() < 0.3
    assert np.mean(frames.nees[found]) < 15


@pytest.mark.parametrize("fruits", [3, 9])
def test_covariances_count_what_motions_err_by(fruits):
    """Frames that are joined err by what the motions between them do, together: the mean was 11 with three fruits."""
    nees = np.concatenate([drive(Case(fruits, 1.0), seed).nees for seed in range(30, 34)])
    assert 3 < np.nanmean(nees) < 9


@pytest.mark.parametrize("lie", [(0.0, 0.02, 0.0), (0.05, 0.0, 0.0), (0.0, 0.0, 0.5)])
def test_a_lie_that_was_noticed_does_not_lose_the_camera(lie):
    drives = [drive(Case(3, 1.0, lie), seed) for seed in range(3)]
    assert np.mean(np.isfinite(np.concatenate([one.off_m for one in drives]))) > 0.93
    assert np.nanmean(np.concatenate([one.nees for one in drives])) < 9.0


def test_a_lie_that_ends_is_noticed_too(row, fresh):
    before = None
    for number, x_m in enumerate(np.arange(1.5, 6.5, 0.1)):
        true, lie = pose_at(x_m), np.eye(4)
        lie[0, 3] = 0.05 if 4 <= number < 24 else 0.0
        moved = None if before is None else np.linalg.solve(before, true) @ lie
        found = fresh.update(seen_from(row, true, 400 + number, most=60 if number < 4 else 4), moved)
        assert_near(found, true, within_m=0.2, within_deg=10.0)
        before = true


def test_the_motion_carries_the_pose_past_frames_without_fruits(row, fresh):
    fresh.update(seen_from(row, pose_at(4.0), 1))
    volumes = []
    for x_m in (4.1, 4.2, 4.3):
        found = fresh.update(EMPTY, np.linalg.solve(pose_at(x_m - 0.1), pose_at(x_m)))
        assert_near(found, pose_at(x_m))
        assert found.tracked
        assert len(found.pairs) == 0
        volumes.append(np.linalg.slogdet(found.covariance)[1])
    # Of the place alone it may shrink: the camera turns about what it saw.
    assert volumes == sorted(volumes)


def test_a_pose_that_nothing_carries_is_lost_and_found_again(row, fresh):
    fresh.update(seen_from(row, pose_at(2.0), 1))
    statuses = [fresh.update(EMPTY).status for _ in range(3)]
    assert statuses[-1] is Verdict.TOO_FEW
    again = fresh.update(seen_from(row, pose_at(6.0), 2))
    assert_near(again, pose_at(6.0))
    assert not again.tracked


def test_a_camera_that_was_carried_away_is_noticed(row, fresh):
    fresh.update(seen_from(row, pose_at(2.0), 1))
    fresh.update(seen_from(row, pose_at(2.1), 2))
    found = fresh.update(seen_from(row, pose_at(6.0), 3), np.linalg.solve(pose_at(2.1), pose_at(2.2)))
    assert_near(found, pose_at(6.0))
    assert not found.tracked


@pytest.mark.parametrize("most", [20, 12, 6])
@pytest.mark.parametrize("off", [(0.7, 0.0), (0.0, 30.0)], ids=["0.7 m", "30 degrees"])
def test_one_wrong_motion_does_not_outvote_the_fruits_in_view(row, fresh, most, off):
    """The frames before, laid by that motion, were for a pose that every fruit of the newest contradicts."""
    before, wrong = None, np.eye(4)
    wrong[0, 3], wrong[:3, :3] = off[0], Rotation.from_euler("y", off[1], degrees=True).as_matrix()
    for number, x_m in enumerate(np.arange(1.5, 3.6, 0.1)):
        true = pose_at(x_m)
        moved = None if before is None else np.linalg.solve(before, true) @ (wrong if number == 10 else np.eye(4))
        found = fresh.update(seen_from(row, true, 600 + number, most=60 if number < 4 else most), moved)
        if found:
            assert_near(found, true, within_m=0.2, within_deg=5.0)
        before = true
    assert found


def test_new_fruits_do_not_lose_the_camera(row, fresh):
    """Where six of ten fruits hang that the map has not, those that it has are enough."""
    rng, before, statuses = np.random.default_rng(3), None, []
    for number, x_m in enumerate(np.arange(1.5, 5.5, 0.1)):
        true = pose_at(x_m)
        seen = seen_from(row, true, 700 + number, most=20)
        if number >= 4:
            new = rng.random(len(seen)) < 0.6
            seen = replace(seen, positions=seen.positions + new[:, None] * rng.normal(0, 0.3, (len(seen), 3)))
        found = fresh.update(seen, None if before is None else np.linalg.solve(before, true))
        statuses.append(found.status)
        if found:
            assert_near(found, true, within_m=0.1, within_deg=4.0)
        before = true
    assert statuses.count(Verdict.FOUND) >= 0.9 * len(statuses)


def test_a_gap_with_the_motion_unknown_is_noticed():
    for seed in range(6):
        row = drawn_row(seed)
        localizer = Localizer(row.map, threads=1)
        for number, x_m in enumerate([*np.arange(1.5, 3.0, 0.1), *np.arange(4.0, 5.0, 0.1)]):
            found = localizer.update(seen_from(row, pose_at(x_m), 800 + number, most=20))
            if found:
                assert_near(found, pose_at(x_m), within_m=0.2, within_deg=5.0)
        assert found


def test_frames_with_few_fruits_are_joined(row, fresh):
    """Five fruits are no place; those of several frames are one."""
    before, alone, joined = None, [], []
    for number, x_m in enumerate(np.arange(3.0, 4.6, 0.2)):
        true = pose_at(x_m)
        seen = seen_from(row, true, 300 + number, most=5)
        moved = None if before is None else np.linalg.solve(before, true)
        alone.append(bool(fresh.locate(seen)))
        found = fresh.update(seen, moved)
        joined.append(bool(found))
        if found:
            assert_near(found, true, within_m=0.08, within_deg=4.0)
        before = true
    assert not any(alone)
    assert all(joined[5:])


def test_a_frame_that_shows_few_of_many_fruits_is_found(row, localizer):
    """Eight of all fruits in view are no four neighbours of the map; their own fours are laid on all of it."""
    n_found = 0
    for number, x_m in enumerate(np.arange(2.0, 6.0, 0.25)):
        true = pose_at(x_m)
        found = localizer.locate(seen_from(row, true, 900 + number, most=8))
        if found:
            assert_near(found, true, within_m=0.12, within_deg=6.0)
            n_found += 1
    assert n_found >= 13


@pytest.mark.parametrize("n", range(5))
def test_a_frame_with_next_to_no_fruits_is_too_few(row, localizer, n):
    seen = seen_from(row, pose_at(4.0), 1).select(np.arange(n))
    assert localizer.locate(seen).status is Verdict.TOO_FEW


def test_strangers_are_no_match(localizer):
    elsewhere = drawn_row(99)
    found = localizer.locate(seen_from(elsewhere, pose_at(4.0), 1))
    assert found.status is Verdict.NO_MATCH
    assert found.map_from_camera is None
    assert np.isnan(found.position_m).all()
    assert len(found.pairs) == 0


@pytest.mark.parametrize("smaller", [30, 1000])
def test_fruits_that_all_hang_within_the_noise_give_no_pose(row, smaller):
    localizer = Localizer(row.on_map / smaller)
    assert not localizer.locate(seen_from(row, pose_at(4.0), 1).positions / smaller)


def test_fruits_that_are_gone_are_not_looked_for(row):
    there = row.map
    ghost = FruitCloud(
        positions=np.concatenate((row.on_map[:10] + np.array([0.03, 0.0, 0.0]), row.on_map)),
        covariances=np.concatenate((there.covariances[:10], there.covariances)),
        extras={"state": ("gone",) * 10 + ("seen",) * len(row.on_map)},
    )
    localizer = Localizer(ghost)
    assert len(localizer) == len(row.on_map)
    found = localizer.locate(seen_from(row, pose_at(4.0), 2))
    assert_near(found, pose_at(4.0))
    assert found.pairs[:, 1].min() >= 10


@pytest.mark.parametrize("n", [0, 4])
def test_a_map_without_fruits_to_speak_of_gives_no_pose(row, n):
    localizer = Localizer(row.map.select(np.arange(n)))
    assert localizer.locate(seen_from(row, pose_at(4.0), 1)).status is Verdict.TOO_FEW
    assert localizer.update(seen_from(row, pose_at(4.0), 1)).status is Verdict.TOO_FEW


def test_one_tree_is_a_map(row):
    tree = row.map.select(np.flatnonzero(np.abs(row.on_map[:, 0] - 4.0) < 0.6))
    assert_near(Localizer(tree).locate(seen_from(row, pose_at(4.0), 1)), pose_at(4.0), 0.05, 2.5)


@pytest.mark.parametrize(
    ("give", "expected"),
    [
        (lambda here: here.update(EMPTY, np.eye(3)), "moved"),
        (lambda here: here.update(EMPTY, 2.0 * np.eye(4)), "moved"),
        (lambda here: here.update(EMPTY, np.eye(4) + np.diag([np.inf] * 4)), "moved"),
        (lambda here: here.update(EMPTY, np.vstack([np.eye(4)[:3], [1.0, 2.0, 3.0, 4.0]])), "moved"),
        *[
            (lambda here, other=other: here.update(EMPTY, other), "moved")
            for other in ("abc", [[1], [1, 2]], {}, 1j * np.eye(4), [[10**400] * 4] * 4, [[object()] * 4] * 4)
        ],
        (lambda here: here.update(EMPTY, covariance=np.eye(6)), "covariance: found one without moved"),
        *[
            (lambda here, other=other: here.update(EMPTY, np.eye(4), covariance=other), "covariance")
            for other in (np.eye(5), -np.eye(6), np.triu(np.ones((6, 6))), np.full((6, 6), np.nan), "abc", [1j])
        ],
        (lambda here: here.locate(EMPTY, up="up"), "up"),
        (lambda here: here.locate(EMPTY, up=[[1.0], [1.0, 2.0]]), "up"),
        (lambda here: here.locate(np.full((6, 3), np.nan)), "positions"),
        (lambda here: here.locate(EMPTY, up=[1.0, 2.0]), "up"),
        *[
            (lambda here, up=up: here.update(EMPTY, up=up), "up")
            for up in ([0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], np.ma.array([0.0, 0.0, 1.0], mask=[True, False, False]))
        ],
        (lambda here: here.update(EMPTY, np.eye(4) + np.pad([[1e200]], ((0, 3), (3, 0)))), "moved: found one beyond"),
        (lambda here: here.update(EMPTY, np.eye(4), covariance=1e300 * np.eye(6)), "motion covariance"),
    ],
)
def test_wrong_input_is_refused_in_one_line(fresh, give, expected):
    with pytest.raises(PomonaError, match=expected) as refused:
        give(fresh)
    assert "\n" not in str(refused.value)


def test_a_lost_camera_that_sees_nothing_is_not_looked_for(row, fresh):
    """What the frames before saw was looked for when they came: it took half a second, frame after frame."""
    other = drawn_row(5)
    for step in range(3):
        assert not fresh.update(seen_from(other, pose_at(4.0 + 0.1 * step), 1))
    found = fresh.update(EMPTY)
    assert (found.status, found.map_from_camera) == (Verdict.TOO_FEW, None)
    assert np.isnan([found.log_odds, found.sigma_m, *found.covariance.flat]).all()
    assert_near(fresh.update(seen_from(row, pose_at(4.0), 1)), pose_at(4.0))


def test_two_threads_at_once_are_refused_in_one_line(row, fresh):
    """It was a RuntimeError, `Already borrowed`."""
    seen, refused = seen_from(row, pose_at(4.0), 1), []

    def ask(_: int) -> None:
        try:
            fresh.reset()
            fresh.update(seen)
        except PomonaError as error:
            refused.append(str(error))

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(ask, range(40)))
    assert set(refused) == {"localizer: another thread uses it, expected one thread at a time"}
    assert fresh.update(seen)


def test_settings_are_the_cores(row):
    with pytest.raises(PomonaError, match=r"localization\.own_m"):
        Localizer(row.map, config={"localization": {"own_m": -1.0}})


def test_memory_does_not_grow(row, fresh):
    frames = [(seen_from(row, pose_at(x_m), n), pose_at(x_m)) for n, x_m in enumerate((3.9, 4.0, 4.1, 4.0))]

    def drive(n: int) -> int:
        for number in range(n):
            seen, pose = frames[number % 4]
            fresh.update(seen, np.linalg.solve(frames[number % 4 - 1][1], pose) if number else None)
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    if not Path("/proc/self/statm").exists():
        pytest.skip("needs Linux's /proc")
    settled = drive(500)
    assert drive(4000) - settled < 4 << 20


def test_an_index_in_a_file_finds_the_same_poses(row, localizer, tmp_path):
    true, path = pose_at(4.0, turn_deg=7.0), tmp_path / "row.index"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = Localizer(row.map, threads=1, index=path)
        opened = Localizer(row.map, threads=1, index=str(path))
    seen = seen_from(row, true, 1)
    for found in (made.locate(seen), opened.locate(seen), opened.update(seen)):
        assert_near(found, true)
        # From wherever the search starts, the fruits around settle the pose.
        assert np.abs(found.map_from_camera - localizer.locate(seen).map_from_camera).max() < 1e-3


def test_an_index_of_another_map_is_made_anew_and_said(row, tmp_path):
    path = tmp_path / "row.index"
    Localizer(row.map.select(np.arange(100)), index=path)
    with pytest.warns(PomonaWarning, match="made from another map.*; it was made anew"):
        assert Localizer(row.map, index=path).locate(seen_from(row, pose_at(4.0), 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(Localizer(row.map, index=path)) == len(row.map)


def test_fruits_that_are_gone_are_not_in_the_index(row, tmp_path):
    path, hanging = tmp_path / "row.index", np.arange(len(row.map)) % 5 > 0
    map = FruitCloud(row.map.positions, extras={"state": tuple(np.where(hanging, "seen", "gone").tolist())})
    Localizer(map, index=path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = Index.open(path, row.map.positions[hanging]).match(seen_from(row, pose_at(4.0), 1))
    assert found
    placed = Localizer(map, index=path).locate(seen_from(row, pose_at(4.0), 1))
    assert hanging[placed.pairs[:, 1]].all()


def test_what_is_no_index_is_not_replaced(row, tmp_path):
    other = tmp_path / "fruits.csv"
    other.write_text("x,y,z\n1,2,3\n", encoding="utf-8")
    with pytest.raises(PomonaError, match="is not the index of a map"):
        Localizer(row.map, index=other)
    assert other.read_text(encoding="utf-8") == "x,y,z\n1,2,3\n"


def test_a_setting_that_is_no_number_and_an_index_that_is_no_path_are_told() -> None:
    fruits = np.random.default_rng(1).uniform(0, 3, (50, 3))
    with pytest.raises(PomonaError, match=r"config.localization.own_m: found nan, expected a finite number"):
        Localizer(fruits, config={"localization": {"own_m": float("nan")}})
    with pytest.raises(PomonaError, match="index: found int, expected the path of a file"):
        Localizer(fruits, index=3)


def test_a_localizer_is_not_copied(fresh):
    """A shallow copy would share where the camera was."""
    for taken in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="make another of the same map"):
            taken(fresh)
