"""From what the user has, boxes or a model, to a detector."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict, Unpack

from pomona.detect.from_file import FileDetector
from pomona.errors import PomonaError
from pomona.recording import Calibration, Recording

if TYPE_CHECKING:
    from pomona.detect.onnx import OnnxDetector

__all__ = ["ModelSettings", "open_detections", "open_detector"]

IN_FOLDER = "detections.csv"
"""Boxes that lie in the folder of a recording."""


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


def open_detections(path: str | Path, calibration: Calibration, numbers: Sequence[int]) -> FileDetector:
    """Open a file of boxes or tracks of any kind that `FileDetector.read` knows; it is told by what is in it."""
    return FileDetector.read(Path(path), calibration, numbers)


def open_detector(
    detections: Path | None, model: Path | None, recording: Recording, **settings: Unpack[ModelSettings]
) -> FileDetector | OnnxDetector:
    """Open what finds the fruits of a recording: a file of boxes, or a model.

    Both have a `path`, a `description` in one line for people, and a `configuration` for a session's provenance.

    Parameters
    ----------
    detections : Path or None
        File of boxes.
    model : Path or None
        ONNX file.
    recording : Recording
        Where neither is given, its folder may have a `detections.csv`.
    **settings
        Of the model.

    Raises
    ------
    PomonaError
        When both are given or none is there, a setting of a model comes without one, or the file is wrong.
    """
    given = {name: value for name, value in settings.items() if value is not None}
    if model is None:
        if given:
            raise PomonaError(f"{', '.join(given)}: found without a model, expected --model FILE with it")
        return open_detections(_boxes_of(detections, recording), recording.calibration, recording.numbers)
    if detections is not None:
        raise PomonaError(f"found --detections {detections} and --model {model}, expected one of them")
    pictures = recording.description()["pictures"]
    if "left" not in pictures:
        found = " and ".join(pictures)
        raise PomonaError(f"{recording.path}: found {found} pictures, expected left ones: a model looks at them")
    from pomona.detect.onnx import OnnxDetector

    return OnnxDetector.open(model, **given)  # type: ignore[arg-type] # the same names and types, None left out


def _boxes_of(detections: Path | None, recording: Recording) -> Path:
    path = detections or recording.path / IN_FOLDER
    if detections is None and not path.is_file():
        raise PomonaError(f"{path}: not found, expected boxes there, or --detections FILE or --model FILE")
    return path
