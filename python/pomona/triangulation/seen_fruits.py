"""From a model with boxes or a detector to its fruits: the story of what one camera alone says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack

import numpy as np

from pomona.cloud import FruitCloud
from pomona.detect import Detections
from pomona.detect.named_pictures import NamedPictureDetector, has_picture_names
from pomona.detect.opening import FoundBoxes, ModelSettings, open_detector
from pomona.errors import PomonaError
from pomona.recording.pictures import UnreadablePictureError
from pomona.triangulation.fruits_in_view import triangulated_fruits
from pomona.triangulation.model_recording import ModelRecording
from pomona.views import Views

__all__ = ["FruitsOfModel", "fruits_of_model", "open_boxes"]

LEAST_PICTURES = 2

LookedAt = Callable[[int, int], None]
"""Called after each picture with pictures done and in all."""


@dataclass(frozen=True, eq=False)
class FruitsOfModel:
    """What the pictures of a model show.

    Attributes
    ----------
    cloud : FruitCloud
        Fruits in the frame and units of the model; the frames of its views are frame numbers.
    n_boxes, n_used : int
        Boxes in all pictures, and those of fruits.
    n_skipped : int
        Pictures that cannot be read.
    """

    cloud: FruitCloud
    n_boxes: int
    n_used: int
    n_skipped: int


def open_boxes(
    recording: ModelRecording, detections: Path | None, model: Path | None, **settings: Unpack[ModelSettings]
) -> FoundBoxes:
    """Open what finds the fruits: a file of boxes by frame or by the name of the picture, masks, or a detector.

    Raises
    ------
    PomonaError
        Neither boxes nor pictures to look at are given, both boxes and a detector are, or a file is wrong.
    """
    if detections is not None and model is None and has_picture_names(detections):
        sizes_px = {number: recording.camera_of(number).size_px for number in recording.numbers}
        return NamedPictureDetector.read(detections, recording.names, sizes_px)
    if detections is None and recording.folder is None:
        raise PomonaError("found no boxes, expected --detections FILE, or --pictures DIR for a detector to look at")
    return open_detector(detections, model, recording, **settings)


def fruits_of_model(recording: ModelRecording, boxes: FoundBoxes, progress: LookedAt | None = None) -> FruitsOfModel:
    """Find each fruit that several pictures show once.

    Raises
    ------
    PomonaError
        There are fewer pictures than two, or none of them can be read.
    """
    if len(recording) < LEAST_PICTURES:
        raise PomonaError(f"{recording.model.folder}: found one picture, expected two that show a fruit")
    found, n_skipped = [], 0
    for frame in recording.frames():
        try:
            found.append(boxes(frame))
        except UnreadablePictureError as error:
            found.append(Detections.none(looked=False))
            n_skipped += 1
            if n_skipped == len(recording):
                raise PomonaError(f"{recording.path}: none of {n_skipped} pictures can be read: {error}") from None
        if progress is not None:
            progress(len(found), len(recording))
    poses = [recording.model.camera_from_model(image) for image in recording.images.values()]
    cameras = [recording.camera_of(number) for number in recording.numbers]
    seen = triangulated_fruits(np.array(poses), cameras, [one.boxes_px for one in found], [one.ids for one in found])
    views = seen.cloud.views
    assert views is not None
    numbered = Views(np.array(recording.numbers, np.int64)[views.frames], views.fruits)
    n_boxes = sum(map(len, found))
    return FruitsOfModel(replace(seen.cloud, views=numbered), n_boxes, int((seen.fruits >= 0).sum()), n_skipped)
