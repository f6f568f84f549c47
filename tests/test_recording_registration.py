"""Depth of another camera than the colour's, and what RealSense's own recorder writes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bag_maker import START_NS, STEP_NS, image, info, picture, tf, write_bag
from pomona import PomonaError, PomonaWarning
from pomona.recording import open_recording

COLOUR, COLOUR_F = (128, 96), 120.0
DEPTH, DEPTH_F = (80, 60), 60.0
LEFT_FROM_DEPTH = np.eye(4)
LEFT_FROM_DEPTH[:3, :3] = Rotation.from_rotvec([0.01, -0.02, 0.015]).as_matrix()
LEFT_FROM_DEPTH[:3, 3] = (0.015, -0.002, 0.001)
PLANE = np.array([0.2, -0.1, 1.0])  # PLANE @ point = 1.5 in the depth camera
"""A wall that is not parallel to the picture."""


def rays(size, f):
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    return np.stack(
        [(columns - (size[0] - 1) / 2) / f, (rows - (size[1] - 1) / 2) / f, np.ones(columns.shape)], axis=-1
    )


def wall_in_depth():
    return 1.5 / (rays(DEPTH, DEPTH_F) @ PLANE)


def wall_in_colour():
    """The same wall by geometry: n R^T (z r - t) = 1.5."""
    normal = PLANE @ LEFT_FROM_DEPTH[:3, :3].T
    return (1.5 + normal @ LEFT_FROM_DEPTH[:3, 3]) / (rays(COLOUR, COLOUR_F) @ normal)


def rgbd(depth, *, frames=("colour", "depth"), transform=LEFT_FROM_DEPTH, depth_f=DEPTH_F):
    size = depth.shape[::-1]
    return [
        info("/camera/color/camera_info", START_NS, size=COLOUR, f=COLOUR_F, frame=frames[0]),
        image("/camera/color/image_raw", START_NS, picture(1, COLOUR), "rgb8", frames[0]),
        info("/camera/depth/camera_info", START_NS, size=size, f=depth_f, frame=frames[1]),
        image("/camera/depth/image_rect_raw", START_NS, depth.astype(np.float32), "32FC1", frames[1]),
        *([] if transform is None else [tf("/tf_static", START_NS, ("colour", "depth", transform))]),
    ]


def only_frame(bag):
    return next(open_recording(bag).frames())


def assert_is_wall(seen, expected):
    """Depth of one pixel is taken for all of its footprint: half of it, times the slope of the wall."""
    inner = seen[16:-16, 16:-16]
    assert (inner > 0).all(), "holes"
    slope = np.abs(np.gradient(expected)).max()
    assert np.abs(inner - expected[16:-16, 16:-16]).max() < 2.5 * slope


@pytest.mark.parametrize("form", ["ros1", "mcap"])
def test_depth_is_seen_from_the_colour_camera(tmp_path, form):
    frame = only_frame(write_bag(tmp_path / "row", rgbd(wall_in_depth()), form))
    assert frame.read_left().shape == (96, 128, 3)
    assert frame.read_depth().shape == (96, 128)
    assert_is_wall(frame.read_depth(), wall_in_colour())
    # The untransformed wall would be wrong by far more than what is allowed.
    assert np.abs(wall_in_colour() - 1.5 / (rays(COLOUR, COLOUR_F) @ PLANE)).max() > 0.02


def test_of_two_surfaces_the_nearer_one_is_seen(tmp_path):
    depth = np.full(DEPTH[::-1], 3.0)
    depth[20:40, 30:50] = 1.0
    depth[0, 0] = 0
    shift = np.eye(4)
    shift[0, 3] = 0.2
    seen = only_frame(write_bag(tmp_path / "row", rgbd(depth, transform=shift), "mcap")).read_depth()
    # The near square moves by 120 * 0.2 / 1 = 24 pixels to the right, the wall by 8: behind the square nothing is seen.
    assert seen[48, 64 + 24] == 1.0
    assert seen[48, 64 - 10] == 0.0
    assert seen[10, 64] == 3.0
    assert set(np.unique(seen)) == {0.0, np.float32(1.0), np.float32(3.0)}
    row = seen[48]
    assert 38 <= (row == 1.0).sum() <= 44  # 20 pixels of f = 60 are 40 of f = 120


def test_aligned_depth_stays_as_it_is(tmp_path):
    depth = np.full(COLOUR[::-1], 1.25)
    depth[3, 4] = 0
    for name, transform in (("unknown", None), ("known", np.eye(4))):
        bag = write_bag(tmp_path / name, rgbd(depth, transform=transform, depth_f=COLOUR_F), "ros1")
        recording = open_recording(bag)
        assert recording.registration is None
        assert np.array_equal(next(recording.frames()).read_depth(), depth.astype(np.float32))


def test_depth_of_a_camera_that_nobody_knows_is_refused(tmp_path):
    for entries in (rgbd(wall_in_depth(), transform=None), rgbd(wall_in_depth(), frames=("0", "0"))):
        with pytest.raises(
            PomonaError, match=r"depth is not in the picture of /camera/color/image_raw: .* record it aligned"
        ):
            open_recording(write_bag(tmp_path / "row", entries, "mcap"))
    entries = [entry for entry in rgbd(wall_in_depth()) if entry[0] != "/camera/depth/camera_info"]
    with pytest.raises(PomonaError, match="found 128x96 and 80x60 pixels, expected equal sizes: record it aligned"):
        open_recording(write_bag(tmp_path / "row", entries, "mcap"))


def test_a_pair_goes_without_such_depth(tmp_path):
    entries = []
    for side, shift in (("left", 0.0), ("right", -COLOUR_F * 0.1)):
        entries.append(info(f"/zed/{side}/camera_info", START_NS, shift, size=COLOUR, f=COLOUR_F))
        entries.append(image(f"/zed/{side}/image_rect_color", START_NS, picture(1, COLOUR), "bgr8"))
    entries += [entry for entry in rgbd(wall_in_depth(), transform=None) if "depth" in entry[0]]
    with pytest.warns(PomonaWarning, match="left out, as left and right are there"):
        recording = open_recording(write_bag(tmp_path / "row", entries, "mcap"))
    assert recording.description()["pictures"] == {"left": 1, "right": 1}


def realsense(n_frames=2, *, colour=False, infrared=True):
    """As RealSense Viewer names it: extrinsics are transforms from the reference, which is depth, to the stream."""
    at = START_NS
    entries = [("/device_0/sensor_0/option/Depth Units/value", at, "std_msgs/msg/Float32", {"data": 0.0001})]
    sensors = {"Depth_0": (0, np.eye(4), DEPTH, DEPTH_F)}
    right_from_reference = np.eye(4)
    right_from_reference[0, 3] = -0.05
    if infrared:
        sensors |= {
            "Infrared_1": (0, np.eye(4), DEPTH, DEPTH_F),
            "Infrared_2": (0, right_from_reference, DEPTH, DEPTH_F),
        }
    if colour:
        sensors["Color_0"] = (1, LEFT_FROM_DEPTH, COLOUR, COLOUR_F)
    for name, (sensor, matrix, size, f) in sensors.items():
        prefix = f"/device_0/sensor_{sensor}/{name}"
        entries.append((f"{prefix}/tf/0", at, "geometry_msgs/msg/Transform", {"matrix": matrix}))
        lens = {"distortion_model": "Brown Conrady", "R": np.zeros(9), "P": np.zeros(12)}
        entries.append(info(f"{prefix}/info/camera_info", at, size=size, f=f, frame="0", **lens))
        for row in range(n_frames):
            stamp_ns = at + row * STEP_NS
            topic = f"{prefix}/image/data"
            if name == "Depth_0":
                steps = np.round(wall_in_depth() / 0.0001).astype(np.uint16)
                entries.append(image(topic, stamp_ns, steps, "mono16", "0"))
            elif name == "Color_0":
                entries.append(image(topic, stamp_ns, picture(row, COLOUR), "rgb8", "0"))
            else:
                entries.append(image(topic, stamp_ns, picture(row, DEPTH, channels=1), "mono8", "0"))
    return entries


@pytest.mark.parametrize("form", ["ros1", "ros1 lz4"])
def test_the_infrared_pair_of_realsense(tmp_path, form):
    recording = open_recording(write_bag(tmp_path / "row", realsense(colour=True), form))
    assert recording.roles.left == "/device_0/sensor_0/Infrared_1/image/data"
    assert recording.calibration.baseline_m == pytest.approx(0.05)
    assert recording.description()["pictures"] == {"left": 2, "right": 2, "depth": 2}
    assert recording.registration is None
    frame = next(recording.frames())
    assert np.array_equal(frame.read_left()[:, :, 0], picture(0, DEPTH, channels=1))
    assert np.abs(frame.read_depth() - wall_in_depth()).max() <= 0.00006


def test_colour_and_depth_of_realsense_are_registered(pomona, tmp_path):
    bag = write_bag(tmp_path / "row", realsense(colour=True, infrared=False), "ros1 lz4")
    recording = open_recording(bag)
    assert recording.roles.left == "/device_0/sensor_1/Color_0/image/data"
    assert recording.calibration.depth_unit_m == pytest.approx(0.0001)
    assert_is_wall(next(recording.frames()).read_depth(), wall_in_colour())
    code, printed, errors = pomona("info", bag, "--check")
    assert code == 0, errors
    assert "pictures       2 left, 2 depth" in printed
