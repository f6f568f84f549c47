"""A stereo camera on a robot: its messages in, fruits and the camera's place in the map out, pair by pair."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona.cloud import FruitCloud
from pomona.detect import Detector
from pomona.localize import Localization, Localizer
from pomona.localize.following import cloud_of
from pomona.recording import Frame
from pomona.recording.bags.camera_info import camera_of, rig_of, says_rectified
from pomona.recording.bags.picture_messages import colour_of, size_of
from pomona.recording.calibration.rectification import Optics, rectified
from pomona.stereo import open_stereo
from pomona.survey.depth import lift

__all__ = ["LiveCamera", "optics_of_messages"]


def optics_of_messages(left_topic: str, left_info: Any, right_topic: str, right_info: Any) -> Optics:
    """Rectify by the `CameraInfo` of both pictures, of rosbags or of rclpy, as a bag with them would be.

    Raises
    ------
    PomonaError
        When one is not calibrated, or they have no baseline.
    """
    here = Path("camera_info")
    left, right = (
        camera_of(here, topic, [info], is_rectified=says_rectified(topic))
        for topic, info in ((left_topic, left_info), (right_topic, right_info))
    )
    size_px = (int(left_info.width), int(left_info.height))
    return rectified(rig_of((), left, right, None), size_px, stereo=True)


class LiveCamera:
    """Pictures in the order of time to poses.

    Parameters
    ----------
    optics : Optics
        As `optics_of_messages` gives them.
    detector : Detector
        Gives boxes.
    localizer : Localizer
        The map.
    """

    def __init__(self, optics: Optics, detector: Detector, localizer: Localizer) -> None:
        self._optics, self._detector, self._localizer = optics, detector, localizer
        self._measure = open_stereo("stereo", optics.calibration)
        self._count = 0

    @property
    def optical_from_camera(self) -> NDArray[np.float64]:
        """From the rectified camera, in which fruits and poses are, into the frame of the pictures."""
        pose = np.eye(4)
        pose[:3, :3] = self._optics.rectified_from_left.T
        return pose

    def look(
        self, left: Any, right: Any, moved: ArrayLike | None = None, covariance: ArrayLike | None = None
    ) -> tuple[FruitCloud, Localization]:
        """Give the fruits that a pair of `Image` messages shows, in the rectified camera, and where that is.

        Parameters
        ----------
        left, right : sensor_msgs/Image
            Of rosbags or of rclpy.
        moved : (4, 4) array_like, optional
            The camera's pose now in its frame at the last call, as for `pomona.Localizer.update`.
        covariance : (6, 6) array_like, optional
            Of `moved`, as there.

        Raises
        ------
        UnreadablePictureError, PomonaError
            When a picture is not what it says.
        """
        pictures = [colour_of(side, image, size_of(side, image)) for side, image in (("left", left), ("right", right))]
        left_bgr, right_bgr = self._optics.left(pictures[0]), self._optics.right(pictures[1])
        frame = Frame(self._count, read_left=lambda: left_bgr, read_right=lambda: right_bgr)
        self._count += 1
        boxes_px = self._detector(frame).boxes_px
        fruits = cloud_of(lift(self._measure(left_bgr, right_bgr, boxes_px), boxes_px, self._optics.calibration))
        return fruits, self._localizer.update(fruits, moved, covariance=covariance)
