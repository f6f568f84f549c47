"""Calibrations of other programs: read, rectified against a known scene, and refused."""

import json
import shutil

import cv2
import numpy as np
import pytest

import refusal
from pomona.recording import open_recording
from pomona.recording.calibration.rig_files import find_optics
from pomona.recording.calibration.rig_files.yaml_documents import read_documents

SIZE = (640, 480)
LEFT = np.array([[500.0, 0, 320], [0, 501, 240], [0, 0, 1]])
RIGHT = np.array([[498.0, 0, 318], [0, 499, 243], [0, 0, 1]])
LEFT_D = np.array([-0.12, 0.03, 0.0008, -0.0005, 0.0])
RIGHT_D = np.array([-0.11, 0.02, -0.0004, 0.0006, 0.0])
TURN = np.array([0.008, -0.015, 0.011])
SHIFT_M = np.array([-0.12, 0.002, -0.001])
ROTATION = cv2.Rodrigues(TURN)[0]


def write_opencv(folder, size=True, **changes):
    """As `stereo_calib` does: with OpenCV itself."""
    storage = cv2.FileStorage(str(folder / "stereo.yml"), cv2.FILE_STORAGE_WRITE)
    matrices = {"M1": LEFT, "D1": LEFT_D, "M2": RIGHT, "D2": RIGHT_D, "R": ROTATION, "T": SHIFT_M, **changes}
    for name, matrix in matrices.items():
        storage.write(name, np.atleast_2d(matrix))
    if size:
        storage.write("image_width", SIZE[0])
        storage.write("image_height", SIZE[1])
    storage.release()


def write_kalibr(folder, translation=SHIFT_M):
    """As Kalibr's writer does: lists at the indent of their key."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = ROTATION, translation
    rows = "".join(f"  - {row}\n" for row in pose.tolist())

    def camera(matrix, distortion):
        intrinsics = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
        return (
            f"  camera_model: pinhole\n  distortion_coeffs: {distortion[:4].tolist()}\n"
            f"  distortion_model: radtan\n  intrinsics: {[float(value) for value in intrinsics]}\n"
            "  resolution: [640, 480]\n  rostopic: /camera/image_raw\n"
        )

    text = f"cam0:\n  cam_overlaps: [1]\n{camera(LEFT, LEFT_D)}cam1:\n  T_cn_cnm1:\n{rows}{camera(RIGHT, RIGHT_D)}"
    (folder / "camchain.yaml").write_text(text)


def rectification():
    return cv2.stereoRectify(
        LEFT, LEFT_D, RIGHT, RIGHT_D, SIZE, ROTATION, SHIFT_M.reshape(3, 1), flags=cv2.CALIB_ZERO_DISPARITY, alpha=0
    )


def write_ros(folder, sides=("left", "right")):
    rotations = dict(zip(("left", "right"), rectification()[:2], strict=True))
    projections = dict(zip(("left", "right"), rectification()[2:4], strict=True))
    for side in sides:
        matrix, distortion = (LEFT, LEFT_D) if side == "left" else (RIGHT, RIGHT_D)
        blocks = {
            "camera_matrix": matrix,
            "distortion_coefficients": distortion[None],
            "rectification_matrix": rotations[side],
            "projection_matrix": projections[side],
        }
        text = f"image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo/{side}\ndistortion_model: plumb_bob\n"
        for name, block in blocks.items():
            rows, columns = block.shape
            numbers = [round(number, 12) for number in block.ravel().tolist()]
            text += f"{name}:\n  rows: {rows}\n  cols: {columns}\n  data: {numbers}\n"
        (folder / f"{side}.yaml").write_text(text)


def write_ros2_echo(folder):
    """As `ros2 topic echo` prints a message, twice."""
    found = rectification()
    for side, rotation, projection in zip(("left", "right"), found[:2], found[2:4], strict=True):
        matrix, distortion = (LEFT, LEFT_D) if side == "left" else (RIGHT, RIGHT_D)
        lists = {"d": distortion, "k": matrix, "r": rotation, "p": projection}
        numbers = "".join(
            f"{name}:\n" + "".join(f"- {x}\n" for x in values.ravel().tolist()) for name, values in lists.items()
        )
        body = (
            f"height: 480\nwidth: 640\ndistortion_model: plumb_bob\n{numbers}roi:\n  x_offset: 0\n  do_rectify: false\n"
        )
        stamps = (
            f"header:\n  stamp:\n    sec: {sec}\n    nanosec: 5\n  frame_id: {side}\n{body}---\n" for sec in (17, 18)
        )
        (folder / f"{side}_info.yaml").write_text("".join(stamps))


def write_zed(folder, section="VGA", size=(672, 376)):
    """Millimetres; the baseline is the way to the right camera."""
    scale = "fx=500\nfy=501\ncx={cx}\ncy={cy}\nk1=-0.12\nk2=0.03\np1=0.0\np2=0.0\nk3=0.0\n"
    text = "".join(
        f"[{side}_CAM_{section}]\n{scale.format(cx=size[0] / 2, cy=size[1] / 2 + more)}\n"
        for side, more in (("LEFT", 0), ("RIGHT", 3))
    )
    text += f"[STEREO]\nBaseline=119.9\nTY=0.2\nTZ=-0.3\nCV_{section}=0.011\nRX_{section}=0.004\nRZ_{section}=-0.002\n"
    (folder / "SN10027879.conf").write_text(text)


def write_colmap(folder, rig=True):
    from scipy.spatial.transform import Rotation

    cameras = [
        f"{number} OPENCV 640 480 {m[0, 0]} {m[1, 1]} {m[0, 2] + 0.5} {m[1, 2] + 0.5} {' '.join(map(str, d[:4]))}"
        for number, m, d in ((1, LEFT, LEFT_D), (2, RIGHT, RIGHT_D))
    ]
    (folder / "cameras.txt").write_text("# Camera list\n" + "\n".join(cameras) + "\n")
    if rig:
        x, y, z, w = Rotation.from_rotvec(TURN).as_quat()
        shift = " ".join(map(str, SHIFT_M))
        (folder / "rigs.txt").write_text(f"# Rig calib list\n1 2 CAMERA 1 CAMERA 2 1 {w} {x} {y} {z} {shift}\n")


WRITERS = {
    "opencv": write_opencv,
    "kalibr": write_kalibr,
    "ros": write_ros,
    "ros2 echo": write_ros2_echo,
    "colmap": write_colmap,
}


def refused(folder, *parts, size=SIZE, given=None):
    refusal.refused(lambda: find_optics(folder, size, stereo=True, given=given), *parts)


def seen(points, matrix, distortion, rotation=None, shift=None):
    turn = np.zeros(3) if rotation is None else rotation
    return cv2.projectPoints(points, turn, np.zeros(3) if shift is None else shift, matrix, distortion)[0][:, 0]


def found_again(maps, pixels):
    """Where the rectified picture has a pixel of the recorded one: the nearest entry of the maps."""
    x, y = maps
    rows = [np.unravel_index(np.argmin((x - u) ** 2 + (y - v) ** 2), x.shape) for u, v in pixels]
    return np.array([(column, row) for row, column in rows], float)


@pytest.mark.parametrize("writer", WRITERS.values(), ids=WRITERS)
def test_a_known_scene_comes_out_rectified(tmp_path, writer):
    """Points of known place, seen through lenses and turned cameras, land where a rectified pinhole has them."""
    writer(tmp_path)
    optics = find_optics(tmp_path, SIZE, stereo=True)
    camera = optics.calibration
    assert camera.baseline_m == pytest.approx(np.linalg.norm(SHIFT_M), rel=1e-6)
    points = np.random.default_rng(3).uniform((-0.5, -0.3, 1.2), (0.5, 0.3, 2.5), (25, 3))
    left = found_again(optics.left_maps, seen(points, LEFT, LEFT_D)) + 0.5
    right = found_again(optics.right_maps, seen(points, RIGHT, RIGHT_D, TURN, SHIFT_M)) + 0.5
    place = points @ optics.rectified_from_left.T
    expected = place[:, :2] / place[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    assert np.abs(left - expected).max() < 1  # the nearest whole pixel
    assert np.abs(left[:, 1] - right[:, 1]).max() <= 1
    np.testing.assert_allclose(left[:, 0] - right[:, 0], camera.fx * camera.baseline_m / place[:, 2], atol=1.5)


def test_a_fisheye_pair_comes_out_rectified(tmp_path):
    write_kalibr(tmp_path)
    path = tmp_path / "camchain.yaml"
    path.write_text(path.read_text().replace("radtan", "equidistant"))
    optics = find_optics(tmp_path, SIZE, stereo=True)
    camera = optics.calibration
    assert camera.baseline_m == pytest.approx(np.linalg.norm(SHIFT_M), rel=1e-6)
    points = np.random.default_rng(3).uniform((-0.5, -0.3, 1.2), (0.5, 0.3, 2.5), (25, 3))
    pixels = (
        cv2.fisheye.projectPoints(points[:, None], turn, shift, matrix, distortion[:4])[0][:, 0]
        for turn, shift, matrix, distortion in (
            (np.zeros(3), np.zeros(3), LEFT, LEFT_D),
            (TURN, SHIFT_M, RIGHT, RIGHT_D),
        )
    )
    maps = (optics.left_maps, optics.right_maps)
    left, right = (found_again(pair, side) + 0.5 for pair, side in zip(maps, pixels, strict=True))
    place = points @ optics.rectified_from_left.T
    assert np.abs(left[:, 1] - right[:, 1]).max() <= 1
    np.testing.assert_allclose(left[:, 0] - right[:, 0], camera.fx * camera.baseline_m / place[:, 2], atol=1.5)


def test_a_zed_is_in_millimetres_and_by_resolution(tmp_path):
    write_zed(tmp_path)
    optics = find_optics(tmp_path, (672, 376), stereo=True)
    assert optics.calibration.baseline_m == pytest.approx(np.linalg.norm([0.1199, 0.0002, 0.0003]), rel=1e-6)
    # The right camera is turned by +0.011 about y: rectification turns half of it, against each other.
    turn = cv2.Rodrigues(optics.rectified_from_left)[0].ravel()
    assert turn[0] == pytest.approx(0.002, abs=3e-4)
    refused(tmp_path, "[STEREO] RX_HD: missing", size=(1280, 720))
    refused(tmp_path, "640x480", "672x376", size=SIZE)


def test_pictures_and_poses_of_a_folder_are_rectified(tmp_path):
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        assert cv2.imwrite(str(tmp_path / side / "0000.png"), np.full((480, 640, 3), 120, np.uint8))
    write_kalibr(tmp_path)
    (tmp_path / "poses_tum.txt").write_text("0 1 2 3 0 0 0 1\n")
    recording = open_recording(tmp_path)
    assert recording.description()["baseline_m"] == pytest.approx(0.12, abs=1e-3)
    frame = next(recording.frames())
    np.testing.assert_allclose(frame.session_from_camera[:3, :3], recording.optics.rectified_from_left.T)
    assert frame.read_left().mean() == pytest.approx(120, abs=1)  # cropped to valid pixels: no black border


def test_cameras_that_are_rectified_are_left_alone(tmp_path):
    write_opencv(tmp_path, M2=LEFT, D1=np.zeros(5), D2=np.zeros(5), R=np.eye(3), T=np.array([-0.12, 0, 0]))
    optics = find_optics(tmp_path, SIZE, stereo=True)
    assert (optics.left_maps, optics.right_maps) == (None, None)
    assert (optics.calibration.fx, optics.calibration.cx, optics.calibration.baseline_m) == (500, 320.5, 0.12)


def test_colmap_counts_pixels_as_we_do(tmp_path):
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_PINHOLE 640 480 500 320 240\n")
    camera = find_optics(tmp_path, SIZE, stereo=False).calibration
    assert (camera.fx, camera.cx, camera.cy) == (500, 320, 240)


def test_a_calibration_can_be_given(tmp_path):
    (tmp_path / "a").mkdir()
    write_kalibr(tmp_path)
    refused(tmp_path / "a", "calibration: found none", "Kalibr camchain", "ZED SN*.conf")
    given = find_optics(tmp_path / "a", SIZE, stereo=True, given=tmp_path / "camchain.yaml")
    assert given.inputs == (tmp_path / "camchain.yaml",)
    refused(tmp_path / "a", "nowhere.yaml: not found", given=tmp_path / "nowhere.yaml")
    write_opencv(tmp_path)
    refused(tmp_path, "camchain.yaml", "stereo.yml", "--calibration")


def test_baselines_that_are_none(tmp_path):
    for shift, parts in (
        (SHIFT_M * 1000, ["baseline of 120", "looks like millimetres"]),
        (-SHIFT_M, ["swap left and right"]),
        (np.array([0.002, 0.12, 0]), ["one above the other"]),
    ):
        write_kalibr(tmp_path, shift)
        refused(tmp_path, "camchain.yaml", *parts)
    fields = {"width": 640, "height": 480, "fx": 500, "fy": 500, "cx": 320, "cy": 240, "baseline_m": 120}
    (tmp_path / "camchain.yaml").unlink()
    (tmp_path / "calibration.json").write_text(json.dumps(fields))
    refused(tmp_path, "baseline_m: found 120", "looks like millimetres")


def test_a_rotation_that_is_none_is_refused(tmp_path):
    write_opencv(tmp_path, R=1.1 * ROTATION)
    refused(tmp_path, "stereo.yml", "stretches", "expected rotation and shift")


def test_a_pair_needs_a_baseline(tmp_path):
    write_colmap(tmp_path, rig=False)
    refused(tmp_path, "no baseline", "rigs.txt")
    (tmp_path / "cameras.txt").unlink()
    write_opencv(tmp_path)
    text = (tmp_path / "stereo.yml").read_text()
    (tmp_path / "stereo.yml").write_text(text.replace("\nT:", "\nU:"))
    refused(tmp_path, "no baseline", "place of the right camera")


def test_a_missing_or_doubled_camera_info(tmp_path):
    write_ros(tmp_path, ["left"])
    refused(tmp_path, "left.yaml", "no baseline: found one camera")
    shutil.copyfile(tmp_path / "left.yaml", tmp_path / "also_left.yaml")
    refused(tmp_path, "found 2 camera_info of a left camera (also_left.yaml, left.yaml)")
    for name in ("left.yaml", "also_left.yaml"):
        (tmp_path / name).unlink()
    write_ros(tmp_path, ["right"])
    refused(tmp_path, "found 0 camera_info of a left camera (none)")


def test_two_different_camera_info_in_one_file(tmp_path):
    write_ros2_echo(tmp_path)
    text = (tmp_path / "left_info.yaml").read_text()
    (tmp_path / "left_info.yaml").write_text(text.replace("width: 640", "width: 320", 1))
    refused(tmp_path, "left_info.yaml", "2 camera_info that differ")


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("resolution: [640, 480]", "resolution: [752, 480]", ["calibration for 752x480", "expected 640x480"]),
        ("radtan", "magic", ["distortion 'magic'", "radtan"]),
        ("camera_model: pinhole", "camera_model: omni", ["camera_model", "'omni'"]),
        ("intrinsics: [500.0", "intrinsics: [-500.0", ["focal length of -500"]),
        ("intrinsics: [500.0", "intrinsics: [.nan", ["intrinsics", "NaN"]),
        ("intrinsics: [500.0,", "intrinsics: [", ["cam0: intrinsics", "expected 4 numbers"]),
        ("intrinsics", "intrinsic", ["calibration: found none"]),
        ("resolution: [640, 480]\n  rostopic", "resolution: [640, 480\n  rostopic", ["camchain.yaml: line 8", "']'"]),
        ("cam0:", "cam0: *anchor", ["line 1"]),
        ("cam0:", "a: &a [1]\ncam0:", ["line 1", "anchor"]),
        ("cam0:", "a: !!python/object:os.system {}\ncam0:", ["line 1", "tag", "os.system"]),
        ("cam0:", "cam1: 1\ncam0:", ["camchain.yaml: line", "'cam1' twice"]),
        ("cam0:", "? [a, b]\n: 1\ncam0:", ["line 1", "no plain name"]),
        ("cam0:", "a: 99999999999999999999\ncam0:", ["line 1", "9999", "64 bits"]),
        ("cam0:", "a: 1e400\ncam0:", ["line 1", "1e400", "64 bits"]),
        ("cam0:", "a: \b\ncam0:", ["line 1", "not allowed"]),
        ("cam0:", "- 1\n---\ncam0:", ["line 1", "found [1]", "name: value"]),
    ],
)
def test_a_broken_camchain_is_refused(tmp_path, old, new, parts):
    write_kalibr(tmp_path)
    text = (tmp_path / "camchain.yaml").read_text()
    assert old in text
    (tmp_path / "camchain.yaml").write_text(text.replace(old, new, 1))
    refused(tmp_path, *parts)


def test_yaml_as_calibration_tools_write_it(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        '%YAML:1.0\n---\na: 1e-05 # small\n"b": [1, [2.5, -3], "x # y"]\n'
        "c: !!opencv-matrix\n   data: [ 1.,\n     2. ]\n"
        "i: {width: 640, no: no}\nd:\n- 1\n- - 2\n  - 3\ne:\n  - name: q\n    f: ~\n"
        "g: true\nh: VI-Sensor cam0 (MT9M034)\n"
    )
    assert read_documents(path) == [
        {
            "a": 1e-05,
            "b": [1, [2.5, -3], "x # y"],
            "c": {"data": [1.0, 2.0]},
            "i": {"width": 640, "no": "no"},
            "d": [1, [2, 3]],
            "e": [{"name": "q", "f": None}],
            "g": True,
            "h": "VI-Sensor cam0 (MT9M034)",
        }
    ]
