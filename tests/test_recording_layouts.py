"""KITTI, TUM RGB-D and EuRoC layouts, and every way they break."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

import refusal
from pomona import PomonaWarning
from pomona.cloud import FruitCloud
from pomona.detect.from_file import FileDetector
from pomona.orchard import load_session
from pomona.recording import open_recording
from pomona.recording.checks.readable import checked
from pomona.scanning import SUFFIXES
from pomona.survey import scan
from recording_maker import FIELDS, FRUITS, make_recording

SENSOR = """#Default imu sensor yaml file
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)

T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, {x},
         0.0, 1.0, 0.0, 0.0,
         0.0, 0.0, 1.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [64, 48]
camera_model: pinhole
intrinsics: [60.0, 60.0, 31.5, 23.5] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [{k1}, 0.0, 0.0, 0.0]
"""


def refused(path, *parts):
    refusal.refused(lambda: open_recording(path), *parts)


@pytest.fixture
def kitti(shared_data, tmp_path):
    """The first five pairs of the real recording."""
    source, folder = shared_data / "kitti_stereo", tmp_path / "kitti"
    for side in ("image_l", "image_r"):
        (folder / side).mkdir(parents=True)
        for number in range(5):
            shutil.copyfile(source / side / f"{number:06d}.png", folder / side / f"{number:06d}.png")
    shutil.copyfile(source / "calib.txt", folder / "calib.txt")
    (folder / "poses.txt").write_text("\n".join((source / "poses.txt").read_text().splitlines()[:5]) + "\n")
    return folder


def test_kitti_gives_pairs_and_poses(shared_data):
    recording = open_recording(shared_data / "kitti_stereo")
    found = recording.description()
    assert (found["kind"], found["frames"], found["rate_hz"]) == ("KITTI folder", 51, None)
    assert found["baseline_m"] == pytest.approx(379.8145 / 707.0912)
    assert recording.calibration.cx == 601.8873 + 0.5
    frame = list(recording.frames())[1]
    np.testing.assert_allclose(frame.session_from_camera[:3, 3], [-0.01401751, -0.02820321, 1.198998])
    assert frame.read_left().shape == frame.read_right().shape == (370, 1226, 3)


def test_the_real_pairs_match_along_rows(kitti):
    """Features of left and right lie on one row and left ones farther right: the pair is a pair, and not swapped."""
    frame = next(open_recording(kitti).frames())
    orb, matcher = cv2.ORB_create(800), cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)
    (left, left_codes), (right, right_codes) = (
        orb.detectAndCompute(read(), None) for read in (frame.read_left, frame.read_right)
    )
    pairs = np.array([[*left[m.queryIdx].pt, *right[m.trainIdx].pt] for m in matcher.match(left_codes, right_codes)])
    good = np.abs(pairs[:, 1] - pairs[:, 3]) < 2
    assert good.mean() > 0.7
    assert (pairs[good, 0] - pairs[good, 2] > 0).mean() > 0.95


def test_kitti_with_names_and_times(kitti):
    lines = (kitti / "calib.txt").read_text().split("\n")[:2]
    (kitti / "image_l").rename(kitti / "image_2")
    (kitti / "image_r").rename(kitti / "image_3")
    left = lines[0].split()
    left[3] = "70.70912"
    (kitti / "calib.txt").write_text(f"P0: {lines[0]}\nP1: {lines[1]}\nP2: {' '.join(left)}\nP3: {lines[1]}\n")
    (kitti / "times.txt").write_text("0\n0.1\n0.2\n0.3\n0.4\n")
    recording = open_recording(kitti)
    assert recording.description()["rate_hz"] == pytest.approx(10)
    assert recording.calibration.baseline_m == pytest.approx((70.70912 + 379.8145) / 707.0912)
    np.testing.assert_allclose(recording.trajectory.session_from_camera[0, :3, 3], [-0.1, 0, 0], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (lambda f: (f / "image_r" / "000003.png").unlink(), ["5 pictures", "and 4", "frame 3"]),
        (lambda f: shutil.rmtree(f / "image_r"), ["0 in image_r/"]),
        (lambda f: (f / "calib.txt").write_text("1 2 3\n4 5 6\n"), ["calib.txt", "found 3 numbers, expected 12"]),
        (lambda f: (f / "calib.txt").write_text("\n"), ["found 0 projections"]),
        (lambda f: (f / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n"), ["found 1 poses", "5 frames"]),
        (lambda f: (f / "poses.txt").write_text("2 0 0 0 0 1 0 0 0 0 1 0\n" * 5), ["stretch"]),
        (lambda f: (f / "times.txt").write_text("0 1 2 1.5 3"), ["times.txt", "line 4", "1.5 s does not come after"]),
    ],
)
def test_a_broken_kitti_folder_is_refused(kitti, change, parts):
    change(kitti)
    refused(kitti, *parts)


def test_kitti_baselines_that_are_none(kitti):
    left, right = (kitti / "calib.txt").read_text().split("\n")[:2]
    (kitti / "calib.txt").write_text(f"{left}\n{left}\n")
    refused(kitti, "calib.txt", "no baseline")
    (kitti / "calib.txt").write_text(f"{right}\n{left}\n")
    refused(kitti, "swap left and right")
    (kitti / "calib.txt").write_text(f"{left}\n{right.replace('-3.798145000000e+02', '-379814.5')}\n")
    refused(kitti, "baseline of 537.151", "looks like millimetres")


def test_a_corrupt_picture_is_counted_and_named(kitti):
    picture = kitti / "image_r" / "000002.png"
    picture.write_bytes(picture.read_bytes()[:5000])
    (kitti / "image_l" / "000004.png").write_bytes(b"")
    bad = checked(open_recording(kitti)).unreadable
    assert list(bad) == [2, 4]
    assert "000002.png: the PNG is cut off" in bad[2]


@pytest.fixture
def tum(tmp_path):
    """The made recording of three frames, in TUM's layout."""
    made = make_recording(tmp_path / "made", (0.0, 0.1, 0.2))
    folder = tmp_path / "2024-08-09"
    (folder / "rgb").mkdir(parents=True)
    (made / "depth").rename(folder / "depth")
    for name in ("calibration.json", "detections.csv"):
        shutil.copyfile(made / name, folder / name)
    (folder / "calibration.json").write_text(json.dumps({**FIELDS, "depth_unit_m": 0.001}))
    for number in range(3):
        cv2.imwrite(str(folder / "rgb" / f"{number}.png"), np.full((480, 640, 3), 40 * number, np.uint8))
    lines = {
        "rgb": [f"{100 + 0.1 * n:.3f} rgb/{n}.png" for n in range(3)],
        "depth": [f"{100.006 + 0.1 * n:.3f} depth/{n:04d}.png" for n in range(3)],
        "groundtruth": [f"{99.95 + 0.05 * n:.3f} {0.05 * n - 0.05:.3f} 0 0 0 0 0 1" for n in range(7)],
    }
    for name, rows in lines.items():
        (folder / f"{name}.txt").write_text("# a comment\n" + "\n".join(rows) + "\n")
    return folder


def test_tum_associates_by_time(tum):
    recording = open_recording(tum)
    found = recording.description()
    assert (found["kind"], found["frames"]) == ("TUM RGB-D folder", 3)
    assert found["rate_hz"] == pytest.approx(10)
    frame = list(recording.frames())[2]
    assert frame.time_s == pytest.approx(100.2)
    assert frame.read_left().mean() == 80
    assert frame.read_depth().max() == pytest.approx(3.0)
    assert frame.read_right is None
    np.testing.assert_allclose(frame.session_from_camera[:3, 3], [0.2, 0, 0], atol=1e-6)


def test_tum_depth_is_in_its_own_unit_unless_told(tum):
    (tum / "calibration.json").write_text(json.dumps(FIELDS))
    assert open_recording(tum).calibration.depth_unit_m == 1 / 5000


def test_a_tum_recording_is_scanned(tum):
    recording = open_recording(tum)
    detector = FileDetector.read(tum / "detections.csv", recording.calibration, recording.recorded_numbers)
    cloud = scan(recording, detector).cloud
    assert cloud.ids == tuple(FRUITS)
    np.testing.assert_allclose(cloud.positions, [fruit.centre for fruit in FRUITS.values()], atol=0.001)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_command_scans_a_tum_recording(pomona, tum, tmp_path, suffix):
    output = tmp_path / f"session{suffix}"
    code, printed, told = pomona("scan", tum, "-o", output)
    assert (code, told) == (0, "")
    assert "3 fruits" in printed
    if suffix == ".gpkg":
        session = load_session(output)
        assert (session.cloud.ids, session.date) == (tuple(FRUITS), "2024-08-09")
        assert "groundtruth.txt" in session.input_hashes
    else:
        assert FruitCloud.read(output).ids == tuple(FRUITS)


def test_tum_pictures_without_a_partner_are_left_out_and_told(tum):
    lines = (tum / "depth.txt").read_text().splitlines()
    (tum / "depth.txt").write_text("\n".join([lines[1], lines[3]]))
    with pytest.warns(PomonaWarning, match="1 of 3 colour pictures have no depth within 0.02 s"):
        recording = open_recording(tum)
    assert recording.numbers == (0, 2)
    assert [file.name for file in recording.pictures["depth"]] == ["0000.png", "0002.png"]


def test_tum_frames_without_a_pose_are_left_out_and_told(tum):
    lines = (tum / "groundtruth.txt").read_text().splitlines()
    (tum / "groundtruth.txt").write_text("\n".join(lines[:5]))
    with pytest.warns(PomonaWarning, match="1 of 3 frames have no pose"):
        assert len(open_recording(tum)) == 2
    (tum / "groundtruth.txt").write_text("0 0 0 0 0 0 0 1\n")
    refused(tum, "groundtruth.txt", "no pose at the time of any picture")


@pytest.mark.parametrize(
    ("name", "text", "parts"),
    [
        ("rgb.txt", "100.0 rgb/0.png\n99.9 rgb/1.png\n", ["rgb.txt: line 2", "99.900000 s does not come after"]),
        ("rgb.txt", "100.0\n", ["line 1", "expected a time and a file"]),
        ("depth.txt", "# nothing\n", ["0 in depth.txt"]),
        ("depth.txt", "500.0 depth/0000.png\n", ["no colour and depth within"]),
    ],
)
def test_a_broken_tum_list_is_refused(tum, name, text, parts):
    (tum / name).write_text(text)
    refused(tum, *parts)


def test_a_tum_folder_needs_a_calibration(tum):
    (tum / "calibration.json").rename(tum / "camera.txt")
    refused(tum, "calibration: found none", "calibration.json")


@pytest.fixture
def euroc(tmp_path):
    """Three pairs; poses go 1 m/s along x."""
    root = tmp_path / "V1" / "mav0"
    start_ns = 1403636579763555584
    times_ns = [start_ns + 50_000_000 * row for row in range(3)]
    for camera, x in (("cam0", 0.0), ("cam1", 0.11)):
        (root / camera / "data").mkdir(parents=True)
        (root / camera / "sensor.yaml").write_text(SENSOR.format(x=x, k1=0.0))
        (root / camera / "data.csv").write_text(
            "#timestamp [ns],filename\r\n" + "".join(f"{t},{t}.png\r\n" for t in times_ns)
        )
        for time_ns in times_ns:
            cv2.imwrite(str(root / camera / "data" / f"{time_ns}.png"), np.full((48, 64), 90, np.uint8))
    truth = root / "state_groundtruth_estimate0"
    truth.mkdir()
    known = [start_ns + 5_000_000 * row for row in range(-1, 30)]
    lines = [f"{t},{(t - start_ns) / 1e9},0,0,1,0,0,0,0,0,0" for t in known]
    (truth / "data.csv").write_text("#timestamp, p_RS_R_x [m]\n" + "\n".join(lines))
    return tmp_path / "V1"


def test_euroc_gives_pairs_and_poses(euroc):
    recording = open_recording(euroc)
    found = recording.description()
    assert (found["kind"], found["frames"]) == ("EuRoC folder", 3)
    assert found["rate_hz"] == pytest.approx(20, rel=1e-4)
    assert found["baseline_m"] == pytest.approx(0.11)
    assert (recording.calibration.fx, recording.calibration.cx) == (60.0, 32.0)
    frames = list(recording.frames())
    np.testing.assert_allclose([f.session_from_camera[0, 3] for f in frames], [0, 0.05, 0.1], atol=1e-6)
    assert frames[0].read_left().shape == (48, 64, 3)
    assert len(open_recording(euroc / "mav0")) == 3


def test_info_prints_what_shows_a_wrong_unit(pomona, kitti):
    code, printed, _ = pomona("info", kitti)
    assert code == 0
    # 1.5 m squared / (707 px * 0.537 m) * 0.5 px
    assert "depth_error_m  0.00296 (at 1.5 m, disparity to 0.5 px)" in printed
    assert "kind           KITTI folder" in printed
    found = json.loads(pomona("info", kitti, "--json")[1])
    assert found["depth_error_m"] == pytest.approx(1.5**2 / 379.8145 * 0.5)
    assert (found["frames"], found["pictures"]) == (5, {"left": 5, "right": 5})


def test_info_checks_every_picture(pomona, kitti):
    # The exit code is 1 for the bend that KITTI's rectification leaves.
    assert json.loads(pomona("info", kitti, "--check", "--json")[1])["unreadable"] == []
    picture = kitti / "image_r" / "000002.png"
    picture.write_bytes(picture.read_bytes()[:5000])
    code, printed, _ = pomona("info", kitti, "--check")
    assert code == 1
    assert "unreadable     1\n" in printed
    assert "000002.png: the PNG is cut off" in printed
    assert json.loads(pomona("info", kitti, "--check", "--json")[1])["unreadable"][0]["frame"] == 2


def test_scan_says_in_one_line_that_boxes_are_not_there(pomona, kitti, tmp_path):
    code, printed, told = pomona("scan", kitti, "-o", tmp_path / "fruits.csv", "--detections", tmp_path / "boxes.csv")
    assert (code, printed, told.count("\n")) == (2, "", 1)
    assert "boxes.csv: not found" in told
    assert not (tmp_path / "fruits.csv").exists()


def test_euroc_pictures_are_rectified(euroc):
    for camera, x in (("cam0", 0.0), ("cam1", 0.11)):
        (euroc / "mav0" / camera / "sensor.yaml").write_text(SENSOR.format(x=x, k1=-0.1))
    recording = open_recording(euroc)
    assert recording.optics.left_maps is not None
    assert recording.calibration.baseline_m == pytest.approx(0.11)
    assert next(recording.frames()).read_right().shape == (48, 64, 3)


def test_euroc_pictures_without_a_partner_are_left_out_and_told(euroc):
    table = euroc / "mav0" / "cam1" / "data.csv"
    lines = table.read_text().splitlines()
    table.write_text("\n".join(lines[:2] + lines[3:]))
    with pytest.warns(PomonaWarning, match="1 picture of cam0 and cam1 without a partner"):
        assert open_recording(euroc).numbers == (0, 2)


@pytest.mark.parametrize(
    ("file", "text", "parts"),
    [
        ("cam0/data.csv", "20,a.png\n10,b.png\n", ["line 2", "time 10 ns does not come after 20 ns"]),
        ("cam0/data.csv", "20.5,a.png\n", ["line 1", "expected nanoseconds,file"]),
        ("cam1/data.csv", "20,a.png\n", ["no time that is in both"]),
        ("cam1/sensor.yaml", SENSOR.format(x=0.0, k1=0), ["no baseline"]),
        ("cam1/sensor.yaml", SENSOR.format(x=110, k1=0), ["looks like millimetres"]),
        ("cam1/sensor.yaml", SENSOR.format(x=0.11, k1=0).replace("T_BS", "T"), ["T_BS: missing"]),
        ("state_groundtruth_estimate0/data.csv", "20,0,0,0,2,0,0,0\n", ["line 1", "unit quaternion"]),
    ],
)
def test_a_broken_euroc_folder_is_refused(euroc, file, text, parts):
    (euroc / "mav0" / file).write_text(text)
    refused(euroc, *parts)


def test_euroc_needs_both_cameras(euroc):
    shutil.rmtree(euroc / "mav0" / "cam1")
    refused(euroc, "cam1", "not found")


@pytest.mark.parametrize(
    ("layout", "poses"),
    [("kitti", "poses.txt"), ("tum", "groundtruth.txt"), ("euroc", "mav0/state_groundtruth_estimate0/data.csv")],
)
def test_poses_that_nobody_wants_may_be_broken(request, layout, poses):
    folder = request.getfixturevalue(layout)
    (folder / poses).write_text("1 2 nonsense\n")
    refused(folder, Path(poses).name)
    opened = open_recording(folder, own_poses=False)
    assert opened.trajectory is None
    assert next(opened.frames()).session_from_camera is None
    assert folder / poses not in set(opened.inputs())


def test_what_is_accepted_is_listed(tmp_path):
    (tmp_path / "notes.md").write_text("")
    refused(tmp_path, "found notes.md", "KITTI", "TUM RGB-D", "EuRoC", "side-by-side video", "left.mp4")
    refused(tmp_path / "notes.md", "found a file", "side-by-side video")
