"""Ways by fruits alone: drawn graphs and rows whose truth is known."""

import gc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.drawn_drives import SIGMAS, drawn_drive, drawn_row, exp, facing, log, measured, neighbours, seen, wobbling

from pomona import FruitCloud
from pomona.errors import PomonaError
from pomona.survey.refinement import Motions, SeenFruits, refine
from pomona.survey.slam import Anchors, Constellations, FruitSlam, FruitWay, chained, way_by_fruits
from pomona.survey.slam.consistency import explained
from pomona.survey.slam.fruit_graph import FruitGraph
from pomona.survey.slam.identities_of_links import joined_fruits
from pomona.survey.slam.loops import Loop, SeenMap, joined, recognised
from pomona.survey.slam.spanning import spanned_poses

NO_FRUITS = SeenFruits(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
NAN, MIRROR = np.full((4, 4), np.nan), np.diag([1.0, 1.0, -1.0, 1.0])


def test_covariances_of_a_graph_are_those_of_its_errors() -> None:
    """Squared errors of poses in a loop, by their covariances, have the mean of chi-square with six degrees."""
    squared = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        true = drawn_drive(rng, 12)
        motions = measured(rng, true, [*neighbours(12), (0, 11), (3, 9)], doubtful=False)
        start = spanned_poses(motions, 12)[1]
        found = refine(start, NO_FRUITS, motions, with_pose_covariances=True)
        assert found.pose_covariances is not None
        for row in (3, 6, 11):
            error = log(np.linalg.inv(found.session_from_camera[row]) @ true[row])
            squared.append(error @ np.linalg.solve(found.pose_covariances[row], error))
        assert not found.pose_covariances[0].any(), "the first pose stays"
    # Poses of one draw go together: of 40 draws the mean scatters by sqrt(12 / 40) = 0.55.
    assert np.mean(squared) == pytest.approx(6.0, abs=1.7)


def loop_of(motions: Motions, n_pairs: int) -> Loop:
    """The first of some motions as a loop."""
    pairs = np.zeros((n_pairs, 2, 2), np.int64)
    rows = int(motions.first[0]), int(motions.second[0])
    return Loop(*rows, motions.first_from_second[0], motions.information[0], pairs)


@pytest.mark.parametrize("seed", range(4))
def test_false_loops_are_refused_and_true_ones_kept(seed: int) -> None:
    """The false ones are off by more than drift explains; they have the most fruits and are tried first."""
    rng = np.random.default_rng(seed)
    true = drawn_drive(rng, 40)
    chain = measured(rng, true, neighbours(40), doubtful=False)
    start = spanned_poses(chain, 40)[1]
    found = [loop_of(measured(rng, true, [pair], True), 10) for pair in ((0, 39), (2, 37), (8, 20))]
    for pair in ((5, 25), (10, 30)):
        loop = loop_of(measured(rng, true, [pair], True), 30)
        found.append(
            replace(loop, first_from_second=loop.first_from_second @ exp(np.array([1.5, 0.6, -1.4, 0.1, 0.5, 0])))
        )
    rows, adjusted = explained(start, chain, found)
    assert rows == [0, 1, 2]
    drift, left = (log(np.linalg.inv(poses[-1]) @ true[-1]) for poses in (start, adjusted.session_from_camera))
    assert np.linalg.norm(left[:3]) < 0.15
    assert np.linalg.norm(left[:3]) < np.linalg.norm(drift[:3])


def walked(seed: int, true: list[np.ndarray], length_m: float) -> tuple[FruitWay, np.ndarray]:
    rng = np.random.default_rng(seed)
    fruits, poses = drawn_row(rng, length_m), wobbling(rng, true)
    return way_by_fruits([seen(rng, fruits, pose) for pose in poses], threads=1), poses


def errors_of(way: FruitWay, true: np.ndarray) -> np.ndarray:
    """Of each pose in the frame of the first."""
    return np.array(
        [
            log(np.linalg.inv(found) @ pose)
            for found, pose in zip(way.session_from_camera, np.linalg.inv(true[0]) @ true, strict=True)
        ]
    )


def test_a_way_there_and_back_is_closed() -> None:
    there = [0.25 * step for step in range(14)]
    way, true = walked(3, [facing(x_m) for x_m in (*there, *(x_m + 0.1 for x_m in there[::-1]))], 3.4)
    assert not way.parts.any(), "one part"
    assert way.loops
    assert way.refused_loops == 0
    errors = errors_of(way, true)
    assert np.linalg.norm(errors[-1, :3]) < 0.02
    assert np.linalg.norm(errors[13, :3]) < 0.06
    squared = [
        error @ np.linalg.solve(spread, error) for error, spread in zip(errors[1:], way.covariances[1:], strict=True)
    ]
    assert np.median(squared) < 2 * 6
    assert way.session_from_camera[0].tolist() == np.eye(4).tolist()


def test_a_row_is_known_again_from_its_other_side() -> None:
    """There on one side, then from the other without having seen how the camera got there: odometry tells it poorly."""
    rng = np.random.default_rng(5)
    fruits = drawn_row(rng, 3.0)
    sides = [facing(0.25 * step) for step in range(12)], [facing(0.25 * step, beyond=True) for step in range(12)]
    true = wobbling(rng, [*sides[0], *sides[1]])
    clouds = [seen(rng, fruits, pose) for pose in true]
    # Around the end of the row: a metre and 30 degrees of doubt.
    round_the_end = Motions(
        first=np.array([11]),
        second=np.array([12]),
        first_from_second=(np.linalg.inv(true[11]) @ true[12] @ exp(np.array([0.6, 0.1, -0.5, 0.0, 0.3, 0.0])))[None],
        information=np.diag([1.0, 1.0, 1.0, 4.0, 4.0, 4.0])[None],
    )
    way = way_by_fruits(clouds, round_the_end, threads=1)
    assert any(loop.first < 12 <= loop.second for loop in way.loops)
    assert np.linalg.norm(errors_of(way, true)[:, :3], axis=1).max() < 0.06


def test_frame_by_frame_a_way_closes_where_it_comes_back_and_ends_as_all_at_once() -> None:
    rng = np.random.default_rng(3)
    there = [0.25 * step for step in range(14)]
    true = wobbling(rng, [facing(x_m) for x_m in (*there, *(x_m + 0.1 for x_m in there[::-1]))])
    fruits = drawn_row(rng, 3.4)
    clouds = [seen(rng, fruits, pose) for pose in true]
    slam = FruitSlam(threads=1)
    placed = [slam.add(cloud) for cloud in clouds]
    assert not slam.parts.any()
    assert {frame.part for frame in placed} == {0}
    assert any(frame.closed for frame in placed[14:])
    assert not any(frame.closed for frame in placed[:14])
    off_m = [
        np.linalg.norm((frame.session_from_camera - pose)[:3, 3])
        for frame, pose in zip(placed, np.linalg.inv(true[0]) @ true, strict=True)
    ]
    assert max(off_m) < 0.08
    now, at_once = slam.way(), way_by_fruits(clouds, threads=1)
    assert np.array_equal(now.session_from_camera, at_once.session_from_camera)
    assert np.array_equal(now.covariances, at_once.covariances)
    assert len(now.loops) == len(at_once.loops)


def test_a_way_that_broke_off_goes_on_where_it_sees_the_row_again() -> None:
    """Blind for some frames, then along the other part of the row and back to where it had been."""
    rng = np.random.default_rng(5)
    fruits = drawn_row(rng, 7.0)
    true = wobbling(rng, [facing(0.25 * step) for step in (*range(10), *range(26, -1, -1))])
    clouds = [seen(rng, fruits, pose) for pose in true]
    blind = FruitCloud(np.zeros((0, 3)), covariances=np.zeros((0, 3, 3)))
    clouds[10:12] = [blind, blind]
    slam = FruitSlam(threads=1)
    placed = [slam.add(cloud) for cloud in clouds]
    begun = {frame.part for frame in placed[12:20]}
    assert len(begun) == 1
    assert 0 not in begun
    assert placed[-1].part == 0
    assert placed[-1].closed or any(frame.closed for frame in placed[24:])
    seen_rows = [*range(10), *range(12, len(clouds))]
    assert not slam.parts[seen_rows].any()
    errors_m = np.linalg.norm((slam.session_from_camera - np.linalg.inv(true[0]) @ true)[seen_rows, :3, 3], axis=1)
    assert errors_m.max() < 0.15
    way = slam.way()
    assert len(np.unique(way.parts[seen_rows])) == 1
    errors = log_all(np.linalg.inv(way.session_from_camera[seen_rows]) @ np.linalg.inv(true[0]) @ true[seen_rows])
    assert np.linalg.norm(errors[:, :3], axis=1).max() < 0.1


def test_odometry_ties_a_frame_that_saw_nothing() -> None:
    rng = np.random.default_rng(9)
    fruits = drawn_row(rng, 2.5)
    true = wobbling(rng, [facing(0.2 * step) for step in range(8)])
    clouds = [seen(rng, fruits, pose) for pose in true]
    clouds[4] = FruitCloud(np.zeros((0, 3)), covariances=np.zeros((0, 3, 3)))
    slam, sure = FruitSlam(threads=1), np.diag(SIGMAS**-2.0)
    for row, cloud in enumerate(clouds):
        if row == 5:  # of which odometry tells where the blind frame was: the two parts are one
            assert slam.parts.tolist() == [0, 0, 0, 0, 1]
            assert slam.add(cloud, np.linalg.inv(true[4]) @ true[5], sure).closed
            assert slam.parts.tolist() == [0] * 6
        else:
            slam.add(cloud)
    blind = np.linalg.inv(slam.way().session_from_camera[4]) @ np.linalg.inv(true[0]) @ true[4]
    assert np.linalg.norm(blind[:3, 3]) < 0.03


@pytest.mark.parametrize("trusted", [{}, {"doubtful": False}])
def test_wheels_that_slipped_are_outvoted_unless_they_are_trusted(trusted: dict[str, bool]) -> None:
    rng = np.random.default_rng(3)
    fruits = drawn_row(rng, 2.5)
    true = wobbling(rng, [facing(0.2 * step) for step in range(10)])
    slam, sure = FruitSlam(threads=1), np.diag([1e5] * 3 + [2.5e5] * 3)  # 3 mm, 2 mrad
    slam.add(seen(rng, fruits, true[0]))
    for row in range(1, 10):
        moved = np.linalg.inv(true[row - 1]) @ true[row]
        moved[0, 3] += 0.5 if row == 5 else 0.0
        slam.add(seen(rng, fruits, true[row]), moved, sure, **trusted)
    off_m = np.linalg.norm((slam.way().session_from_camera - np.linalg.inv(true[0]) @ true)[:, :3, 3], axis=1)
    assert (off_m.max() < 0.03) == (not trusted)


def test_frames_share_threads() -> None:
    """Each frame that was looked in with threads of its own left .3 MB behind, the allocator's for them."""
    tasks = Path("/proc/self/task")
    if not tasks.is_dir():
        pytest.skip("needs Linux's /proc")
    rng = np.random.default_rng(3)
    fruits, slam = drawn_row(rng, 2.5), FruitSlam(threads=1)
    before = len(list(tasks.iterdir()))
    for step in range(6):
        slam.add(seen(rng, fruits, facing(0.2 * step)))
    assert len(list(tasks.iterdir())) <= before + 1


def test_a_frame_is_kept_in_some_kilobytes() -> None:
    if not Path("/proc/self/statm").exists():
        pytest.skip("needs Linux's /proc")
    rng = np.random.default_rng(3)
    fruits, slam = drawn_row(rng, 2.5), FruitSlam(threads=1)
    bytes_used = []
    for step in range(48):
        slam.add(seen(rng, fruits, facing(0.9 + 0.3 * np.sin(0.3 * step))))
        gc.collect()
        bytes_used.append(int(Path("/proc/self/statm").read_text().split()[1]) * 4096)
    kept = (bytes_used[-1] - bytes_used[23]) / 24
    assert kept < 100 * 1024, f"{kept / 1024:.0f} kB a frame"


@pytest.mark.parametrize(
    ("moved", "information", "complaint"),
    [
        (np.eye(4), None, "found one of them, expected both or none"),
        (NAN, np.eye(6), "moved: found a matrix that does not turn and move"),
        (MIRROR, np.eye(6), "moved: found a matrix that does not turn and move"),
        (np.eye(4) + 1j, np.eye(6), "moved: found complex128, expected an array of float64"),
        (np.eye(3), np.eye(6), r"moved: found shape \(3, 3\), expected \(4, 4\)"),
        (facing(1e9), np.eye(6), "moved: found one beyond 1,000 km, expected metres between two frames"),
        (np.eye(4), np.zeros((6, 6)), "information: found a matrix that is not symmetric positive definite"),
        (np.eye(4), -np.eye(6), "information: found a matrix that is not symmetric positive definite"),
        (np.eye(4), np.triu(np.ones((6, 6))) + np.eye(6), "information: found a matrix that is not symmetric"),
        (np.eye(4), np.full((6, 6), np.inf), "information: found a matrix that is not symmetric positive definite"),
    ],
)
def test_a_motion_that_is_none_leaves_a_way_as_it_was(
    moved: np.ndarray, information: np.ndarray | None, complaint: str
) -> None:
    rng = np.random.default_rng(9)
    fruits = drawn_row(rng, 2.5)
    clouds = [seen(rng, fruits, facing(0.2 * step)) for step in range(3)]
    slam = FruitSlam(threads=1)
    for row, cloud in enumerate(clouds):
        with pytest.raises(PomonaError, match=complaint):
            slam.add(cloud, moved, information)
        assert len(slam) == row
        slam.add(cloud)
    at_once = way_by_fruits((cloud for cloud in clouds), threads=1)
    assert np.array_equal(slam.way().session_from_camera, at_once.session_from_camera)


def test_a_frame_that_cannot_be_looked_for_leaves_a_way_as_it_was() -> None:
    rng = np.random.default_rng(9)
    fruits, slam = drawn_row(rng, 2.5), FruitSlam(threads=1)
    clouds = [seen(rng, fruits, facing(0.2 * step)) for step in range(4)]
    slam.add(clouds[0])
    beyond = FruitCloud(clouds[1].positions, covariances=1e160 * clouds[1].covariances)
    with pytest.raises(PomonaError, match="covariances"):
        slam.add(beyond)
    for cloud in clouds[1:]:
        assert slam.add(cloud).part == 0
    at_once = way_by_fruits(clouds, threads=1)
    assert np.array_equal(slam.way().session_from_camera, at_once.session_from_camera)


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: FruitSlam(config={"localization": {"own_n": 1.0}}), "own_n"),
        (lambda: FruitSlam(config={"localization": 3}), "config: localization: found 3, expected a table"),
        (lambda: FruitSlam(config=[1]), "config: found a list, expected tables"),  # type: ignore[arg-type]
        (lambda: way_by_fruits(FruitCloud(np.eye(3))), "clouds: found FruitCloud, expected a FruitCloud of each frame"),
        (lambda: way_by_fruits(3), "clouds: found int, expected a FruitCloud of each frame"),  # type: ignore[arg-type]
        (lambda: way_by_fruits([], [np.eye(4)]), "motions: found list, expected Motions"),  # type: ignore[arg-type]
        (
            lambda: FruitSlam().add(FruitCloud(np.zeros((0, 3))), np.eye(4), np.eye(6), doubtful="no"),  # type: ignore[arg-type]
            "doubtful: found str, expected True or False",
        ),
    ],
)
def test_what_is_no_frame_motion_or_setting_is_told_at_once(call: Callable[[], object], complaint: str) -> None:
    with pytest.raises(PomonaError, match=complaint):
        call()


def test_wrong_frames_of_motions_and_anchors_are_told() -> None:
    rng = np.random.default_rng(9)
    fruits = drawn_row(rng, 2.5)
    clouds = [seen(rng, fruits, facing(0.2 * step)) for step in range(3)]
    for first, second in ((0, 3), (-1, 1), (1, 1)):
        motion = Motions(np.array([first]), np.array([second]), np.eye(4)[None], np.eye(6)[None])
        with pytest.raises(PomonaError, match=rf"row 0: found frames {first} and {second}, expected two of 0 to 2"):
            way_by_fruits(clouds, motion)
    with pytest.raises(PomonaError, match=r"motions.information: found shape \(2, 6, 6\), expected \(1, 6, 6\)"):
        way_by_fruits(clouds, Motions(np.array([0]), np.array([1]), np.eye(4)[None], np.tile(np.eye(6), (2, 1, 1))))
    for row in (3, -1):
        anchors = Anchors.of_places(np.array([row]), np.zeros((1, 3)), np.eye(3)[None])
        with pytest.raises(PomonaError, match=f"anchors: found frame {row}, expected one of 0 to 2"):
            way_by_fruits(clouds, anchors=anchors)
    with pytest.raises(PomonaError, match=r"anchors.covariances: row 0: found a matrix that is not symmetric positive"):
        Anchors.of_places(np.array([0]), np.zeros((1, 3)), -np.eye(3)[None])
    with pytest.raises(PomonaError, match="clouds: found ndarray, expected a FruitCloud of each frame"):
        way_by_fruits([np.eye(3)])
    with pytest.raises(PomonaError, match="clouds: found NoneType, expected a FruitCloud of each frame"):
        FruitSlam().add(None)


def log_all(poses: np.ndarray) -> np.ndarray:
    return np.array([log(pose) for pose in poses])


def test_two_parts_are_joined_by_what_several_of_their_frames_saw() -> None:
    rng = np.random.default_rng(8)
    fruits = drawn_row(rng, 3.0)
    true = wobbling(rng, [facing(0.25 * step) for step in range(10)])
    clouds = [seen(rng, fruits, pose) for pose in true]
    both = []
    for rows in (slice(0, 5), slice(5, 10)):
        links = chained(Constellations(clouds[rows], threads=1))
        start = np.linalg.inv(true[rows][0]) @ true[rows]
        both.append(FruitGraph(clouds[rows], Motions.none(), start).link(links))
    join = joined(*both, Constellations(clouds, threads=1))
    assert join is not None
    assert (join.first, join.second) == (4, 0)
    assert np.linalg.norm(log(np.linalg.inv(join.first_from_second) @ np.linalg.inv(true[4]) @ true[5])[:3]) < 0.03
    # Sightings that are said to be of one fruit lie at one place.
    for (frame, row), (other, other_row) in join.pairs:
        places = [
            pose[:3, :3] @ cloud.positions[at] + pose[:3, 3]
            for pose, cloud, at in ((true[frame], clouds[frame], row), (true[5 + other], clouds[5 + other], other_row))
        ]
        assert np.linalg.norm(places[0] - places[1]) < 0.1
    assert len(join.pairs) > 10


def mapped(rng: np.random.Generator, fruits: np.ndarray) -> SeenMap:
    """A part whose two frames saw some fruits from one place."""
    n, poses = len(fruits), np.tile(np.eye(4), (2, 1, 1))
    centres = fruits + rng.normal(0, 0.005, (n, 3))
    covariances = np.tile(0.01**2 * np.eye(3), (n, 1, 1))
    return SeenMap(poses, np.repeat(np.arange(2), n), np.tile(np.arange(n), 2), centres, covariances)


@pytest.mark.parametrize(("apart_m", "known_again"), [(0.02, True), (2.0, False)])
def test_a_fruit_held_twice_is_no_copy_of_a_tree(apart_m: float, known_again: bool) -> None:
    """Where a copy stands within centimetres it is the tree itself; one that stands elsewhere may be either."""
    rng = np.random.default_rng(12)
    fruits, others = drawn_row(rng, 1.5), drawn_row(rng, 6.0) + np.array([5.0, 0, 0])
    there = mapped(rng, np.concatenate([fruits, fruits + np.array([apart_m, 0, 0]), others]))
    here = mapped(rng, fruits)
    loop = recognised(there, here, [0], Constellations((), threads=1))
    assert (loop is not None) == known_again
    if loop is not None:
        assert np.linalg.norm(loop.first_from_second[:3, 3]) < 0.03


def test_a_part_that_saw_two_others_joins_both() -> None:
    rng = np.random.default_rng(21)
    fruits = drawn_row(rng, 8.0)
    drives = np.arange(0, 1.5, 0.2), np.arange(5, 7.4, 0.2), np.arange(0, 7.4, 0.2)
    true = np.array([facing(x) for drive in drives for x in drive])
    way = way_by_fruits([seen(rng, fruits, pose) for pose in true], threads=1)
    assert not way.parts.any()
    errors = log_all(np.linalg.inv(way.session_from_camera) @ np.linalg.inv(true[0]) @ true)
    assert np.linalg.norm(errors[:, :3], axis=1).max() < 0.05


def world(rng: np.random.Generator, seen_from_first: np.ndarray) -> np.ndarray:
    """The poses in a frame with z up, in which the row runs north-east."""
    upright = np.eye(4)
    upright[:3, :3] = Rotation.from_euler("z", 40, degrees=True).as_matrix() @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    upright[:3, 3] = [1200.0, -340.0, 80.0]
    return upright @ seen_from_first


def test_a_way_hangs_on_gnss_and_verticals() -> None:
    """Places to 2 cm at every third frame, one of them a reflection; verticals to half a degree."""
    rng = np.random.default_rng(4)
    fruits, poses = drawn_row(rng, 4.0), wobbling(rng, [facing(0.25 * step) for step in range(16)])
    true = world(rng, poses)
    at = np.arange(0, 16, 3)
    positions = true[at, :3, 3] + rng.normal(0, 0.02, (len(at), 3))
    positions[2] += [0.0, 2.0, 1.0]
    sigma_rad = np.radians(0.5)
    ups = true[:, 2, :3] + rng.normal(0, sigma_rad, (16, 3))
    spreads = np.tile(0.02**2 * np.eye(3), (len(at), 1, 1))
    anchors = Anchors(at, positions, spreads, np.arange(16), ups, sigma_rad)
    way = way_by_fruits([seen(rng, fruits, pose) for pose in poses], anchors=anchors, threads=1)
    left = np.array([log(one) for one in np.linalg.inv(way.session_from_camera) @ true])
    assert np.linalg.norm(left[:, :3], axis=1).max() < 0.06
    assert np.degrees(np.linalg.norm(left[:, 3:], axis=1)).max() < 1.0
    squared = [error @ np.linalg.solve(spread, error) for error, spread in zip(left, way.covariances, strict=True)]
    assert 0.5 < np.mean(squared) < 15.0


def test_verticals_alone_level_a_way() -> None:
    rng = np.random.default_rng(6)
    fruits, poses = drawn_row(rng, 2.5), wobbling(rng, [facing(0.25 * step) for step in range(8)])
    true = world(rng, poses)
    anchors = Anchors.of_verticals(np.arange(8), true[:, 2, :3], 0.001)
    way = way_by_fruits([seen(rng, fruits, pose) for pose in poses], anchors=anchors, threads=1)
    np.testing.assert_allclose(way.session_from_camera[:, 2, :3], true[:, 2, :3], atol=0.01)


def test_numbers_that_are_none_are_told_with_their_names() -> None:
    nowhere, spread = np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]]), np.tile(np.eye(3), (2, 1, 1))
    with pytest.raises(PomonaError, match=r"anchors.positions: row 1: found a number that is not finite"):
        Anchors.of_places(np.arange(2), nowhere, spread)
    with pytest.raises(PomonaError, match=r"anchors.ups_in_camera: row 1: found a number that is not finite"):
        Anchors.of_verticals(np.arange(2), nowhere)
    with pytest.raises(PomonaError, match=r"motions.first: found 0.5, expected whole numbers"):
        Motions(np.array([0.5]), np.array([1.0]), np.eye(4)[None], np.eye(6)[None]).checked(2)
    nothing = FruitCloud(np.zeros((0, 3)), covariances=np.zeros((0, 3, 3)))
    with pytest.raises(PomonaError, match=r"moved: found a masked array, expected one whose values are all known"):
        FruitSlam().add(nothing, np.ma.masked_array(np.eye(4), np.eye(4) > 0), np.eye(6))


def test_anchors_of_a_wrong_shape_are_told() -> None:
    with pytest.raises(PomonaError, match="anchors: found 3 positions and 0 verticals, expected 2 and 0"):
        Anchors.of_places(np.arange(2), np.zeros((3, 3)), np.tile(np.eye(3), (2, 1, 1)))
    with pytest.raises(PomonaError, match=r"anchors.covariances: found shape \(1, 3, 3\), expected \(2, 3, 3\)"):
        Anchors.of_places(np.arange(2), np.zeros((2, 3)), np.eye(3)[None])
    with pytest.raises(PomonaError, match="anchors: found a vertical without a direction"):
        Anchors.of_verticals(np.arange(1), np.zeros((1, 3)))


def test_frames_of_other_fruits_are_another_part() -> None:
    rng = np.random.default_rng(2)
    one, other = drawn_row(rng, 2.0), drawn_row(rng, 2.0)
    drive = [facing(0.2 * step) for step in range(6)]
    clouds = [seen(rng, one, pose) for pose in drive] + [seen(rng, other, pose) for pose in drive]
    way = way_by_fruits(clouds, threads=1)
    assert way.parts.tolist() == [0] * 6 + [1] * 6
    assert not way.loops
    assert repr(way).startswith("FruitWay(12 frames in 2 parts")


def test_frames_without_fruits_hang_together_with_none() -> None:
    empty = FruitCloud(positions=np.zeros((0, 3)), covariances=np.zeros((0, 3, 3)))
    way = way_by_fruits([empty, empty, empty])
    assert way.parts.tolist() == [0, 1, 2]
    assert len(way_by_fruits([])) == 0
    with pytest.raises(PomonaError, match="frame 1 has no covariances"):
        way_by_fruits([empty, FruitCloud(np.eye(3))])


def test_a_fruit_is_once_in_a_frame() -> None:
    frames = np.array([0, 0, 1, 2])
    fruits = joined_fruits(np.arange(4), frames, [(0, 2), (2, 3), (1, 3)])
    # The last pair would make both fruits of frame 0 one.
    assert fruits.tolist() == [0, 1, 0, 0]
