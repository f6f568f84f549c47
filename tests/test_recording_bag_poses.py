"""Poses in bags: odometry of the robot's body becomes poses of its left camera, or is not used and that is said."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bag_maker import START_NS, STEP_NS, info, odometry, stereo, tf, write_bag
from pomona import PomonaError, PomonaWarning
from pomona.recording import open_recording

OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
"""Rotation of an optical frame against x forward, y left, z up (REP 103)."""


def pose(place=(0.0, 0, 0), turn=(0.0, 0, 0), rotation=None):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(turn).as_matrix() if rotation is None else rotation
    matrix[:3, 3] = place
    return matrix


BASE_FROM_MOUNT = pose((0.5, -0.3, 1.2), (0, 0, -np.pi / 2))
MOUNT_FROM_CAMERA = pose(rotation=OPTICAL)
BASE_FROM_CAMERA = BASE_FROM_MOUNT @ MOUNT_FROM_CAMERA


def odom_from_base(at_ns):
    """A vehicle that drives at 1 m/s and turns at 0.2 rad/s."""
    passed_s = (at_ns - START_NS) / 1e9
    return pose((passed_s, 0.1 * passed_s, 0), (0, 0, 0.2 * passed_s))


def statics(topic="/tf_static"):
    at = START_NS - 10**9
    return [
        tf(topic, at, ("base_link", "mount", BASE_FROM_MOUNT)),
        tf(topic, at, ("/mount", "/cam", MOUNT_FROM_CAMERA), ("base_link", "gps", pose((1, 2, 3)))),
    ]


def times_ns(n_frames=6, step_ns=40_000_000):
    """More often than the pictures, and never at the time of one."""
    return range(START_NS - 10_000_000, START_NS + n_frames * STEP_NS, step_ns)


# Between two poses the camera goes straight and not in an arc: 0.6 m (0.2 rad/s * 0.04 s)^2 / 8.
SAG_M = 5e-6


def assert_poses(recording, expected=lambda at_ns: odom_from_base(at_ns) @ BASE_FROM_CAMERA):
    assert len(recording) == 6
    for frame in recording.frames():
        at_ns = START_NS + frame.number * STEP_NS
        np.testing.assert_allclose(frame.session_from_camera, expected(at_ns), atol=SAG_M)
    assert recording.description()["poses"] is True
    assert recording.trajectory.frames.tolist() == list(range(6))


@pytest.mark.parametrize("form", ["ros1", "sqlite3", "mcap"])
def test_odometry_of_the_body_becomes_poses_of_the_camera(tmp_path, form):
    entries = stereo(6) + statics() + [odometry("/odom", at, odom_from_base(at)) for at in times_ns()]
    assert_poses(open_recording(write_bag(tmp_path / "row", entries, form)))


@pytest.mark.parametrize("form", ["ros1", "mcap"])
def test_the_tree_of_transforms(tmp_path, form):
    entries = stereo(6) + statics() + [tf("/tf_static", START_NS, ("map", "odom", pose((10, 0, 0))))]
    entries += [
        tf("/tf", at, ("odom", "base_link", odom_from_base(at)), ("base_link", "wheel", pose())) for at in times_ns()
    ]
    recording = open_recording(write_bag(tmp_path / "row", entries, form))
    assert_poses(recording, lambda at_ns: pose((10, 0, 0)) @ odom_from_base(at_ns) @ BASE_FROM_CAMERA)


def test_a_tree_with_two_joints_is_not_used(tmp_path):
    entries = stereo(3) + statics()
    for at in times_ns(3):
        entries.append(tf("/tf", at, ("odom", "base_link", odom_from_base(at)), ("map", "odom", pose((1, 0, 0)))))
    with pytest.warns(PomonaWarning, match="several joints move between map and the camera"):
        assert open_recording(write_bag(tmp_path / "row", entries, "mcap")).trajectory is None


def test_a_tree_without_a_world_says_nothing(tmp_path):
    entries = stereo(3) + statics() + [tf("/tf", at, ("base_link", "arm", pose())) for at in times_ns(3)]
    assert open_recording(write_bag(tmp_path / "row", entries, "mcap")).trajectory is None


def test_odometry_without_a_way_to_the_camera_is_not_used(tmp_path):
    entries = stereo(3) + [odometry("/odom", at, odom_from_base(at)) for at in times_ns(3)]
    bag = write_bag(tmp_path / "row", entries, "ros1")
    with pytest.warns(PomonaWarning, match="/odom: poses are of base_link, and /tf_static does not lead .* not used"):
        assert open_recording(bag).trajectory is None
    assert open_recording(bag, topics={"poses": "none"}).trajectory is None


def test_odometry_of_the_camera_itself_needs_no_frames(tmp_path):
    entries = stereo(6) + [odometry("/vio", at, odom_from_base(at), child="/cam") for at in times_ns()]
    assert_poses(open_recording(write_bag(tmp_path / "row", entries, "ros1")), odom_from_base)


def test_of_several_odometries_one_is_chosen_by_hand(tmp_path):
    entries = stereo(6) + statics()
    entries += [odometry("/wheels", at, pose((9, 9, 9))) for at in times_ns()]
    entries += [odometry("/visual", at, odom_from_base(at)) for at in times_ns()]
    bag = write_bag(tmp_path / "row", entries, "mcap")
    with pytest.warns(PomonaWarning, match="odometry on /visual, /wheels, none is used: choose with --topics poses="):
        assert open_recording(bag).trajectory is None
    assert_poses(open_recording(bag, topics={"poses": "/visual"}))


def test_stamped_poses_are_the_cameras_when_they_are_given(tmp_path):
    entries = stereo(6) + [odometry("/slam/pose", at, odom_from_base(at), child="") for at in times_ns()]
    bag = write_bag(tmp_path / "row", entries, "sqlite3")
    with pytest.warns(PomonaWarning, match="found poses on /slam/pose that do not say of what: not used"):
        assert open_recording(bag).trajectory is None
    with pytest.warns(PomonaWarning, match="/slam/pose: poses do not say of which frame: taken as the left camera's"):
        recording = open_recording(bag, topics={"poses": "/slam/pose"})
    assert_poses(recording, odom_from_base)


def test_frames_without_a_pose_are_left_out_and_told(tmp_path):
    entries = stereo(6) + statics()
    entries += [odometry("/odom", at, odom_from_base(at)) for at in times_ns() if at > START_NS + 2 * STEP_NS]
    with pytest.warns(PomonaWarning, match="3 of 6 frames have no pose"):
        recording = open_recording(write_bag(tmp_path / "row", entries, "mcap"))
    assert recording.numbers == (3, 4, 5)
    assert [frame.number for frame in recording.frames()] == [3, 4, 5]


def test_poses_of_another_clock_and_of_another_kind(tmp_path):
    entries = stereo(2) + statics() + [odometry("/odom", at + 10**13, odom_from_base(at)) for at in times_ns(2)]
    bag = write_bag(tmp_path / "row", entries, "mcap")
    with pytest.raises(PomonaError, match="found no pose at the time of any picture"):
        open_recording(bag)
    with pytest.raises(
        PomonaError, match="/stereo/left/camera_info: found sensor_msgs/msg/CameraInfo, expected Odometry"
    ):
        open_recording(bag, topics={"poses": "/stereo/left/camera_info"})


def test_poses_are_those_of_the_rectified_camera(tmp_path):
    """A raw picture is turned by R when it is rectified, and so is its pose."""
    turn = Rotation.from_rotvec([0, 0.05, 0]).as_matrix()
    entries = statics() + [odometry("/odom", at, odom_from_base(at)) for at in times_ns()]
    for topic, at, kind, fields in stereo(6):
        if topic.endswith("camera_info"):
            shift = fields["P"][3]
            entries.append(info(topic, at, shift, R=turn.ravel()))
        else:
            entries.append((topic.replace("image_rect_color", "image_raw"), at, kind, fields))
    rectified_from_camera = pose(rotation=turn)
    recording = open_recording(write_bag(tmp_path / "row", entries, "ros1"))
    assert_poses(recording, lambda at_ns: odom_from_base(at_ns) @ BASE_FROM_CAMERA @ rectified_from_camera.T)


def test_the_baseline_can_come_from_the_frames_of_reference(tmp_path):
    """A driver that leaves P at zero, with its cameras in /tf_static."""
    entries = []
    for topic, at, kind, fields in stereo(2):
        fields["frame_id"] = "left_optical" if "left" in topic else "right_optical"
        if topic.endswith("camera_info"):
            fields["P"] = np.zeros(12)
        entries.append((topic, at, kind, fields))
    entries.append(tf("/tf_static", START_NS, ("left_optical", "right_optical", pose((0.07, 0, 0)))))
    assert open_recording(write_bag(tmp_path / "row", entries, "mcap")).calibration.baseline_m == pytest.approx(0.07)


LOST = np.full((4, 4), np.nan)
"""What odometry says that has lost its way."""


@pytest.mark.parametrize("told", ["odometry", "tree"])
def test_poses_that_are_no_numbers_are_left_out(tmp_path, told):
    turned, far = pose(), pose((np.inf, 0.0, 0.0))
    turned[3] = np.nan
    entries = [*stereo(), *statics()]
    for row, at in enumerate(times_ns()):
        say = {2: LOST, 5: turned, 8: far}.get(row, odom_from_base(at))
        entries.append(odometry("/odom", at, say) if told == "odometry" else tf("/tf", at, ("odom", "base_link", say)))
    entries.append(tf("/tf_static", START_NS - 10**9, ("base_link", "imu", LOST)))
    recording = open_recording(write_bag(tmp_path / "bag", entries, "ros2 mcap"))
    assert recording.trajectory is not None
    assert np.isfinite(recording.trajectory.session_from_camera).all()
    true = np.array([odom_from_base(START_NS + row * STEP_NS) @ BASE_FROM_CAMERA for row in recording.numbers])
    assert np.abs(recording.trajectory.session_from_camera - true).max() < 0.02


def test_a_tree_whose_frames_go_in_a_circle_says_nothing(tmp_path):
    motion = [tf("/tf", at, ("odom", "base_link", odom_from_base(at))) for at in times_ns()]
    circle = tf("/tf_static", START_NS - 10**9, ("base_link", "odom", pose()))
    recording = open_recording(write_bag(tmp_path / "bag", [*stereo(), *statics(), *motion, circle], "ros2 mcap"))
    assert recording.trajectory is None
