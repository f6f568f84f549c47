"""The frames of the robot that recorded a bag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import shown
from pomona.recording.bags.bag_recording import BagRecording
from pomona.recording.bags.frames_of_reference import bare_name
from pomona.ros.robot_frames import BODY_FROM_OPTICAL, RobotFrames
from pomona.ros.transform_tree import TransformTree, read_tree

__all__ = ["BagFrames", "frames_of_bag"]

Array = NDArray[np.float64]

NAMELESS = "camera_optical_frame"
"""Of pictures whose header names no frame."""

OTHER_MAP = "pomona_map"
"""Where the bag has a frame of the map's name itself."""


@dataclass(frozen=True, eq=False)
class BagFrames:
    """See the module.

    Attributes
    ----------
    robot : RobotFrames
    root : str
        The top of the tree that the camera hangs in, `odom` as a rule: what the localiser publishes the map's child as.
    body_is_new : bool
        Whether the body is one that the bag does not know: the camera's own, with the axes of a body.
    tree : TransformTree
        What the bag tells.
    """

    robot: RobotFrames
    root: str
    body_is_new: bool
    tree: TransformTree

    def map_from_root(self, map_from_base: Array, stamp_ns: int) -> Array | None:
        """Give the transform that puts the body where it was found; None where the bag tells no pose at that time."""
        if self.body_is_new:
            camera_from_root, known = self._root_inverse(self.robot.camera, stamp_ns)
            base_from_root = BODY_FROM_OPTICAL @ camera_from_root
        else:
            base_from_root, known = self._root_inverse(self.robot.base, stamp_ns)
        return map_from_base @ base_from_root if known else None

    def _root_inverse(self, frame: str, stamp_ns: int) -> tuple[Array, bool]:
        root_from_frame, known = self.tree.at(self.root, frame, np.array([stamp_ns]))
        return np.linalg.inv(root_from_frame[0]), bool(known[0])


def frames_of_bag(recording: BagRecording, map_frame: str, map_from_fruits: Array) -> BagFrames:
    """Read the tree of a bag: the body is the topmost frame that is fixed to the camera, `base_link` as a rule.

    Raises
    ------
    PomonaError
        When the frames above the camera go in a circle.
    """
    tree = read_tree(recording.file)
    camera = bare_name(next(iter(recording.pictures.values())).frame) or NAMELESS
    if circle := tree.circle(camera):
        names = " in ".join(map(shown, (*circle, circle[0])))
        raise PomonaError(f"{recording.path}: found frames in a circle, {names}, expected a tree")
    root, body = tree.chain(camera)[-1], tree.body_of(camera)
    body_is_new = body == camera
    body_from_optical = BODY_FROM_OPTICAL if body_is_new else tree.at(body, camera, np.zeros(1, np.int64))[0][0]
    optical_from_camera = np.eye(4)
    optical_from_camera[:3, :3] = recording.optics.rectified_from_left.T
    robot = RobotFrames(
        map=OTHER_MAP if map_frame in {*tree.parents, *tree.parents.values()} else map_frame,
        base=f"{camera}_body" if body_is_new else body,
        camera=camera,
        base_from_camera=body_from_optical @ optical_from_camera,
        optical_from_camera=optical_from_camera,
        map_from_fruits=map_from_fruits,
    )
    return BagFrames(robot, root, body_is_new, tree)
