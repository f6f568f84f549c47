"""From what the user has, boxes, masks or a model, to a detector."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol, TypedDict, TypeGuard, Unpack

from pomona.detect.colour_check import check_colour
from pomona.detect.detections import Detector
from pomona.detect.from_file import FileDetector
from pomona.detect.masks import MaskDetector
from pomona.detect.own import OwnDetector
from pomona.detect.shipped import SHIPPED, is_shipped, model_named
from pomona.errors import PomonaError
from pomona.recording import Calibration, Recording
from pomona.recording.boxes_beside import boxes_beside

__all__ = ["FoundBoxes", "ModelSettings", "open_detections", "open_detector"]


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
    augment: bool | None


def open_detections(path: str | Path, calibration: Calibration, numbers: Sequence[int]) -> FileDetector | MaskDetector:
    """Open a file of boxes or tracks of any kind that `FileDetector.read` knows, told by what is in it; or masks.

    A folder is one of instance masks.
    """
    path = Path(path)
    return MaskDetector.open(path, calibration) if path.is_dir() else FileDetector.read(path, calibration, numbers)


def open_detector(
    detections: Path | Detector | None, model: Path | None, recording: Recording, **settings: Unpack[ModelSettings]
) -> FoundBoxes:
    """Open what finds the fruits of a recording: a file of boxes, a folder of instance masks, or a model.

    Parameters
    ----------
    detections : Path, Detector or None
        File of boxes, folder of masks, or whatever gives boxes when it is called with a frame.
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
    boxes = boxes_beside(recording.path) if detections is None and model is None else detections
    if boxes is not None and model is None:
        if given:
            found = f"{', '.join(given)}: found without a model"
            raise PomonaError(f"{found}, expected --model FILE with it, or --model {SHIPPED}: there is {boxes}")
        if not isinstance(boxes, Path):
            return boxes if _says_what_it_is(boxes) else OwnDetector(boxes)
        return open_detections(boxes, recording.calibration, recording.recorded_numbers)
    if detections is not None:
        raise PomonaError(f"found --detections {detections} and --model {model}, expected one of them")
    pictures = recording.description()["pictures"]
    if "left" not in pictures:
        found = " and ".join(pictures)
        raise PomonaError(f"{recording.path}: found {found} pictures, expected left ones: a model looks at them")
    from pomona.detect.onnx import OnnxDetector

    name = SHIPPED if model is None else model
    if is_shipped(name):
        check_colour(recording)
    return OnnxDetector.open(model_named(name), **given)  # type: ignore[arg-type] # the same names and types, None left out


def _says_what_it_is(detector: Detector) -> TypeGuard[FoundBoxes]:
    return all(hasattr(detector, name) for name in ("inputs", "configuration", "description"))
