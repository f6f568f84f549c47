"""Trajectories against truth: what is known by construction, what evo says, and what users write wrongly."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from command_line import Pomona
from pomona import FruitCloud
from pomona.errors import PomonaError, PomonaWarning
from pomona.localize import Localization, Step, Way
from pomona.localize.files import write_way
from pomona.matching import Verdict
from pomona.orchard import write_session
from pomona.recording.poses import read_kitti, read_tum, write_poses
from pomona.trajectory import Trajectory
from pomona.trajectory_scores import (
    Span,
    TimedPoses,
    alignment,
    paired_rows,
    read_poses,
    relative_errors,
    score_trajectory,
    spanned,
)

DATA = Path(__file__).parents[1] / "testdata" / "trajectories"
EVO = json.loads((DATA / "evo.json").read_text())["runs"]


def straight(n: int, step_m: float = 1.0) -> np.ndarray:
    """A camera that drives along its own z."""
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, 2, 3] = step_m * np.arange(n)
    return poses


def turned(vector: list[float], poses: np.ndarray) -> np.ndarray:
    """Poses in a frame of reference that is turned and shifted."""
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = Rotation.from_rotvec(vector).as_matrix(), [0.3, -2.0, 1.0]
    return motion @ poses


def trajectory(poses: np.ndarray, step_s: float = 0.1) -> Trajectory:
    return Trajectory(np.arange(len(poses)), step_s * np.arange(len(poses)), poses)


@pytest.mark.parametrize("run", EVO, ids=lambda run: run["command"].replace("tum true.tum found.tum ", ""))
def test_figures_agree_with_those_of_evo(pomona: Pomona, run: dict[str, Any]) -> None:
    code, out, err = pomona("evaluate", "trajectory", DATA / "found.tum", DATA / "true.tum", "--json", *run["flags"])
    assert code == 0, err
    found = json.loads(out)[run["of"]]
    figures = (found if run["of"] == "absolute" else found[0])[run["errors"]]
    for name, printed in run["printed"].items():
        # evo prints six digits after the point.
        assert figures[name] == pytest.approx(printed, abs=6e-7), name


@pytest.mark.parametrize("suffix", [".tum", ".kitti", ".gpkg"])
def test_every_kind_of_file_gives_the_same_figures(pomona: Pomona, tmp_path: Path, suffix: str) -> None:
    times_s, poses = read_tum(DATA / "found.tum")
    found = Trajectory(np.arange(len(poses)), times_s, poses)
    path = tmp_path / f"found{suffix}"
    if suffix == ".gpkg":
        cloud = FruitCloud(np.eye(3))
        write_session(path, cloud, name="row", date="2024-08-09", recording="test", trajectory=found)
    else:
        write_poses(path, found)
    code, out, err = pomona("evaluate", "trajectory", path, DATA / "true.tum", "--json")
    assert code == 0, err
    given = score_trajectory(read_poses(DATA / "found.tum"), read_poses(DATA / "true.tum"))
    assert json.loads(out)["poses"] == 48
    rmse_m = json.loads(out)["absolute"]["translation_m"]["rmse"]
    assert rmse_m == pytest.approx(given.as_json()["absolute"]["translation_m"]["rmse"], abs=1e-7)
    assert rmse_m < 0.003


def test_a_straight_row_is_aligned_by_orientations() -> None:
    """Positions of a straight way leave its roll free; that of the poses fixes it."""
    true = straight(11)
    found = turned([0.2, 0.4, 2.0], true)
    np.testing.assert_allclose(alignment(found, true).of(found), true, atol=1e-12)
    noisy = found.copy()
    noisy[:, :3, 3] += np.random.default_rng(0).normal(0, 0.01, (11, 3))
    by_both, by_places = (alignment(noisy, true, lever_m=lever_m).of(noisy) for lever_m in (1.0, 0.0))
    left_rad = [
        Rotation.from_matrix(poses[:, :3, :3].transpose(0, 2, 1) @ true[:, :3, :3]).magnitude().max()
        for poses in (by_both, by_places)
    ]
    assert left_rad[0] < 0.005 < 0.3 < left_rad[1]


def test_a_scale_is_found_and_orientations_are_not_stretched() -> None:
    true = np.array([turned([0.0, 0.2 * row, 0.1 * row], pose[None])[0] for row, pose in enumerate(straight(9))])
    found = turned([0.3, -0.2, 0.1], true)
    found[:, :3, 3] /= 2.5
    fit = alignment(found, true, "scale")
    assert fit.scale == pytest.approx(2.5)
    np.testing.assert_allclose(fit.of(found), true, atol=1e-12)
    assert alignment(found, true, "rigid").scale == 1.0


def test_drift_of_two_percent_is_two_percent_over_every_stretch() -> None:
    true, found = straight(11), straight(11, 1.02)
    for span, expected_m in ((Span(1, "f"), 0.02), (Span(5, "f"), 0.1), (Span(2.0, "m"), 0.04)):
        errors = relative_errors(found, true, span)
        np.testing.assert_allclose(errors.translation_m, expected_m)
        np.testing.assert_allclose(errors.rotation_deg, 0.0, atol=1e-6)
    assert len(relative_errors(found, true, Span(5, "f"))) == 6
    assert len(relative_errors(found, true, Span(20.0, "m"))) == 0


def test_stretches_end_where_the_way_comes_nearest() -> None:
    first, last = spanned(Span(1.0, "m"), straight(11, 0.24))
    # 0.96 m are nearer than 1.2 m, and within a tenth.
    np.testing.assert_array_equal(last - first, 4)
    assert not len(spanned(Span(1.0, "m"), straight(11, 0.4))[0])  # 0.8 and 1.2 m


def timed(times_s: list[float] | None, n: int = 0) -> TimedPoses:
    n = len(times_s) if times_s is not None else n
    return TimedPoses(Path("poses.tum"), straight(n), None if times_s is None else np.array(times_s))


def test_poses_of_one_time_are_paired_once() -> None:
    rows, true_rows = paired_rows(timed([0.0, 0.1, 0.104, 0.25, 0.3]), timed([0.001, 0.102, 0.2, 0.3, 0.4]))
    assert list(zip(rows.tolist(), true_rows.tolist(), strict=True)) == [(0, 0), (1, 1), (4, 3)]
    rows, true_rows = paired_rows(timed([0.0, 5.0]), timed(None, 2))
    np.testing.assert_array_equal(rows, true_rows)


def test_too_few_common_times_are_told() -> None:
    with pytest.raises(PomonaError, match=r"found 1 pose within 0.01 s .*, expected 2 or more"):
        paired_rows(timed([0.0, 0.1]), timed([0.0, 0.5]))
    with pytest.raises(PomonaError, match=r"found 3 poses, expected as many as the 2 of"):
        paired_rows(timed(None, 3), timed([0.0, 0.1]))
    with pytest.raises(PomonaError, match="found 0 poses"):
        paired_rows(timed([0.0, 0.1]), timed([]))


def test_times_that_are_not_those_of_the_truth_are_told_from_those_that_are_off() -> None:
    with pytest.raises(PomonaError, match=r"its times, 1000000000 to 1000000001 s, lie beside those there, 0 to 0.5 s"):
        paired_rows(timed([1e9, 1e9 + 1]), timed([0.0, 0.5]))
    with pytest.raises(PomonaError, match=r"found 0 poses .*: in the median the nearest there is 0.05 s off, see --w"):
        paired_rows(timed([0.05, 0.15, 0.25]), timed([0.0, 0.1, 0.2, 0.3]))


def test_frame_numbers_beside_seconds_are_told(pomona: Pomona, tmp_path: Path) -> None:
    for name, step_s in (("numbers.tum", 1.0), ("seconds.tum", 0.25)):
        write_poses(tmp_path / name, trajectory(straight(10), step_s))
    given = ("evaluate", "trajectory", tmp_path / "numbers.tum", tmp_path / "seconds.tum")
    code, out, err = pomona(*given)
    assert code == 0
    assert out.startswith("3 poses of 10 and of 10 true ones")
    assert err == "pomona: only 3 of 10 times are in both files; --in-order pairs poses line by line\n"
    assert pomona(*given, "--in-order")[2] == ""


def placed(places: list[list[float]]) -> TimedPoses:
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    poses[:, :3, 3] = places
    return TimedPoses(Path("placed.tum"), poses, np.arange(float(len(places))))


def test_no_way_is_shrunk_to_a_point_or_mirrored_to_have_no_error() -> None:
    goes, still = placed([[0.1 * row, 0.0, 0.0] for row in range(9)]), placed([[0.1, 0.2, 0.3]] * 9)
    back = placed([[-0.1 * row, 0.0, 0.0] for row in range(9)])
    for estimate, truth in ((goes, still), (goes, back)):
        with pytest.raises(PomonaError, match=r"--align scale: found .* as the scale, expected one above 0"):
            score_trajectory(estimate, truth, align="scale")
    assert score_trajectory(still, goes, align="scale").truth_from_estimate.scale == 1.0
    assert score_trajectory(goes, still, align="rigid").absolute.translation_m.max() > 0.3


def test_a_camera_that_stands_still_has_errors_too() -> None:
    still = TimedPoses(Path("still.tum"), np.tile(np.eye(4), (4, 1, 1)), np.arange(4.0))
    score = score_trajectory(still, still, align="scale")
    assert score.as_json()["absolute"]["translation_m"]["max"] == 0.0
    assert score.as_json()["relative"][1]["translation_m"] is None


def test_kitti_text_comes_back(tmp_path: Path) -> None:
    poses = turned([0.3, 0.2, -0.1], straight(4, 0.123456789))
    write_poses(tmp_path / "poses.kitti", trajectory(poses))
    assert len((tmp_path / "poses.kitti").read_text().splitlines()) == 4
    np.testing.assert_allclose(read_kitti(tmp_path / "poses.kitti"), poses, atol=1e-9)
    assert read_poses(tmp_path / "poses.kitti").times_s is None
    write_poses(tmp_path / "poses.txt", trajectory(poses))
    np.testing.assert_allclose(read_poses(tmp_path / "poses.txt").times_s, [0.0, 0.1, 0.2, 0.3])


def step(frame: int, pose: np.ndarray | None) -> Step:
    status = Verdict.NO_MATCH if pose is None else Verdict.FOUND
    nothing = np.zeros((0, 2), np.int64)
    found = Localization(status, pose, np.zeros((6, 6)), nothing, np.zeros(0), float("nan"), tracked=False)
    return Step(frame, 0.1 * frame, 30, found)


def test_kitti_text_with_a_frame_that_was_not_found_is_told(tmp_path: Path) -> None:
    poses = straight(3)
    way = Way((step(0, poses[0]), step(1, None), step(2, poses[2])), {})
    with pytest.warns(PomonaWarning, match="1 frame without a pose: its lines are not those of the frames"):
        write_way(tmp_path / "way.kitti", way)
    np.testing.assert_array_equal(read_kitti(tmp_path / "way.kitti"), poses[[0, 2]])
    write_way(tmp_path / "way.tum", way)
    assert (tmp_path / "way.tum").read_text().startswith("# time tx ty tz qx qy qz qw: map_from_camera\n0.000000 ")
    np.testing.assert_allclose(read_tum(tmp_path / "way.tum")[0], [0.0, 0.2])


def test_the_table_and_the_picture(pomona: Pomona, tmp_path: Path) -> None:
    command = ("evaluate", "trajectory", DATA / "found.tum", DATA / "true.tum", "--plot", tmp_path / "way.png")
    code, out, err = pomona(*command, "--over", "10m", "--align", "scale")
    assert code == 0, err
    lines = out.splitlines()
    assert lines[0].startswith("48 poses of 48 and of 48 true ones, 5.96 m, aligned: scale, scale 0.99")
    assert lines[1].split() == ["n", "rmse", "mean", "median", "p95", "max"]
    assert lines[2].split()[:3] == ["absolute,", "mm", "48"]
    assert lines[-1].split() == ["over", "10", "m,", "degrees", "0", "-", "-", "-", "-", "-"]
    assert (tmp_path / "way.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (("--over", "1"), "--over: found '1', expected frames or metres: 1f, 10f, 1m, 0.5m"),
        (("--over", "0m"), "--over: found '0m'"),
        (("--over", "1.5f"), "--over: found '1.5f'"),
        (("--lever", "inf"), "--lever: found inf, expected 0 to 1e+06 m"),
        (("--in-order", "--within", "1"), "--within: found with --in-order, expected one of them"),
        (("--plot", "way.gif"), "way.gif: found .gif, expected a picture"),
    ],
)
def test_wrong_flags_are_one_line(pomona: Pomona, flags: tuple[str, ...], complaint: str) -> None:
    code, out, err = pomona("evaluate", "trajectory", DATA / "found.tum", DATA / "true.tum", *flags)
    assert (code, out, len(err.splitlines())) == (2, "", 1), err
    assert complaint in err


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 0 0 0 0 1 0 0 0 0 -1 0\n", "found a pose that mirrors"),
        ("2 0 0 0 0 1 0 0 0 0 1 0\n", "does not turn but stretch"),
        ("0 1 2 3\n", "line 1: found 4 numbers, expected time tx ty tz qx qy qz qw"),
        ("", "found no pose, expected lines of poses"),
        ("0_1 0 0 0 0 0 0 1\n", "line 1: pose: found '0_1', expected a number"),
        ("\uff11 0 0 0 0 0 0 1\n", "expected a number"),
    ],
)
def test_wrong_files_are_one_line(pomona: Pomona, tmp_path: Path, text: str, complaint: str) -> None:
    (tmp_path / "poses.txt").write_text(text, encoding="utf-8")
    code, _, err = pomona("evaluate", "trajectory", tmp_path / "poses.txt", DATA / "true.tum")
    assert (code, len(err.splitlines())) == (2, 1), err
    assert complaint in err
