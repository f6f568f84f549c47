"""From what the user has, boxes, masks or a model, to a detector."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol, TypedDict, Unpack

from pomona.detect.detections import Detector
from pomona.detect.from_file import FileDetector
from pomona.detect.masks import MaskDetector
from pomona.detect.shipped import SHIPPED, model_named
from pomona.errors import PomonaError
from pomona.recording import Calibration, Recording

__all__ = ["FoundBoxes", "ModelSettings", "open_detections", "open_detector"]

IN_FOLDER = ("detections.csv", "ids")
"""Boxes, or else instance masks, that lie in the folder of a recording."""


class FoundBoxes(Detector, Protocol):
    """A detector that says what it is."""

    @property
    def inputs(self) -> list[Path]:
        """The files that its boxes depend on."""

    @property
    def configuration(self) -> dict[str, Any]:
        """What it is, for a session's provenance, JSON values."""

    @property
    def description(self) -> str:
        """What it is, in one line for people."""


class ModelSettings(TypedDict, total=False):
    """Settings of a model, as in `OnnxDetector.open`; None is the default."""

    family: str | None
    min_score: float | None
    iou: float | None
    classes: tuple[str | int, ...] | None
    class_agnostic: bool | None
    tiles: str | None
    size_px: tuple[int, int] | None
    threads: int | None


def open_detections(path: str | Path, calibration: Calibration, numbers: Sequence[int]) -> FileDetector | MaskDetector:
    """Open a file of boxes or tracks of any kind that `FileDetector.read` knows, told by what is in it; or masks.

    A folder is one of instance masks.
    """
    path = Path(path)
    return MaskDetector.open(path, calibration) if path.is_dir() else FileDetector.read(path, calibration, numbers)


def open_detector(
    detections: Path | None, model: Path | None, recording: Recording, **settings: Unpack[ModelSettings]
) -> FoundBoxes:
    """Open what finds the fruits of a recording: a file of boxes, a folder of instance masks, or a model.

    Parameters
    ----------
    detections : Path or None
        File of boxes, or folder of masks.
    model : Path or None
        ONNX file, or the name of a shipped one.
    recording : Recording
        Where neither is given, its folder may have a `detections.csv`, or else masks in `ids/`; where it has neither,
        the shipped model looks.
    **settings
        Of the model.

    Raises
    ------
    PomonaError
        When both are given, a setting of a model comes without one, or the file is wrong.
    """
    given = {name: value for name, value in settings.items() if value is not None}
    boxes = _boxes_of(recording) if detections is None and model is None else detections
    if boxes is not None and model is None:
        if given:
            found = f"{', '.join(given)}: found without a model"
            raise PomonaError(f"{found}, expected --model FILE with it, or --model {SHIPPED}: there is {boxes}")
        return open_detections(boxes, recording.calibration, recording.numbers)
    if detections is not None:
        raise PomonaError(f"found --detections {detections} and --model {model}, expected one of them")
    pictures = recording.description()["pictures"]
    if "left" not in pictures:
        found = " and ".join(pictures)
        raise PomonaError(f"{recording.path}: found {found} pictures, expected left ones: a model looks at them")
    from pomona.detect.onnx import OnnxDetector

    return OnnxDetector.open(model_named(model or SHIPPED), **given)  # type: ignore[arg-type] # the same names and types, None left out


def _boxes_of(recording: Recording) -> Path | None:
    places = (recording.path / name for name in IN_FOLDER)
    return next((place for place in places if place.exists()), None)
