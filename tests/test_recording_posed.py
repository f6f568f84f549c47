"""Poses of a file of their own: TUM by time, KITTI line by line, for any kind of recording."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bag_maker import START_NS, stereo, write_bag
from pomona import PomonaError, PomonaWarning
from pomona.detect.opening import open_detector
from pomona.recording import open_recording, selected
from recording_maker import make_recording
from test_recording_video import write_calibration, write_video


def pose(at_s):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec([0, 0.1 * at_s, 0]).as_matrix()
    matrix[:3, 3] = (at_s, 0.2 * at_s, 0)
    return matrix


def write_tum(path, times_s, start_s=0.0):
    lines = []
    for at_s in times_s:
        numbers = [start_s + at_s, *pose(at_s)[:3, 3], *Rotation.from_matrix(pose(at_s)[:3, :3]).as_quat()]
        lines.append(" ".join(f"{number:.9f}" for number in numbers))
    path.write_text("# time tx ty tz qx qy qz qw\n" + "\n".join(lines) + "\n")
    return path


def write_kitti(path, times_s):
    lines = [" ".join(f"{number:.9e}" for number in pose(at_s)[:3].ravel()) for at_s in times_s]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def video(tmp_path):
    """Twelve frames, ten a second from 0."""
    write_calibration(tmp_path)
    return write_video(tmp_path / "row.mkv")


def assert_poses(recording, numbers):
    assert recording.numbers == tuple(numbers)
    frames = list(recording.frames())
    assert [frame.number for frame in frames] == list(numbers)
    for frame in frames:
        np.testing.assert_allclose(frame.session_from_camera, pose(frame.number / 10), atol=1e-6)
        assert frame.read_left().mean() == pytest.approx(10 * frame.number, abs=3)
    assert recording.trajectory.frames.tolist() == list(numbers)
    assert len(recording) == recording.description()["frames"] == recording.description()["pictures"]["left"]


def test_tum_poses_are_interpolated_at_the_times_of_the_pictures(pomona, video, tmp_path):
    poses = write_tum(tmp_path / "poses.txt", np.arange(-0.03, 1.3, 0.05))
    recording = open_recording(video, poses=poses)
    assert_poses(recording, range(12))
    assert poses in list(recording.inputs())
    code, printed, errors = pomona("info", video, "--poses", poses, "--check")
    assert code == 0, errors
    assert "poses          yes" in printed


def test_frames_without_a_pose_are_left_out_and_told(video, tmp_path):
    poses = write_tum(tmp_path / "poses.txt", np.arange(0.28, 0.85, 0.05))
    with pytest.warns(PomonaWarning, match=r"poses\.txt: 6 of 12 frames have no pose within 0.1 s"):
        recording = open_recording(video, poses=poses)
    assert_poses(recording, range(3, 9))
    assert [frame.number for frame in selected(recording, every=2).frames()] == [3, 5, 7]
    assert [frame.number for frame in recording.frames([1, 4])] == [4]


def test_kitti_poses_are_one_a_frame(video, tmp_path):
    assert_poses(open_recording(video, poses=write_kitti(tmp_path / "poses.txt", np.arange(12) / 10)), range(12))
    with pytest.raises(PomonaError, match="found 11 poses, expected one for each of the 12 frames"):
        open_recording(video, poses=write_kitti(tmp_path / "poses.txt", np.arange(11) / 10))


def test_another_clock_with_one_pose_a_frame_is_taken_in_order(video, tmp_path):
    poses = write_tum(tmp_path / "poses.txt", np.arange(12) / 10, start_s=1e6)
    with pytest.warns(PomonaWarning, match="no pose at the time of any picture: taken one for each frame, in order"):
        recording = open_recording(video, poses=poses)
    assert_poses(recording, range(12))
    with pytest.raises(PomonaError, match="found no pose at the time of any picture, expected the same clock"):
        open_recording(video, poses=write_tum(tmp_path / "poses.txt", np.arange(11) / 10, start_s=1e6))


def test_a_bag_and_a_folder_take_poses(tmp_path):
    bag = write_bag(tmp_path / "row", stereo(4), "mcap")
    poses = write_tum(tmp_path / "poses.txt", np.arange(-0.05, 0.5, 0.02), start_s=START_NS / 1e9)
    for frame in open_recording(bag, poses=poses).frames():
        np.testing.assert_allclose(frame.session_from_camera, pose(frame.number / 10), atol=1e-6)
    folder = make_recording(tmp_path / "folder", (0.0, 0.1), poses=False)
    recording = open_recording(folder, poses=write_tum(tmp_path / "poses.txt", [5.0, 6.0]))
    assert recording.times_s.tolist() == [5.0, 6.0]
    assert recording.trajectory.session_from_camera[:, 0, 3].tolist() == [5.0, 6.0]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("1 2 3\n", ["line 1: found 3 numbers, expected time tx ty tz qx qy qz qw"]),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0\n", ["line 2: found 3 numbers, expected 12"]),
        ("2 0 0 0 0 1 0 0 0 0 1 0\n", ["a pose that does not turn but stretch"]),
        ("", ["found no pose at the time of any picture"]),
    ],
)
def test_what_holds_no_poses_is_refused(video, tmp_path, text, parts):
    (tmp_path / "poses.txt").write_text(text)
    with pytest.raises(PomonaError) as caught:
        open_recording(video, poses=tmp_path / "poses.txt")
    assert all(part in str(caught.value) for part in ["poses.txt", *parts])


def test_poses_that_are_not_there(video, tmp_path):
    with pytest.raises(PomonaError, match=r"none\.txt: not found"):
        open_recording(video, poses=tmp_path / "none.txt")


def test_times_in_whole_milliseconds_are_those_of_the_pictures(tmp_path):
    write_calibration(tmp_path)
    video = write_video(tmp_path / "row.mkv")
    poses = tmp_path / "poses.txt"
    poses.write_text("".join(f"{at_s + 0.001:.3f} {at_s} 0 0 0 0 0 1\n" for at_s in np.arange(12) / 10))
    recording = open_recording(video, poses=poses)  # the first pose is a millisecond after the first picture
    assert recording.numbers == tuple(range(12))
    np.testing.assert_allclose(recording.trajectory.session_from_camera[:, 0, 3], np.arange(12) / 10, atol=0.002)
    poses.write_text("".join(f"{at_s} {at_s} 0 0 0 0 0 1\n" for at_s in (0.0, 0.4, 0.8)))  # no two of them 0.1 s apart
    with pytest.warns(PomonaWarning, match="9 of 12 frames have no pose within 0.1 s"):
        assert open_recording(video, poses=poses).numbers == (0, 4, 8)


def test_poses_of_ten_a_second_reach_pictures_of_ten_a_second(video, tmp_path):
    poses = write_tum(tmp_path / "poses.txt", 0.05 + np.arange(-1, 13) / 10)  # 0.1 s apart, or a bit more in floats
    assert_poses(open_recording(video, poses=poses), range(12))


def test_pictures_in_milliseconds_and_poses_in_seconds_are_told_apart(tmp_path):
    folder = make_recording(tmp_path / "2024-08-09", (0.0, 0.1, 0.2, 0.3, 0.4))
    (folder / "times.txt").write_text("0\n100\n200\n300\n400\n")
    (folder / "poses_tum.txt").write_text("".join(f"{at_s} {at_s} 0 0 0 0 0 1\n" for at_s in np.arange(5) / 10))
    with pytest.raises(PomonaError, match="expected seconds in both: those of the pictures look like milliseconds"):
        open_recording(folder)
    (folder / "times.txt").write_text("0.0\n0.1\n0.2\n0.3\n0.4\n")
    (folder / "poses_tum.txt").write_text("".join(f"{at} {at} 0 0 0 0 0 1\n" for at in np.arange(5) * 1e8))
    with pytest.raises(PomonaError, match="those of the poses look like nanoseconds"):
        open_recording(folder)


def test_boxes_are_those_of_all_frames_whether_they_have_poses_or_not(pomona, tmp_path):
    folder = make_recording(tmp_path / "2024-08-09", (0.0, 0.1, 0.2, 0.3, 0.4))
    (folder / "times.txt").write_text("0.0\n0.1\n0.2\n0.3\n0.4\n")
    (folder / "poses_tum.txt").write_text("".join(f"{at_s} {at_s} 0 0 0 0 0 1\n" for at_s in (0.1, 0.2, 0.3)))
    code, printed, told = pomona("scan", folder, "-o", tmp_path / "row.csv")
    assert (code, told.count("\n")) == (0, 1), told
    assert "2 of 5 frames have no pose within 0.1 s and are left out" in told
    assert "3 fruits" in printed
    with pytest.warns(PomonaWarning, match="2 of 5 frames have no pose"):
        recording = open_recording(folder)
    assert (recording.numbers, recording.recorded_numbers) == ((1, 2, 3), (0, 1, 2, 3, 4))
    (tmp_path / "boxes.txt").write_text("2,1,10,20,20,25\n")  # the second frame, in order of time
    boxes = open_detector(tmp_path / "boxes.txt", None, recording)
    assert [len(boxes(frame)) for frame in recording.frames()] == [1, 0, 0]


def test_a_folder_with_times_takes_its_own_poses_by_time(tmp_path):
    folder = make_recording(tmp_path / "folder", (0.0, 0.1, 0.2, 0.3), poses=False)
    write_tum(folder / "poses_tum.txt", np.arange(1.05, 1.26, 0.05))
    with pytest.raises(PomonaError, match=r"found 5 poses, expected one for each of the 4 frames, or .* times\.txt"):
        open_recording(folder)
    (folder / "times.txt").write_text("1.0\n1.1\n1.2\n1.3\n")
    with pytest.warns(PomonaWarning, match=r"poses_tum\.txt: 2 of 4 frames have no pose within 0.1 s"):
        recording = open_recording(folder)
    assert [(frame.number, frame.time_s) for frame in recording.frames()] == [(1, 1.1), (2, 1.2)]
    np.testing.assert_allclose(recording.trajectory.session_from_camera, [pose(1.1), pose(1.2)], atol=1e-6)
    assert {folder / "times.txt", folder / "poses_tum.txt"} <= set(recording.inputs())


BROKEN = "0.0 1 2\n0.1 nonsense\n"


def test_nothing_is_read_of_poses_that_are_overridden(pomona, tmp_path):
    folder = make_recording(tmp_path / "2024-08-09", (0.0, 0.1, 0.2))
    (folder / "poses_tum.txt").write_text(BROKEN)
    other = write_tum(tmp_path / "other.tum", [0.0, 0.1, 0.2])
    code, _, told = pomona("scan", folder, "-o", tmp_path / "own.csv")
    assert (code, "line 1: found 3 numbers" in told) == (2, True)
    code, _, told = pomona("scan", folder, "-o", tmp_path / "given.csv", "--poses", other)
    assert code == 0, told
    assert f"{folder / 'poses_tum.txt'}: times: found 2 numbers, expected 3" in told


def test_times_of_poses_that_are_overridden_are_still_those_of_the_frames(tmp_path):
    folder = make_recording(tmp_path / "row", (0.0, 0.1, 0.2))
    with pytest.warns(PomonaWarning, match="1 of 3 frames have no pose"):
        recording = open_recording(folder, poses=write_tum(tmp_path / "other.tum", [0.1, 0.2]))
    assert recording.numbers == (1, 2)
    assert folder / "poses_tum.txt" not in set(recording.inputs())
    (folder / "poses_tum.txt").unlink()
    with pytest.raises(PomonaError, match="found 2 poses, expected one for each of the 3 frames"):
        open_recording(folder, poses=tmp_path / "other.tum")


def test_a_bag_opens_without_its_poses(tmp_path):
    bag = write_bag(tmp_path / "row", stereo(4), "mcap")
    opened = open_recording(bag, own_poses=False)
    assert (opened.trajectory, len(opened)) == (None, 4)
    assert "poses=none" in str(opened.description()["topics"])
