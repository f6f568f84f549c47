"""COLMAP models of both forms and layouts: read alike, moved, written back, and refused in one line."""

import re
import shutil

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import refusal
from model_maker import NUMBERS, Model
from pomona import PomonaError
from pomona.reconstruction import open_reconstruction, write_reconstruction
from pomona.reconstruction.picture_camera import PictureCamera

NAMES = ["left/0003.png", "left/0001.png", "caf\u00e9 1.jpg"]
KINDS = [("text", False), ("text", True), ("binary", False), ("binary", True)]


def poses(n=3):
    found = np.tile(np.eye(4), (n, 1, 1))
    found[:, :3, :3] = Rotation.random(n, random_state=4).as_matrix()
    found[:, :3, 3] = np.random.Generator(np.random.PCG64(5)).normal(0, 3, (n, 3))
    return found


def made(folder, form="text", rigs=False, **changes):
    return Model(NAMES, poses(), rigs=rigs, **changes).write(folder, form)


@pytest.mark.parametrize(("form", "rigs"), KINDS)
def test_both_forms_and_layouts_say_the_same(tmp_path, form, rigs):
    model = open_reconstruction(made(tmp_path, form, rigs))
    assert model.form == form
    assert (model.frames is not None) == rigs
    assert [image.name for image in model.images.values()] == NAMES
    found = np.array([model.camera_from_model(image) for image in model.images.values()])
    assert found == pytest.approx(poses(), abs=1e-12)
    camera = model.cameras[7]
    assert camera.size_px == (640, 360)
    assert (*camera.focal_px, *camera.centre_px) == (500, 500, 320, 180)
    assert model.points.positions[1] == pytest.approx([1.0, -0.5, 4.0])
    assert model.images[2].point_ids.tolist() == [1, 2, -1]


def test_a_second_camera_is_where_its_rig_says(tmp_path):
    made(tmp_path, rigs=True)
    cameras = "".join(f"{number} SIMPLE_PINHOLE 640 360 500 320 180\n" for number in (7, 8))
    (tmp_path / "cameras.txt").write_text(cameras)
    images, frames = tmp_path / "images.txt", tmp_path / "frames.txt"
    # Its own pose in images.txt is another, and does not count.
    images.write_text(images.read_text() + "9 1 0 0 0 0 0 0 8 right/0003.png\n\n")
    frames.write_text(frames.read_text().replace("1 CAMERA 7 1\n", "2 CAMERA 7 1 CAMERA 8 9\n"))
    model = open_reconstruction(tmp_path)
    expected = poses()[0].copy()
    expected[0, 3] -= 0.25
    assert model.camera_from_model(model.images[9]) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("form", "rigs"), KINDS)
def test_a_moved_model_is_written_in_its_own_layout_and_sees_the_same(tmp_path, form, rigs):
    before = open_reconstruction(made(tmp_path / "one", form, rigs))
    map_from_model = np.eye(4)
    map_from_model[:3, :3] = 0.25 * Rotation.random(random_state=6).as_matrix()
    map_from_model[:3, 3] = 5.0, -2.0, 1.0
    (tmp_path / "two").mkdir()
    write_reconstruction(tmp_path / "two", before.moved(map_from_model))
    after = open_reconstruction(tmp_path / "two")
    assert sorted(file.name for file in (tmp_path / "two").iterdir()) == sorted(
        file.name for file in (tmp_path / "one").iterdir()
    )
    in_map = before.points.positions @ map_from_model[:3, :3].T + map_from_model[:3, 3]
    assert after.points.positions == pytest.approx(in_map, abs=1e-12)
    assert after.points.rest == before.points.rest
    for image in before.images.values():
        one, two = before.camera_from_model(image), after.camera_from_model(after.images[image.id])
        here = before.points.positions @ one[:3, :3].T + one[:3, 3]
        assert in_map @ two[:3, :3].T + two[:3, 3] == pytest.approx(0.25 * here, abs=1e-9)
        assert after.images[image.id].key_points == image.key_points
    if rigs:
        assert after.rigs[3].others[0].sensor_from_rig[0, 3] == pytest.approx(-0.0625)


@pytest.mark.parametrize(
    ("camera", "numbers"),
    [
        ("SIMPLE_PINHOLE", (500.0, 320.0, 180.0)),
        ("PINHOLE", (500.0, 510.0, 320.0, 180.0)),
        ("SIMPLE_RADIAL", (500.0, 320.0, 180.0, -0.1)),
        ("RADIAL", (500.0, 320.0, 180.0, -0.2, 0.05)),
        ("OPENCV", (500.0, 510.0, 320.0, 180.0, -0.2, 0.05, 0.001, -0.002)),
    ],
)
@pytest.mark.parametrize("form", ["text", "binary"])
def test_each_camera_looks_as_opencv_has_it(tmp_path, form, camera, numbers):
    model = open_reconstruction(made(tmp_path, form, camera=camera, parameters=numbers))
    optics = model.cameras[7]
    directions = np.random.Generator(np.random.PCG64(1)).uniform(-0.5, 0.5, (40, 2))
    focal_y_px = numbers[1] if camera in ("PINHOLE", "OPENCV") else numbers[0]
    matrix = np.array([[numbers[0], 0, 320], [0, focal_y_px, 180], [0, 0, 1]])
    bent = {"SIMPLE_RADIAL": [-0.1, 0, 0, 0], "RADIAL": [-0.2, 0.05, 0, 0], "OPENCV": [-0.2, 0.05, 0.001, -0.002]}
    places = np.pad(directions, ((0, 0), (0, 1)), constant_values=1.0)
    expected, _ = cv2.projectPoints(places, np.zeros(3), np.zeros(3), matrix, np.array(bent.get(camera, [0.0] * 4)))
    assert optics.project(directions) == pytest.approx(expected[:, 0], abs=1e-9)
    assert optics.directions(expected[:, 0]) == pytest.approx(directions, abs=1e-9)


@pytest.mark.parametrize("bent", [(0.5, 0, 0, 0), (1.5, 2.0, 0, 0), (-0.2, 0, 0, 0), (-0.35, 0.12, 0.01, -0.02)])
def test_a_lens_that_bends_much_is_looked_through_backwards(bent):
    camera = PictureCamera((1920, 1080), np.array([900.0, 910.0]), np.array([950.0, 545.0]), np.array(bent, float))
    directions = np.random.Generator(np.random.PCG64(1)).uniform(-1.1, 1.1, (400, 2))
    places = np.pad(directions, ((0, 0), (0, 1)), constant_values=1.0)
    matrix = np.array([[900.0, 0, 950], [0, 910, 545], [0, 0, 1]])
    points_px = cv2.projectPoints(places, np.zeros(3), np.zeros(3), matrix, np.array(bent, float))[0][:, 0]
    inside = ((points_px > 0) & (points_px < camera.size_px)).all(axis=1)
    inside &= np.linalg.norm(directions, axis=1) < 1.2  # before the lens folds
    assert inside.sum() > 50
    assert camera.directions(points_px[inside]) == pytest.approx(directions[inside], abs=1e-9)


def test_beyond_where_a_lens_folds_there_is_no_direction():
    """r - r^3 / 2 + r^5 / 10 has its top, 0.6, at 1, falls, and grows again: r = 1.7 shows 0.65, no lens does."""
    camera = PictureCamera((640, 480), np.array([500.0, 500.0]), np.zeros(2), np.array([-0.5, 0.1, 0.0, 0.0]))
    looks = camera.directions(np.array([[0.59, 0.0], [0.65, 0.0]]) * 500)
    assert 0.8 < looks[0, 0] < 1
    assert np.isnan(looks[1]).all()


@pytest.mark.parametrize("k1", [-1.5, -1e6, 1e300, -1e300])
@pytest.mark.parametrize("form", ["text", "binary"])
def test_a_lens_that_does_not_show_its_picture_is_refused(tmp_path, form, k1):
    made(tmp_path, form, camera="SIMPLE_RADIAL", parameters=(500.0, 320.0, 180.0, k1))
    assert "expected" in refused(tmp_path)


@pytest.mark.parametrize("form", ["text", "binary"])
def test_other_cameras_are_refused(tmp_path, form):
    assert "FULL_OPENCV" in NUMBERS
    made(tmp_path, form, camera="FULL_OPENCV", parameters=(500.0, 500.0, 320.0, 180.0, *[0.0] * 8))
    with pytest.raises(PomonaError, match=r"cameras\..*found the camera model .*FULL_OPENCV.*expected .*undistort"):
        open_reconstruction(tmp_path)


def refused(folder):
    line = refusal.refused(lambda: open_reconstruction(folder))
    assert line.startswith(str(folder))
    return line.removeprefix(str(folder)).lstrip("/")


def test_what_is_missing_is_said(tmp_path):
    assert "found nothing, expected the folder" in refused(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    assert "found none of a COLMAP model" in refused(tmp_path / "empty")
    made(tmp_path / "cut", "binary")
    (tmp_path / "cut" / "points3D.bin").unlink()
    assert "found cameras.bin, images.bin, expected" in refused(tmp_path / "cut")


def test_text_and_binary_are_not_mixed(tmp_path):
    made(tmp_path / "one", "binary"), made(tmp_path / "two", "text")
    (tmp_path / "one" / "points3D.bin").unlink()
    shutil.copy(tmp_path / "two" / "points3D.txt", tmp_path / "one")
    assert "all as .bin or all as .txt" in refused(tmp_path / "one")
    made(tmp_path / "three", "text", rigs=True)
    (tmp_path / "three" / "frames.txt").unlink()
    assert "found rigs.txt alone" in refused(tmp_path / "three")


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("cameras", "640 360", "0 360", "found a size of 0x360"),
        ("cameras", "500.0 500.0", "nan 500.0", "found 'nan', expected a number"),
        ("cameras", "500.0 500.0", "-1 500.0", "found the focal length -1"),
        ("cameras", "500.0 500.0", "500.0 1e-320", "found the focal length 9.99989e-321, expected pixels above 1e-06"),
        ("cameras", " 180.0", "", "missing, the line ends before it"),
        ("images", " 7 left/0003.png", " 6 left/0003.png", "image 1: found the camera 6, which is not there"),
        ("images", "left/0001.png", "left/0003.png", "images 1 and 2: found the same name twice"),
        ("images", "10.5 20.25 1", "10.5 20.25 5", "image 1: found the point 5, which is not there"),
        ("images", "10.5 20.25 1", "inf 20.25 1", "found NaN or infinity"),
        ("images", "10.5 20.25 1", "10.5 20.25", "cells, expected X Y POINT3D_ID"),
        ("points3D", "0.1 0.2 3.0", "0.1 inf 3.0", "found 'inf', expected a number"),
        ("points3D", "0.5 1 0", "0.5 8 0", "found key point 0 of image 8 in a track"),
        ("points3D", "0.5 1 0", "0.5 1 9", "found key point 9 of image 1 in a track"),
        ("points3D", "\n2 1.0", "\n1 1.0", "found point 1 twice"),
        ("images", "10.5 20.25 1", "10.5 20.25 0_1", "expected X Y POINT3D_ID"),
        ("points3D", "0.5 1 0", "0.5 0_1 0", "expected R G B ERROR"),
        ("points3D", "0.1 0.2 3.0", "0_1 0.2 3.0", "found '0_1', expected a number"),
        ("rigs", "3 2 CAMERA", "3 99999999 CAMERA", "missing, the line ends before it"),
        ("frames", "2 3 ", "2 4 ", "frame 2: found the rig 4, which is not there"),
        ("frames", "1 CAMERA 7 2", "1 CAMERA 7 77", "frame 2: found the image 77, which is not there"),
        ("frames", "1 CAMERA 7 2", "0", "image 2 (left/0001.png) is in no frame, so it has no pose"),
    ],
)
def test_wrong_text_is_refused(tmp_path, name, old, new, said):
    file = made(tmp_path, rigs=True) / f"{name}.txt"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    assert said in refused(tmp_path)


def test_an_image_needs_a_pose_that_turns(tmp_path):
    file = made(tmp_path) / "images.txt"
    file.write_text(re.sub(r"(?m)^2 \S+ \S+", "2 9.0 9.0", file.read_text()))
    assert "found a quaternion of length" in refused(tmp_path)


def test_a_camera_without_a_place_in_its_rig_is_refused(tmp_path):
    made(tmp_path, rigs=True)
    rigs = tmp_path / "rigs.txt"
    rigs.write_text("3 2 CAMERA 8 CAMERA 7 0\n")
    assert "image 1: its camera 7 has no place in its rig" in refused(tmp_path)


@pytest.mark.parametrize("name", ["cameras", "images", "points3D", "rigs", "frames"])
def test_a_binary_file_cut_anywhere_is_refused(tmp_path, name):
    file = made(tmp_path, "binary", rigs=True) / f"{name}.bin"
    content = file.read_bytes()
    for length in range(len(content)):
        file.write_bytes(content[:length])
        assert f"{name}.bin: byte" in refused(tmp_path)
    file.write_bytes(content + b"\0")
    assert "bytes after the last" in refused(tmp_path)


@pytest.mark.parametrize("name", ["cameras", "images", "points3D", "rigs", "frames"])
def test_a_count_without_end_takes_no_memory(tmp_path, name):
    file = made(tmp_path, "binary", rigs=True) / f"{name}.bin"
    file.write_bytes(b"\xff" * 7 + b"\x0f" + file.read_bytes()[8:])
    assert "cut short" in refused(tmp_path)


@pytest.mark.parametrize(("name", "at"), [("images", 12), ("images", 8 + 4 + 32), ("points3D", 16), ("frames", 16)])
def test_numbers_that_are_none_are_refused_in_bytes_too(tmp_path, name, at):
    file = made(tmp_path, "binary", rigs=True) / f"{name}.bin"
    content = bytearray(file.read_bytes())
    content[at : at + 8] = np.array([np.nan]).tobytes()
    file.write_bytes(content)
    assert re.search("NaN|nan", refused(tmp_path))
