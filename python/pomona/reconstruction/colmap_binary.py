"""COLMAP models as bytes, little endian: cameras.bin, images.bin, points3D.bin, and rigs.bin and frames.bin.

What a count says is compared with the bytes that are left before anything is taken for it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import MOST_NUMBER, require_file
from pomona.reconstruction.model_poses import pose_of, quaternion_and_place
from pomona.reconstruction.picture_camera import PictureCamera, camera_model
from pomona.reconstruction.sparse_model import ModelFrame, ModelImage, ModelPoints, ModelRig, RigSensor, SensorId
from pomona.reconstruction.unique_ids import by_id

__all__ = ["read_cameras", "read_frames", "read_images", "read_points", "read_rigs", "written"]

Array = NDArray[np.float64]

MOST_BYTES = 1 << 31
"""2 GiB: ten thousand pictures of eight thousand key points each."""

MOST_NAME = 4096
"""Bytes of a path."""

KEY_POINT = np.dtype([("place", "<f8", 2), ("point", "<i8")])
TRACK = np.dtype([("image", "<u4"), ("key_point", "<u4")])

SENSOR_KINDS = {0: "CAMERA", 1: "IMU"}

EXPECTED = "a binary file of a COLMAP model"


class _Cursor:
    """Reads a file's content from one end to the other."""

    def __init__(self, path: Path) -> None:
        if require_file(path, EXPECTED) > MOST_BYTES:
            raise PomonaError(f"{path}: found more than {MOST_BYTES >> 20} MiB, expected {EXPECTED}")
        try:
            self.content = path.read_bytes()
        except OSError as error:
            raise PomonaError(f"{path}: cannot be read: {error.strerror}") from None
        self.path, self.at = path, 0

    @property
    def where(self) -> str:
        return f"{self.path}: byte {self.at}"

    def bytes(self, n_bytes: int, what: str) -> bytes:
        if n_bytes > len(self.content) - self.at:
            left = len(self.content) - self.at
            raise PomonaError(f"{self.where}: found {left} bytes, expected {n_bytes} of {what}: the file is cut short")
        self.at += n_bytes
        return self.content[self.at - n_bytes : self.at]

    def take(self, form: str, what: str) -> tuple[Any, ...]:
        return struct.unpack(f"<{form}", self.bytes(struct.calcsize(f"<{form}"), what))

    def count(self, form: str, least_bytes: int, what: str) -> int:
        """Read how many follow, and refuse more than there can be."""
        (count,) = self.take(form, f"the number of {what}")
        if count * least_bytes > len(self.content) - self.at:
            left = len(self.content) - self.at
            raise PomonaError(f"{self.where}: found {left} bytes after the number {count} of {what}: it is cut short")
        return int(count)

    def pose(self) -> Array:
        where = self.where
        return pose_of(where, self.take("7d", "a pose"))

    def sensor(self) -> SensorId:
        where = self.where
        kind, number = self.take("iI", "a sensor")
        if kind not in SENSOR_KINDS:
            raise PomonaError(f"{where}: found the sensor type {kind}, expected 0 (camera) or 1 (IMU)")
        return SENSOR_KINDS[kind], number

    def end(self) -> None:
        if self.at < len(self.content):
            raise PomonaError(f"{self.where}: found {len(self.content) - self.at} bytes after the last, expected none")


def read_cameras(path: Path) -> dict[int, PictureCamera]:
    """Read number, model, width, height and parameters of each camera."""
    cursor = _Cursor(path)
    found = by_id(path, "camera", (_camera(cursor) for _ in range(cursor.count("Q", 48, "cameras"))))
    cursor.end()
    return found


def _camera(cursor: _Cursor) -> tuple[int, PictureCamera]:
    where = cursor.where
    number, kind, width, height = cursor.take("IiQQ", "a camera")
    model = camera_model(where, kind)
    numbers = cursor.take(f"{len(model.parameters)}d", "the parameters of a camera")
    return number, PictureCamera.of(where, model, (width, height), numbers)


def read_images(path: Path) -> dict[int, ModelImage]:
    """Read number, pose, camera, name and key points of each image."""
    cursor = _Cursor(path)
    found = by_id(path, "image", ((one.id, one) for one in map(_image, _repeat(cursor, "images", 73))))
    cursor.end()
    return found


def _repeat(cursor: _Cursor, what: str, least_bytes: int) -> Iterator[_Cursor]:
    return (cursor for _ in range(cursor.count("Q", least_bytes, what)))


def _image(cursor: _Cursor) -> ModelImage:
    (number,) = cursor.take("I", "an image")
    pose = cursor.pose()
    (camera_id,) = cursor.take("I", "the camera of an image")
    name, where = _name(cursor), cursor.where
    n_bytes = KEY_POINT.itemsize * cursor.count("Q", KEY_POINT.itemsize, "key points")
    content = cursor.bytes(n_bytes, "key points")
    table = np.frombuffer(content, KEY_POINT)
    if not np.isfinite(table["place"]).all():
        raise PomonaError(f"{where}: key points of image {number}: found NaN or infinity, expected pixels")
    return ModelImage(number, camera_id, name, pose, content, table["point"].astype(np.int64))


def _name(cursor: _Cursor) -> str:
    end = cursor.content.find(b"\0", cursor.at, cursor.at + MOST_NAME)
    if end < 0:
        raise PomonaError(f"{cursor.where}: found no end of the name of an image, expected a NUL after it")
    where, name = cursor.where, cursor.bytes(end + 1 - cursor.at, "a name")[:-1]
    try:
        return name.decode()
    except UnicodeDecodeError:
        raise PomonaError(f"{where}: found a name that is not UTF-8, expected the name of an image") from None


def read_points(path: Path) -> ModelPoints:
    """Read number, place, colour, error and track of each point."""
    cursor = _Cursor(path)
    n_points = cursor.count("Q", 51, "points")
    ids, positions = np.empty(n_points, np.int64), np.empty((n_points, 3))
    rest, tracks = [], [np.empty(0, TRACK)]
    for row in range(n_points):
        where = cursor.where
        number, *positions[row] = cursor.take("Q3d", "a point")
        begin = cursor.at
        cursor.bytes(11, "colour and error of a point")
        n_bytes = TRACK.itemsize * cursor.count("Q", TRACK.itemsize, "views in a track")
        tracks.append(np.frombuffer(cursor.bytes(n_bytes, "a track"), TRACK))
        rest.append(cursor.content[begin : cursor.at])
        if number >> 63 or not (np.abs(positions[row]) <= MOST_NUMBER).all():
            raise PomonaError(f"{where}: found point {number} at {positions[row]}, expected a number and finite x y z")
        ids[row] = number
    cursor.end()
    table = np.concatenate(tracks)
    return ModelPoints(ids, positions, tuple(rest), np.stack([table["image"], table["key_point"]], axis=1).astype(int))


def read_rigs(path: Path) -> dict[int, ModelRig]:
    """Read number and sensors of each rig."""
    cursor = _Cursor(path)
    found = by_id(path, "rig", ((rig.id, rig) for rig in map(_rig, _repeat(cursor, "rigs", 8))))
    cursor.end()
    return found


def _rig(cursor: _Cursor) -> ModelRig:
    (number,) = cursor.take("I", "a rig")
    n_sensors = cursor.count("I", 8, "sensors")
    reference = cursor.sensor() if n_sensors else None
    return ModelRig(number, reference, tuple(_rig_sensor(cursor) for _ in range(1, n_sensors)))


def _rig_sensor(cursor: _Cursor) -> RigSensor:
    sensor, (has_pose,) = cursor.sensor(), cursor.take("B", "whether a sensor has a pose")
    return RigSensor(sensor, cursor.pose() if has_pose else None)


def read_frames(path: Path) -> dict[int, ModelFrame]:
    """Read number, rig, pose and data of each frame."""
    cursor = _Cursor(path)
    found = by_id(path, "frame", ((one.id, one) for one in map(_frame, _repeat(cursor, "frames", 68))))
    cursor.end()
    return found


def _frame(cursor: _Cursor) -> ModelFrame:
    number, rig_id = cursor.take("II", "a frame")
    pose = cursor.pose()
    n_data = cursor.count("I", 16, "data of a frame")
    data = tuple((cursor.sensor(), *cursor.take("Q", "the number of a datum")) for _ in range(n_data))
    return ModelFrame(number, rig_id, pose, data)


def written(
    images: Mapping[int, ModelImage],
    points: ModelPoints,
    rigs: Mapping[int, ModelRig] | None,
    frames: Mapping[int, ModelFrame] | None,
) -> Iterator[tuple[str, Iterator[bytes]]]:
    """Give the names of the files and their content, as the readers above take it."""
    yield "images", _counted(len(images), map(_image_bytes, images.values()))
    yield "points3D", _counted(len(points.ids), _point_bytes(points))
    if rigs is not None and frames is not None:
        yield "rigs", _counted(len(rigs), map(_rig_bytes, rigs.values()))
        yield "frames", _counted(len(frames), map(_frame_bytes, frames.values()))


def _counted(count: int, content: Iterator[bytes]) -> Iterator[bytes]:
    yield struct.pack("<Q", count)
    yield from content


def _image_bytes(image: ModelImage) -> bytes:
    head = struct.pack("<I7dI", image.id, *quaternion_and_place(image.camera_from_model), image.camera_id)
    n_key_points = struct.pack("<Q", len(image.point_ids))
    return head + image.name.encode() + b"\0" + n_key_points + image.key_points


def _point_bytes(points: ModelPoints) -> Iterator[bytes]:
    for number, place, rest in zip(points.ids.tolist(), points.positions, points.rest, strict=True):
        yield struct.pack("<Q3d", number, *place) + rest


def _sensor_bytes(sensor: SensorId) -> bytes:
    kind = next(number for number, name in SENSOR_KINDS.items() if name == sensor[0])
    return struct.pack("<iI", kind, sensor[1])


def _rig_bytes(rig: ModelRig) -> bytes:
    count = len(rig.others) + (rig.reference is not None)
    reference = b"" if rig.reference is None else _sensor_bytes(rig.reference)
    return struct.pack("<II", rig.id, count) + reference + b"".join(map(_rig_sensor_bytes, rig.others))


def _rig_sensor_bytes(other: RigSensor) -> bytes:
    if other.sensor_from_rig is None:
        return _sensor_bytes(other.sensor) + b"\0"
    return _sensor_bytes(other.sensor) + struct.pack("<B7d", 1, *quaternion_and_place(other.sensor_from_rig))


def _frame_bytes(frame: ModelFrame) -> bytes:
    head = struct.pack("<II7dI", frame.id, frame.rig_id, *quaternion_and_place(frame.rig_from_model), len(frame.data))
    return head + b"".join(_sensor_bytes(sensor) + struct.pack("<Q", number) for sensor, number in frame.data)
