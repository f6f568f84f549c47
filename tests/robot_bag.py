"""A robot's bag of a few frames of the shipped recording: pictures, cameras, the tree of transforms, other topics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from bag_maker import START_NS, Entry, image, info, odometry, tf, write_bag
from pomona.recording import open_recording
from pomona.recording.poses import read_tum

ROW = Path(__file__).parents[1] / "examples" / "row"
MAP, DRIVE = ROW / "2024-08-09" / "fruits.csv", ROW / "2024-08-28"
FRAMES = (4, 6, 8)
STEP_NS = 200_000_000
CAMERA, BASE, ODOM = "camera_left_optical_frame", "base_link", "odom"

BASE_FROM_CAMERA = np.eye(4)
BASE_FROM_CAMERA[:3, :3] = Rotation.from_euler("z", 90, degrees=True).as_matrix() @ [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
BASE_FROM_CAMERA[:3, 3] = (0.3, 0.2, 1.1)
"""The camera looks to the left of the robot."""

ODOM_FROM_MAP = np.eye(4)
ODOM_FROM_MAP[:3, :3] = Rotation.from_euler("xyz", (-90, 0, 40), degrees=True).as_matrix()
ODOM_FROM_MAP[:3, 3] = (5.0, -2.0, 0.4)
"""The robot was switched on somewhere else, and its odometry is perfect."""


@dataclass(frozen=True)
class RobotBag:
    """A bag, the boxes of its pictures, and where its camera truly was in the map."""

    path: Path
    boxes: Path
    map_from_camera: np.ndarray

    @property
    def map_from_base(self) -> np.ndarray:
        return self.map_from_camera @ np.linalg.inv(BASE_FROM_CAMERA)


def true_poses() -> np.ndarray:
    return read_tum(DRIVE / "poses_tum.txt")[1][list(FRAMES)]


def make_robot_bag(folder: Path, form: str = "ros2 mcap", *, tree: str = "tf") -> RobotBag:
    """Write a bag; `tree` says how the robot tells its motion: `tf`, `odometry` or not at all (`none`)."""
    folder.mkdir(exist_ok=True)
    boxes = folder / "boxes.csv"
    lines = (DRIVE / "boxes.csv").read_text().splitlines()
    numbers = {str(frame): str(row) for row, frame in enumerate(FRAMES)}
    kept = [line.partition(",") for line in lines[1:] if line.partition(",")[0] in numbers]
    boxes.write_text("\n".join([lines[0], *(f"{numbers[frame]},{rest}" for frame, _, rest in kept)]) + "\n")
    return RobotBag(write_bag(folder / "drive", entries(tree), form), boxes, true_poses())


def entries(tree: str = "tf") -> list[Entry]:
    return [*_pictures(), *_motion(tree), *_others()]


def _pictures() -> Iterator[Entry]:
    recording = open_recording(DRIVE / "row.mp4")
    camera = recording.calibration
    about = {"f": camera.fx, "size": (camera.width, camera.height), "frame": CAMERA}
    # ROS counts from the centre of the first pixel, we from its corner.
    cx, cy = camera.cx - 0.5, camera.cy - 0.5
    for row, frame in enumerate(recording.frames(FRAMES)):
        at = START_NS + row * STEP_NS
        for side, pixels, shift in (
            ("left", frame.read_left(), 0.0),
            ("right", frame.read_right(), -camera.fx * camera.baseline_m),
        ):
            P = np.array([camera.fx, 0, cx, shift, 0, camera.fy, cy, 0, 0, 0, 1.0, 0])
            yield info(f"/stereo/{side}/camera_info", at, K=P.reshape(3, 4)[:, :3].ravel(), P=P, **about)
            late_ns = 5_000_000 if side == "right" else 3_000_000
            yield image(f"/stereo/{side}/image_rect_color", at, pixels, "bgr8", CAMERA, late_ns=late_ns)


def _motion(tree: str) -> Iterator[Entry]:
    if tree == "none":
        return
    yield tf("/tf_static", START_NS - STEP_NS, (BASE, CAMERA, BASE_FROM_CAMERA))
    for row, pose in enumerate(true_poses()):
        at, odom_from_base = START_NS + row * STEP_NS, ODOM_FROM_MAP @ pose @ np.linalg.inv(BASE_FROM_CAMERA)
        yield tf("/tf", at, (ODOM, BASE, odom_from_base)) if tree == "tf" else odometry("/odom", at, odom_from_base)


def _others() -> Iterator[Entry]:
    """A topic that has nothing to do with us, all along and after the last picture."""
    for row in range(3 * len(FRAMES)):
        at = START_NS + row * STEP_NS // 2
        yield odometry("/goal", at, np.eye(4), child="", frame="map_of_others")
