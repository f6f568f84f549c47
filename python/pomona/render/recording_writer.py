"""A rendered recording as a folder: frame by frame, so that a run that was interrupted goes on where it stopped."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from pomona.atomic import whole_file
from pomona.cloud import FruitCloud
from pomona.made_from import note_made_from
from pomona.recording.pictures import read_numbers
from pomona.recording.poses import write_tum
from pomona.render.sensor import encoded
from pomona.render.true_boxes import boxes_in, write_boxes

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from pomona.recording.calibration import Calibration
    from pomona.synth.row_geometry import FruitSolids
    from pomona.trajectory import Trajectory

__all__ = ["RecordingWriter"]

MM_PER_M = 1000.0
FARTHEST_MM = 65_535


class RecordingWriter:
    """Writes a recording folder with its truth; it opens as one when it is finished.

    Parameters
    ----------
    folder : Path
        Made where it is not there; with frames from the same settings it is taken up again.
    made_from : mapping
        All that the pictures depend on, JSON values.
    jpeg_quality : int, optional
        Pictures are JPEG of this quality, else PNG.

    Raises
    ------
    PomonaError
        When the folder holds what was made from other settings, or cannot be written.
    """

    def __init__(self, folder: Path, made_from: Mapping[str, Any], jpeg_quality: int | None) -> None:
        note_made_from(folder, made_from)
        self._folder, self._quality = folder, jpeg_quality
        self._suffix = ".png" if jpeg_quality is None else ".jpg"
        for kind in ("right", "depth", "ids", "left"):
            (folder / kind).mkdir(exist_ok=True)

    def first_missing(self, pairs: int) -> int:
        """Give the number of the first frame that is not there yet; left pictures are written last."""
        there = (self._picture("left", number).is_file() for number in range(pairs))
        return next((number for number, is_there in enumerate(there) if not is_there), pairs)

    def write_frame(
        self,
        number: int,
        left: NDArray[np.uint8],
        right: NDArray[np.uint8],
        depth_m: NDArray[np.float32],
        ids: NDArray[np.uint16],
    ) -> None:
        """Write the pictures of one frame, (H, W, 3) BGR, and their truth, (H, W); too far is 0."""
        depth_mm = np.round(np.where(np.isfinite(depth_m), depth_m, 0.0) * MM_PER_M)
        _write(self._picture("right", number), encoded(right, self._suffix, self._quality))
        _write(self._table("depth", number), _png(np.where(depth_mm <= FARTHEST_MM, depth_mm, 0.0).astype(np.uint16)))
        _write(self._table("ids", number), _png(ids))
        _write(self._picture("left", number), encoded(left, self._suffix, self._quality))

    def finish(self, camera: Calibration, trajectory: Trajectory, fruits: FruitSolids, date: str) -> None:
        """Write the tables; calibration.json, without which there is no recording, comes last."""
        labelled = fruits.ids > 0
        cloud = FruitCloud(
            fruits.centres_m[labelled],
            ids=tuple(str(number) for number in fruits.ids[labelled]),
            diameters_m=fruits.diameters_m[labelled],
        )
        cloud.write(self._folder / "fruits.csv")
        masks = (read_numbers(self._table("ids", number), camera) for number in trajectory.frames.tolist())
        boxes = [
            boxes_in(mask, fruits, camera, pose)
            for mask, pose in zip(masks, trajectory.session_from_camera, strict=True)
        ]
        with whole_file(self._folder / "boxes.csv") as partial:
            write_boxes(partial, trajectory.frames.tolist(), boxes)
        with whole_file(self._folder / "poses_tum.txt") as partial:
            write_tum(partial, trajectory)
        _write(self._folder / "recording.json", json.dumps({"date": date, "source": "rendered"}).encode())
        camera.write(self._folder / "calibration.json")

    def _picture(self, kind: str, number: int) -> Path:
        return self._folder / kind / f"{number:04d}{self._suffix}"

    def _table(self, kind: str, number: int) -> Path:
        return self._folder / kind / f"{number:04d}.png"


def _png(values: NDArray[np.uint16]) -> bytes:
    done, content = cv2.imencode(".png", values)
    assert done
    return content.tobytes()


def _write(path: Path, content: bytes) -> None:
    with whole_file(path) as partial:
        partial.write_bytes(content)
