"""What an ONNX file says of itself in its metadata."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from pomona.detect.onnx.preparation import Preparation
from pomona.errors import PomonaError
from pomona.reading import number_in, parsed_json, shown

__all__ = ["OWN_KEY", "Claim", "claim_of"]

OWN_KEY = "pomona_detector"
"""Our own key: JSON with `version` 1, `family`, and where they differ from the family's `names`, `preparation`,
`min_score` and `usual_px`."""

OWN_FIELDS = "version, family, names, preparation, min_score, usual_px"

RFDETR_KEY = "rfdetr_inference"
MISUNDERSTOOD = (
    *(AttributeError, KeyError, IndexError, TypeError, ValueError),
    *(OverflowError, RecursionError, MemoryError, SyntaxError),  # of `ast.literal_eval` too
)
"""What comes of metadata that is not what its key promises."""

TASKS = ("detect", "segment")


@dataclass(frozen=True)
class Claim:
    """What a file says of itself.

    Attributes
    ----------
    source : str
        Where it says so, for people.
    family : str or None
        Its family, None where the outputs must tell.
    names : mapping or None
        Names of its classes by number.
    preparation : mapping
        What of the family's preparation is different.
    outputs : mapping
        Names of outputs by what they are, where they are not the family's.
    size_px : (int, int) or None
        Width and height it was made for.
    min_score : float or None
        The least score that makes counts right.
    usual_px : float or None
        Side of the fruits that it has learnt from, as it saw them.
    """

    source: str
    family: str | None = None
    names: dict[int, str] | None = None
    preparation: dict[str, Any] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    size_px: tuple[int, int] | None = None
    min_score: float | None = None
    usual_px: float | None = None


def claim_of(path: Path, metadata: Mapping[str, str]) -> Claim:
    """Read the first of our own key, RF-DETR's and Ultralytics' that is there.

    Raises
    ------
    PomonaError
        When a key is there and cannot be understood, or the model does something else than to find things.
    """
    readers: tuple[tuple[str, Callable[[str, Mapping[str, str]], Claim]], ...] = (
        (OWN_KEY, _own),
        (RFDETR_KEY, _rfdetr),
        ("names", _ultralytics),
    )
    for key, read in readers:
        if key in metadata:
            try:
                return read(f"{path}: metadata {key}", metadata)
            except MISUNDERSTOOD as error:
                found, reason = shown(" ".join(metadata[key].split())), " ".join(str(error).split())[:200]
                raise PomonaError(f"{path}: metadata {key}: cannot be read: found {found} ({reason})") from None
    return Claim("its inputs and outputs")


def _own(where: str, metadata: Mapping[str, str]) -> Claim:
    content = parsed_json(where, metadata[OWN_KEY], "what we write")
    unknown = content.keys() - {"version", "family", "names", "preparation", "min_score", "usual_px"}
    unknown |= content.get("preparation", {}).keys() - {known.name for known in fields(Preparation)}
    if unknown:
        raise PomonaError(f"{where}: found {', '.join(sorted(unknown))}, expected {OWN_FIELDS}")
    if content["version"] != 1:
        raise PomonaError(f"{where}: version: found {shown(content['version'])}, expected 1")
    names = content.get("names")
    return Claim(
        source=f"its metadata {OWN_KEY}",
        family=str(content["family"]),
        names=None if names is None else dict(enumerate(map(str, names))),
        preparation=_checked_preparation(where, content.get("preparation", {})),
        min_score=_checked_score(where, content),
        usual_px=_checked_size(where, content),
    )


def _checked_score(where: str, content: Mapping[str, Any]) -> float | None:
    if "min_score" not in content:
        return None
    score = number_in(where, "min_score", content["min_score"])
    if not 0 <= score <= 1:
        raise PomonaError(f"{where}: min_score: found {score:g}, expected 0 to 1")
    return score


def _checked_size(where: str, content: Mapping[str, Any]) -> float | None:
    if "usual_px" not in content:
        return None
    size_px = number_in(where, "usual_px", content["usual_px"])
    if not 1 <= size_px < math.inf:
        raise PomonaError(f"{where}: usual_px: found {size_px:g}, expected 1 or more")
    return size_px


def _checked_preparation(where: str, given: dict[str, Any]) -> dict[str, Any]:
    accepted = {"fit": ("letterbox", "corner", "inside", "stretch"), "channels": ("RGB", "BGR")}
    for name, values in {**accepted, "resize": ("linear", "float", "smooth")}.items():
        if name in given and given[name] not in values:
            raise PomonaError(f"{where}: {name}: found {shown(given[name])}, expected one of {', '.join(values)}")
    numbers: dict[str, Any] = {
        name: tuple(number_in(where, name, value) for value in given[name]) for name in ("mean", "std") if name in given
    }
    if any(len(values) != 3 for values in numbers.values()) or 0.0 in numbers.get("std", ()):
        raise PomonaError(f"{where}: found mean or std {shown(given)}, expected three numbers each, no std of 0")
    scale = {"divide_by": number_in(where, "divide_by", given["divide_by"])} if "divide_by" in given else {}
    if 0.0 in scale.values():
        raise PomonaError(f"{where}: divide_by: found 0, expected 255 or 1")
    return {**given, **numbers, **scale}


def _rfdetr(where: str, metadata: Mapping[str, str]) -> Claim:
    content = parsed_json(where, metadata[RFDETR_KEY], "what RF-DETR writes")
    if content["task"] not in TASKS:
        raise PomonaError(f"{where}: task: found {shown(content['task'])}, expected {' or '.join(TASKS)}")
    named = content.get("class_id_to_name") or dict(enumerate(content["class_names"]))
    return Claim(
        source=f"its metadata {RFDETR_KEY}",
        family="rfdetr",
        names={int(number): str(name) for number, name in named.items()},
        preparation=_checked_preparation(where, {"mean": content["means"], "std": content["stds"]}),
        outputs={role: str(name) for role, name in content["outputs"].items()},
    )


def _ultralytics(where: str, metadata: Mapping[str, str]) -> Claim:
    """Read the keys of Ultralytics; their values are representations of Python objects, which are never evaluated."""
    named = ast.literal_eval(metadata["names"])
    names = {
        int(number): str(name) for number, name in dict(named if isinstance(named, dict) else enumerate(named)).items()
    }
    task = metadata.get("task", "detect")
    if task not in TASKS:
        raise PomonaError(f"{where.replace('names', 'task')}: found {shown(task)}, expected {' or '.join(TASKS)}")
    size = ast.literal_eval(metadata["imgsz"]) if "imgsz" in metadata else None
    return Claim(
        source="its metadata of Ultralytics",
        family=_ultralytics_family(metadata),
        names=names,
        size_px=None if size is None else (int(size[1]), int(size[0])),
    )


def _ultralytics_family(metadata: Mapping[str, str]) -> str | None:
    if "rtdetr" in metadata.get("description", "").lower().replace("-", ""):
        return "rtdetr-ultralytics"
    arguments = ast.literal_eval(metadata.get("args", "{}"))
    if metadata.get("end2end") == "True" or arguments.get("nms"):
        return "yolo-end2end"
    if "task" not in metadata:
        return "yolov5"  # its exporter writes stride and names and nothing else
    # YOLOv10 chooses its boxes, YOLOv8 does not, and before there was a key end2end only the outputs say so.
    return "yolov8" if metadata.get("end2end") == "False" else None
