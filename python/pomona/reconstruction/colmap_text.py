"""COLMAP models as text: cameras.txt, images.txt, points3D.txt, and of the newer layout rigs.txt and frames.txt."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import number_in, plain_text, read_text, shown, whole_number
from pomona.reconstruction.model_poses import pose_of, quaternion_and_place
from pomona.reconstruction.picture_camera import PictureCamera, camera_model
from pomona.reconstruction.sparse_model import ModelFrame, ModelImage, ModelPoints, ModelRig, RigSensor, SensorId
from pomona.reconstruction.unique_ids import by_id

__all__ = ["read_cameras", "read_frames", "read_images", "read_points", "read_rigs", "written"]

Array = NDArray[np.float64]

EXPECTED = "a text file of a COLMAP model"


class _Words:
    """Words of one line, taken one after the other."""

    def __init__(self, where: str, line: str) -> None:
        self.where = where
        self._words = iter(line.split())

    def word(self, field: str) -> str:
        try:
            return next(self._words)
        except StopIteration:
            raise PomonaError(f"{self.where}: {field}: missing, the line ends before it") from None

    def whole(self, field: str) -> int:
        number = whole_number(f"{self.where}: {field}", self.word(field), "a whole number")
        if number < 0:
            raise PomonaError(f"{self.where}: {field}: found {number}, expected a number from 0")
        return number

    def numbers(self, field: str, count: int) -> tuple[float, ...]:
        return tuple(number_in(self.where, field, self.word(field)) for _ in range(count))

    def pose(self) -> Array:
        return pose_of(self.where, self.numbers("pose", 7))

    def sensor(self) -> SensorId:
        return self.word("type of the sensor"), self.whole("sensor")

    def rest(self) -> list[str]:
        return list(self._words)

    def end(self) -> None:
        left = self.rest()
        if left:
            raise PomonaError(
                f"{self.where}: found {shown(left[0])} after the last field, expected the end of the line"
            )


def _lines(path: Path) -> Iterator[tuple[str, str]]:
    for number, line in enumerate(read_text(path, EXPECTED).splitlines(), start=1):
        yield f"{path}: line {number}", line.strip()


def _rows(path: Path) -> Iterator[_Words]:
    return (_Words(where, line) for where, line in _lines(path) if line and not line.startswith("#"))


def read_cameras(path: Path) -> dict[int, PictureCamera]:
    """Read ``CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]``."""
    return by_id(path, "camera", ((words.whole("camera"), _camera(words)) for words in _rows(path)))


def _camera(words: _Words) -> PictureCamera:
    model = camera_model(words.where, words.word("model"))
    size_px = words.whole("width"), words.whole("height")
    numbers = words.numbers(" ".join(model.parameters), len(model.parameters))
    words.end()
    return PictureCamera.of(words.where, model, size_px, numbers)


def read_images(path: Path) -> dict[int, ModelImage]:
    """Read ``IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME``, and in the next line ``X Y POINT3D_ID`` of key points."""
    return by_id(path, "image", ((image.id, image) for image in _images(path)))


def _images(path: Path) -> Iterator[ModelImage]:
    lines = _lines(path)
    for where, line in lines:
        if not line or line.startswith("#"):
            continue
        words = _Words(where, line)
        number, pose, camera_id = words.whole("image"), words.pose(), words.whole("camera")
        name = line.split(maxsplit=9)[9] if len(line.split(maxsplit=9)) == 10 else words.word("name")
        below, key_points = next(lines, (where, ""))  # an image without any has an empty line, or none at the end
        yield ModelImage(number, camera_id, name, pose, key_points.encode(), _point_ids(below, key_points))


def _point_ids(where: str, line: str) -> NDArray[np.int64]:
    cells = line.split()
    if len(cells) % 3:
        raise PomonaError(f"{where}: found {len(cells)} cells, expected X Y POINT3D_ID of each key point")
    try:
        _require_plain(line)
        places, ids = np.array([cells[0::3], cells[1::3]], np.float64), np.array(cells[2::3], np.int64)
    except (ValueError, OverflowError):
        raise PomonaError(f"{where}: found {shown(line)}, expected X Y POINT3D_ID of each key point") from None
    if not np.isfinite(places).all():
        raise PomonaError(f"{where}: found NaN or infinity, expected X Y POINT3D_ID of each key point")
    return ids


def read_points(path: Path) -> ModelPoints:
    """Read ``POINT3D_ID X Y Z R G B ERROR`` and the track, ``IMAGE_ID POINT2D_IDX`` of each image."""
    ids, positions, rest, tracks = [], [], [], []
    for words in _rows(path):
        ids.append(words.whole("point"))
        positions.append(words.numbers("X Y Z", 3))
        left = words.rest()
        rest.append(" ".join(left).encode())
        tracks.append(_track(words.where, left))
    places = np.array(positions, np.float64).reshape(-1, 3)
    track_rows = np.concatenate([np.empty((0, 2), np.int64), *tracks])
    return ModelPoints(np.array(ids, np.int64), places, tuple(rest), track_rows)


def _track(where: str, cells: list[str]) -> NDArray[np.int64]:
    expected = "R G B ERROR, then IMAGE_ID POINT2D_IDX of each image"
    try:
        _require_plain(" ".join(cells))
        track = np.array(cells[4:], np.int64).reshape(-1, 2)
        np.array(cells[:4], np.float64).reshape(4)
    except (ValueError, OverflowError):
        raise PomonaError(f"{where}: found {shown(' '.join(cells))}, expected {expected}") from None
    return track


def _require_plain(text: str) -> None:
    if not plain_text(text):
        raise ValueError


def read_rigs(path: Path) -> dict[int, ModelRig]:
    """Read ``RIG_ID NUM_SENSORS REF_TYPE REF_ID``, then ``TYPE ID HAS_POSE [QW QX QY QZ TX TY TZ]`` of the others."""
    return by_id(path, "rig", ((rig.id, rig) for rig in map(_rig, _rows(path))))


def _rig(words: _Words) -> ModelRig:
    number, n_sensors = words.whole("rig"), words.whole("number of sensors")
    reference = words.sensor() if n_sensors else None
    others = tuple(_rig_sensor(words) for _ in range(1, n_sensors))  # a line that is too short ends this
    words.end()
    return ModelRig(number, reference, others)


def _rig_sensor(words: _Words) -> RigSensor:
    return RigSensor(words.sensor(), words.pose() if words.word("whether it has a pose") == "1" else None)


def read_frames(path: Path) -> dict[int, ModelFrame]:
    """Read ``FRAME_ID RIG_ID QW QX QY QZ TX TY TZ NUM_DATA``, then ``TYPE SENSOR_ID DATA_ID`` of each."""
    return by_id(path, "frame", ((frame.id, frame) for frame in map(_frame, _rows(path))))


def _frame(words: _Words) -> ModelFrame:
    number, rig_id, pose = words.whole("frame"), words.whole("rig"), words.pose()
    data = tuple((words.sensor(), words.whole("data")) for _ in range(words.whole("number of data")))
    words.end()
    return ModelFrame(number, rig_id, pose, data)


def written(
    images: Mapping[int, ModelImage],
    points: ModelPoints,
    rigs: Mapping[int, ModelRig] | None,
    frames: Mapping[int, ModelFrame] | None,
) -> Iterator[tuple[str, Iterator[bytes]]]:
    """Give the names of the files and their lines, as the readers above take them."""
    yield "images", (_image_lines(image) for image in images.values())
    yield "points3D", _point_lines(points)
    if rigs is not None and frames is not None:
        yield "rigs", (_line(rig.id, *_rig_words(rig)) for rig in rigs.values())
        yield "frames", (_line(frame.id, frame.rig_id, *_frame_words(frame)) for frame in frames.values())


def _line(*words: object) -> bytes:
    return (" ".join(map(str, words)) + "\n").encode()


def _pose_words(pose: Array) -> list[str]:
    return [repr(number) for number in quaternion_and_place(pose)]


def _image_lines(image: ModelImage) -> bytes:
    head = _line(image.id, *_pose_words(image.camera_from_model), image.camera_id, image.name)
    return head + image.key_points + b"\n"


def _point_lines(points: ModelPoints) -> Iterator[bytes]:
    for number, place, rest in zip(points.ids.tolist(), points.positions.tolist(), points.rest, strict=True):
        yield _line(number, *map(repr, place))[:-1] + b" " + rest + b"\n"


def _rig_words(rig: ModelRig) -> Iterator[object]:
    yield len(rig.others) + (rig.reference is not None)
    yield from rig.reference or ()
    for other in rig.others:
        yield from other.sensor
        yield from (0,) if other.sensor_from_rig is None else (1, *_pose_words(other.sensor_from_rig))


def _frame_words(frame: ModelFrame) -> Iterator[object]:
    yield from _pose_words(frame.rig_from_model)
    yield len(frame.data)
    for sensor, number in frame.data:
        yield from (*sensor, number)
