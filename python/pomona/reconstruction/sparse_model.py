"""A sparse model as COLMAP keeps it: cameras, posed images, points, and since version 4 rigs and frames.

A model has a frame and a unit of its own, which nobody knows in metres. What a move of the whole model leaves as it is,
key points and tracks, stays the bytes that were read, so that it is written as it came.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pomona.reconstruction.picture_camera import PictureCamera

__all__ = ["Form", "ModelFrame", "ModelImage", "ModelPoints", "ModelRig", "RigSensor", "SensorId", "SparseModel"]

Array = NDArray[np.float64]

Form = Literal["text", "binary"]

SensorId = tuple[str, int]
"""Kind, CAMERA or IMU, and number."""


@dataclass(frozen=True, eq=False)
class ModelImage:
    """A picture with a pose.

    Attributes
    ----------
    id, camera_id : int
        Of the image and of its camera.
    name : str
        Of the picture's file, below the folder of the pictures.
    camera_from_model : (4, 4) float64
        Its pose as the file has it.
    key_points : bytes
        As they were read.
    point_ids : (K,) int64
        The point of each key point, -1 where it has none.
    """

    id: int
    camera_id: int
    name: str
    camera_from_model: Array
    key_points: bytes
    point_ids: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ModelPoints:
    """Triangulated points.

    Attributes
    ----------
    ids : (P,) int64
        Each once.
    positions : (P, 3) float64
        Units of the model.
    rest : tuple of P bytes
        Colour, error and track of each, as they were read.
    tracks : (T, 2) int64
        Image and key point of all tracks, one after the other.
    """

    ids: NDArray[np.int64]
    positions: Array
    rest: tuple[bytes, ...]
    tracks: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class RigSensor:
    """A sensor of a rig besides the one that is its origin; its pose is None where nobody knows it."""

    sensor: SensorId
    sensor_from_rig: Array | None


@dataclass(frozen=True, eq=False)
class ModelRig:
    """Sensors that keep their places to each other; a rig without any has no reference."""

    id: int
    reference: SensorId | None
    others: tuple[RigSensor, ...]

    def sensor_from_rig(self, sensor: SensorId) -> Array | None:
        """Give the place of a sensor in the rig, None where it is unknown or not of this rig."""
        if sensor == self.reference:
            return np.eye(4)
        return next((other.sensor_from_rig for other in self.others if other.sensor == sensor), None)


@dataclass(frozen=True, eq=False)
class ModelFrame:
    """A rig at one instant: where it was, and the sensor and number of what it took."""

    id: int
    rig_id: int
    rig_from_model: Array
    data: tuple[tuple[SensorId, int], ...]


@dataclass(frozen=True, eq=False)
class SparseModel:
    """What the files of a model say.

    Attributes
    ----------
    folder : Path
        Where they lie.
    form : {"text", "binary"}
        How they are written.
    cameras_file : bytes
        The file of the cameras, which no move of the model changes.
    cameras : mapping of int to PictureCamera
    images : mapping of int to ModelImage
    points : ModelPoints
    rigs, frames : mapping, optional
        Of the layout with rigs; None of the older one.
    """

    folder: Path
    form: Form
    cameras_file: bytes
    cameras: Mapping[int, PictureCamera]
    images: Mapping[int, ModelImage]
    points: ModelPoints
    rigs: Mapping[int, ModelRig] | None = None
    frames: Mapping[int, ModelFrame] | None = None

    def camera_from_model(self, image: ModelImage) -> Array:
        """Give the pose of an image: where there are rigs, that of its frame counts, as in COLMAP.

        Raises
        ------
        KeyError
            The image is in no frame, or its sensor has no place in the rig: `open_reconstruction` refuses both.
        """
        if self.frames is None or self.rigs is None:
            return image.camera_from_model
        frame = self.frames[self.frame_of_image[image.id]]
        camera_from_rig = self.rigs[frame.rig_id].sensor_from_rig(("CAMERA", image.camera_id))
        if camera_from_rig is None:
            raise KeyError(image.id)
        return np.asarray(camera_from_rig @ frame.rig_from_model)

    @cached_property
    def frame_of_image(self) -> Mapping[int, int]:
        """The frame of each image, where there are rigs."""
        frames = (self.frames or {}).values()
        return {number: frame.id for frame in frames for (kind, _), number in frame.data if kind == "CAMERA"}

    def moved(self, map_from_model: Array) -> SparseModel:
        """Give the model in another frame and unit.

        With x_map = s R x + t a camera R_c x + t_c becomes R_c R^T x_map + s t_c - R_c R^T t, in the new unit.

        Parameters
        ----------
        map_from_model : (4, 4) float64
            A similarity.
        """
        scale = float(np.cbrt(np.linalg.det(map_from_model[:3, :3])))

        def pose(camera_from_model: Array) -> Array:
            turned = np.eye(4)
            turned[:3, :3] = camera_from_model[:3, :3] @ map_from_model[:3, :3].T / scale
            turned[:3, 3] = scale * camera_from_model[:3, 3] - turned[:3, :3] @ map_from_model[:3, 3]
            return turned

        def in_rig(sensor: RigSensor) -> RigSensor:
            return sensor if sensor.sensor_from_rig is None else replace(sensor, sensor_from_rig=_scaled(sensor, scale))

        rigs, frames, images = self.rigs, self.frames, self.images.values()
        positions = self.points.positions @ map_from_model[:3, :3].T + map_from_model[:3, 3]
        return replace(
            self,
            images={one.id: replace(one, camera_from_model=pose(one.camera_from_model)) for one in images},
            points=replace(self.points, positions=positions),
            rigs=rigs and {rig.id: replace(rig, others=tuple(map(in_rig, rig.others))) for rig in rigs.values()},
            frames=frames
            and {one.id: replace(one, rig_from_model=pose(one.rig_from_model)) for one in frames.values()},
        )


def _scaled(sensor: RigSensor, scale: float) -> Array:
    assert sensor.sensor_from_rig is not None
    pose = sensor.sensor_from_rig.copy()
    pose[:3, 3] *= scale
    return pose
