"""Odometry: a made-up drive with exact truth, its breaks, and the rendered row."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.drive_scene import CALIBRATION, Drive, drive, sideways

from pomona import PomonaError
from pomona.odometry import Motion, OdometryTrajectory, StereoOdometry
from pomona.recording import Calibration, open_recording
from pomona.survey.pose_source import pose_source_of

BLACK = np.zeros((240, 320), np.uint8)


@pytest.fixture(scope="module")
def scene() -> Drive:
    return drive(sideways(24))


def run(scene: Drive, rows: range, odometry: StereoOdometry | None = None) -> tuple[StereoOdometry, list[Motion]]:
    odometry = odometry or StereoOdometry(CALIBRATION)
    return odometry, [odometry(*scene.pictures(row)[:2]) for row in rows]


def shift_and_turn(found: NDArray[np.float64], true: NDArray[np.float64]) -> tuple[float, float]:
    error = np.linalg.inv(true) @ found
    return float(np.linalg.norm(error[:3, 3])), float(np.linalg.norm(cv2.Rodrigues(error[:3, :3])[0]))


@pytest.fixture(scope="module")
def driven(scene: Drive) -> tuple[list[Motion], OdometryTrajectory]:
    odometry, motions = run(scene, range(24))
    return motions, odometry.trajectory()


def test_a_drive_is_followed(scene: Drive, driven: tuple[list[Motion], OdometryTrajectory]) -> None:
    motions, trajectory = driven
    assert [motion.part for motion in motions] == [0] * 24
    assert not any(motion.lost or motion.broken for motion in motions)
    assert 3 <= sum(motion.keyframe for motion in motions) < 24
    np.testing.assert_array_equal(trajectory.frames, np.arange(24))
    # 0.5 px over some hundred points at 2 m, f = 260 px: 0.4 mm a keyframe; 1 % of the 1.15 m are 12 mm.
    for found in (trajectory.session_from_camera[-1], motions[-1].session_from_camera):
        shift, turn = shift_and_turn(found, scene.poses[23])
        assert shift < 0.006
        assert turn < 0.003


def test_motions_are_as_good_as_they_say(scene: Drive, driven: tuple[list[Motion], OdometryTrajectory]) -> None:
    _, trajectory = driven
    assert len(trajectory.first) == 23
    squared = []
    for first, second, found, information in zip(
        trajectory.first, trajectory.second, trajectory.first_from_second, trajectory.information, strict=True
    ):
        true = np.linalg.inv(scene.poses[first]) @ scene.poses[second]
        error = np.linalg.inv(true) @ found
        xi = np.concatenate([error[:3, 3], cv2.Rodrigues(error[:3, :3])[0][:, 0]])
        squared.append(xi @ information @ xi)
    # Corners on a clean wall are followed better than the half pixel that foliage asks for, never worse.
    assert np.median(squared) < 6.0
    assert (np.linalg.eigvalsh(trajectory.information) > 0).all()


def test_depth_pictures_do_as_well(scene: Drive) -> None:
    odometry = StereoOdometry(CALIBRATION)
    for row in range(12):
        left, _, depth_m = scene.pictures(row)
        motion = odometry.with_depth(left, depth_m)
    assert motion.session_from_camera is not None
    shift, turn = shift_and_turn(motion.session_from_camera, scene.poses[11])
    assert shift < 0.006
    assert turn < 0.003


@pytest.mark.parametrize("corrupt", [BLACK, np.full((240, 320), 255, np.uint8), "noise", "unread"])
def test_one_bad_frame_has_no_pose_and_the_part_goes_on(scene: Drive, corrupt: object) -> None:
    odometry, _ = run(scene, range(8))
    if isinstance(corrupt, np.ndarray):
        bad = odometry(corrupt, corrupt)
    elif corrupt == "noise":
        noise = np.random.default_rng(3).integers(0, 256, (2, 240, 320)).astype(np.uint8)
        bad = odometry(noise[0], noise[1])
    else:
        bad = odometry.skip("left/0008.png: not a picture")
    assert bad.session_from_camera is None
    assert bad.lost is not None
    assert "\n" not in bad.lost
    _, after = run(scene, range(9, 14), odometry)
    assert [motion.part for motion in after] == [0] * 5
    shift, _ = shift_and_turn(after[-1].session_from_camera, scene.poses[13])
    assert shift < 0.006
    assert 8 not in odometry.trajectory().frames


def test_another_scene_begins_a_new_part_and_says_why(scene: Drive) -> None:
    odometry, _ = run(scene, range(6))
    other = drive(sideways(6), seed=9)
    _, motions = run(other, range(6), odometry)
    assert motions[0].session_from_camera is None
    assert "agree" in (motions[0].lost or "") or "no points" in (motions[0].lost or "")
    assert [motion.part for motion in motions] == [0, 1, 1, 1, 1, 1]
    assert (motions[1].broken or "").startswith(f"{motions[0].lost}; then found")
    np.testing.assert_array_equal(motions[1].session_from_camera, np.eye(4))
    assert all(motion.broken is None for motion in motions[2:])
    trajectory = odometry.trajectory()
    np.testing.assert_array_equal(trajectory.parts, [0] * 6 + [1] * 5)
    assert (trajectory.parts[trajectory.first] == trajectory.parts[trajectory.second]).all()


def test_nothing_begins_before_something_is_seen(scene: Drive) -> None:
    odometry = StereoOdometry(CALIBRATION)
    assert [odometry(BLACK, BLACK).lost for _ in range(3)] == ["the picture shows nothing"] * 3
    assert len(odometry.trajectory()) == 0
    _, motions = run(scene, range(3), odometry)
    assert motions[0].broken is None
    np.testing.assert_array_equal(motions[0].session_from_camera, np.eye(4))
    np.testing.assert_array_equal(odometry.trajectory().frames, [3, 4, 5])


def test_threads_change_nothing(scene: Drive, driven: tuple[list[Motion], OdometryTrajectory]) -> None:
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        odometry, _ = run(scene, range(8))
    finally:
        cv2.setNumThreads(threads)
    again, _ = run(scene, range(8))
    np.testing.assert_array_equal(odometry.trajectory().session_from_camera, again.trajectory().session_from_camera)


def test_pictures_of_another_size_are_refused() -> None:
    odometry = StereoOdometry(CALIBRATION)
    with pytest.raises(PomonaError, match="left: found a picture of 100 x 50, expected grey, 320 x 240"):
        odometry(np.zeros((50, 100), np.uint8), BLACK)
    with pytest.raises(PomonaError, match="right: found a picture of 3 x 320 x 240"):
        odometry(BLACK, np.zeros((240, 320, 3), np.uint8))
    without = StereoOdometry(Calibration(width=320, height=240, fx=260.0, fy=260.0, cx=160.0, cy=120.0))
    with pytest.raises(PomonaError, match="no baseline"):
        without(BLACK, BLACK)


def test_settings_are_the_core_s(scene: Drive) -> None:
    strict = StereoOdometry(CALIBRATION, {"odometry": {"min_inliers": 5000}})
    assert (strict(*scene.pictures(0)[:2]).lost or "").endswith("points with depth, expected at least 5000")
    dense = StereoOdometry(CALIBRATION, {"odometry": {"keyframe_rad": 0.001}})
    run(scene, range(4), dense)
    assert len(dense.trajectory().frames) == 4
    assert [motion.keyframe for motion in run(scene, range(4, 6), dense)[1]] == [True, True]
    with pytest.raises(PomonaError, match=r"odometry: setting odometry\.gate: found -1, expected a positive number"):
        StereoOdometry(CALIBRATION, {"odometry": {"gate": -1.0}})
    with pytest.raises(PomonaError, match="unknown field `windows_px`"):
        StereoOdometry(CALIBRATION, {"odometry": {"pictures": {"windows_px": 3}}})


def test_a_scan_hands_its_settings_on(shared_data) -> None:
    recording = open_recording(shared_data / "rendered_row" / "2024-08-09")
    camera = pose_source_of(recording, odometry=True, config={"odometry": {"min_inliers": 100_000}})
    place = camera(next(iter(recording.frames())))
    assert place.session_from_camera is None
    assert (place.broken or "").endswith("expected at least 100000")


@pytest.mark.parametrize("date", ["2024-08-09", "2024-08-28"])
def test_the_rendered_row(shared_data, date: str) -> None:
    recording = open_recording(shared_data / "rendered_row" / date)
    odometry = StereoOdometry(recording.calibration)
    true = []
    for frame, _ in zip(recording.frames(), range(12), strict=False):
        odometry(*(cv2.cvtColor(read(), cv2.COLOR_BGR2GRAY) for read in (frame.read_left, frame.read_right)))
        true.append(frame.session_from_camera)
    trajectory = odometry.trajectory()
    np.testing.assert_array_equal(trajectory.parts, np.zeros(12))
    shift, turn = shift_and_turn(trajectory.session_from_camera[-1], np.linalg.inv(true[0]) @ true[-1])
    # A random walk of eleven steps of 3 mm and 2 mrad, three sigma of it.
    assert shift < 0.03
    assert turn < 0.02
