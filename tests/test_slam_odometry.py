"""What told motions err by: steady errors, lies, and trees that are copies of each other."""

from collections.abc import Callable

import numpy as np
import pytest
from tests.drawn_drives import drawn_drive, drawn_row, exp, facing, seen, wobbling

from pomona.survey.refinement import Motions
from pomona.survey.slam import Constellations, FruitSlam, PlacedFrame, chained
from pomona.survey.slam.constellation_links import ConstellationLink
from pomona.survey.slam.odometry_errors import OdometryErrors, VectorErrors, learnt_errors
from pomona.survey.slam.placing import placings

NO_PAIRS = np.zeros((0, 2), np.int64)


def told_drive(
    seed: int, lie: Callable[[int, np.ndarray], np.ndarray]
) -> tuple[FruitSlam, list[PlacedFrame], np.ndarray]:
    """There and back with told motions that claim 3 mm and 2 mrad; where frames were as they came, and are."""
    rng = np.random.default_rng(seed)
    fruits, there = drawn_row(rng, 2.5), [0.15 * step for step in range(14)]
    true = wobbling(rng, [facing(x_m) for x_m in (*there, *there[::-1])])
    slam, claimed, placed = FruitSlam(threads=1), np.array([0.003] * 3 + [0.002] * 3), []
    for row, pose in enumerate(true):
        cloud = seen(rng, fruits, pose)
        if row:
            moved = lie(row, np.linalg.inv(true[row - 1]) @ pose) @ exp(claimed * rng.normal(size=6))
            placed.append(slam.add(cloud, moved, np.diag(claimed**-2.0)))
        else:
            placed.append(slam.add(cloud))
    return slam, placed, np.linalg.inv(true[0]) @ true


def far_off_m(placed: list[PlacedFrame], true: np.ndarray) -> float:
    """How far off the worst frame of the first part was when it came."""
    here = zip(placed, true, strict=True)
    return max(
        float(np.linalg.norm((frame.session_from_camera - pose)[:3, 3])) for frame, pose in here if not frame.part
    )


def test_wheels_that_are_steadily_too_large_close_their_loops() -> None:
    def too_far(row: int, moved: np.ndarray) -> np.ndarray:
        del row
        return np.concatenate([np.concatenate([moved[:3, :3], 1.1 * moved[:3, 3:]], axis=1), moved[3:]])

    slam, placed, true = told_drive(4, too_far)
    way = slam.way()
    assert way.loops
    assert way.refused_loops == 0
    assert np.linalg.norm((way.session_from_camera - true)[:, :3, 3], axis=1).max() < 0.04
    # The first frames have but one link each, beside a motion that contradicts it: nobody knows which is right.
    assert [frame.part for frame in placed[7:]] == [0] * 21
    assert far_off_m(placed, true) < 0.1


@pytest.mark.parametrize("glitch_m", [8.0, 30.0])
def test_a_way_is_not_laid_out_by_one_wild_motion(glitch_m: float) -> None:
    """It claims to be the surest, and poses that begin 8 m off are nearer to it than to the links beside it."""

    def glitch(row: int, moved: np.ndarray) -> np.ndarray:
        return exp([glitch_m if row == 7 else 0.0, 0, 0, 0, 0, 0]) @ moved

    slam, _, true = told_drive(4, glitch)
    way = slam.way()
    assert (way.refused, way.refused_loops) == (0, 0)
    assert np.linalg.norm((way.session_from_camera - true)[:, :3, 3], axis=1).max() < 0.04


def test_a_frame_is_placed_by_its_fruits_where_its_motion_lies() -> None:
    def lie(row: int, moved: np.ndarray) -> np.ndarray:
        return moved @ exp(np.array([0.5, 0, 0, 0, 0, 0])) if row == 9 else moved

    _, placed, true = told_drive(4, lie)
    assert {frame.part for frame in placed} == {0}
    assert far_off_m(placed, true) < 0.06


@pytest.mark.parametrize(
    ("scale", "offset", "factor"),
    [(1.0, (0, 0, 0), 1.0), (0.9, (0, 0, 0), 1.0), (1.0, (0, 0.03, 0), 1), (1.0, (0, 0, 0), 64)],
)
@pytest.mark.parametrize("seed", range(3))
def test_what_odometry_errs_by_is_learnt(seed: int, scale: float, offset: tuple[float, ...], factor: float) -> None:
    """Of ways; turns are told rightly. Some motions slip besides."""
    rng = np.random.default_rng(seed)
    true, sigmas = drawn_drive(rng, 60), np.array([0.003] * 3 + [0.002] * 3)
    told, links = [], []
    for row in range(59):
        moved = np.linalg.inv(true[row]) @ true[row + 1]
        link = moved @ exp(2 * sigmas * rng.normal(size=6))
        links.append(ConstellationLink(row, row + 1, link, np.diag((2 * sigmas) ** -2.0), NO_PAIRS, np.zeros(0)))
        moved[:3, 3] = (moved[:3, 3] - moved[:3, :3] @ offset) / scale
        spread = np.repeat([factor**0.5, 1.0], 3) * sigmas
        told.append(moved @ exp(spread * rng.normal(size=6) + (row % 15 == 7) * np.array([0.5, 0, 0, 0, 0, 0])))
    rows = np.arange(59)
    motions = Motions(rows, rows + 1, np.array(told), np.tile(np.diag(sigmas**-2.0), (59, 1, 1)), np.ones(59, bool))
    learnt = learnt_errors(motions, links)
    assert learnt.way.scale == pytest.approx(scale, abs=0.01)
    assert learnt.way.offset == pytest.approx(offset, abs=0.004)
    assert factor / 4 <= learnt.way.factor <= factor * 4
    assert learnt.turn == VectorErrors()
    if (scale, offset, factor) == (1.0, (0, 0, 0), 1.0):
        assert learnt == OdometryErrors(), "a claim that holds is not mended"
    trusted = motions.trusted()
    assert learnt.mended(trusted) is trusted


def test_a_frame_whose_ties_contradict_each_other_begins_a_part_unless_one_side_has_more() -> None:
    """Ties of 5 mm from the two frames before: they agree, they do not, and two agree against one."""
    ahead = np.tile(np.eye(4), (3, 1, 1))
    ahead[:, 0, 3] = [0.2, 0.2, 0.7]
    parts, poses = np.zeros(1, np.int64), np.eye(4)[None]

    def placed(*rows: int) -> list[float]:
        n = len(rows)
        ties = Motions(
            np.zeros(n, np.int64), np.ones(n, np.int64), ahead[list(rows)], np.tile(4e4 * np.eye(6), (n, 1, 1))
        )
        return [float(placing.pose[0, 3]) for placing in placings(parts, poses, ties)]

    assert placed(0) == [0.2]
    assert placed(0, 1) == [0.2]
    assert placed(0, 2) == []
    assert placed(2, 0, 1) == [0.2]
    assert placed() == []


def copied_trees(rng: np.random.Generator) -> np.ndarray:
    """Three trees that are copies of each other to 5 mm, 1.2 m apart."""
    tree = rng.uniform([-0.6, -0.7, -0.25], [0.6, 0.7, 0.25], (45, 3))
    return np.concatenate([tree + np.array([1.2 * row, 0, 0]) + rng.normal(0, 0.005, tree.shape) for row in range(3)])


@pytest.mark.parametrize("seed", range(4))
def test_no_link_jumps_a_tree_where_trees_are_copies(seed: int) -> None:
    """The way past them may break; what hangs together lies right."""
    rng = np.random.default_rng(seed)
    fruits = copied_trees(rng)
    true = wobbling(rng, [facing(0.15 * step - 0.2) for step in range(18)])
    links = chained(Constellations([seen(rng, fruits, pose) for pose in true], threads=1))
    assert len(links) > 18
    left = [
        np.linalg.inv(np.linalg.inv(true[link.first]) @ true[link.second]) @ link.first_from_second for link in links
    ]
    assert max(np.linalg.norm(pose[:3, 3]) for pose in left) < 0.1
