"""Boxes and tracks as COCO json: `images` with `annotations`, or the list of a detector's results.

A picture's frame number stands at the end of its file name: `0007.png`, `frame_000007.jpg`. In a list of results, which
has no file names, `image_id` is the frame number. `track_id` of an annotation, or among its `attributes`, names the
fruit. COCO's pixels are ours. Groups (`iscrowd`) are no fruits and are left out; categories are not looked at.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from pomona.detect.listed import ListedBox
from pomona.errors import PomonaError, PomonaWarning
from pomona.reading import number_in, parsed_json, shown, whole_number
from pomona.recording import Calibration

__all__ = ["read_coco"]

EXPECTED = "COCO: an object with images and annotations, or a list of results with image_id and bbox"


def read_coco(path: Path, text: str, calibration: Calibration) -> tuple[Iterator[ListedBox], Collection[int] | None]:
    """Give the boxes of a COCO file, and the frames that it lists; None of a list of results, which has boxes alone.

    Raises
    ------
    PomonaError
        One line with the file, the entry and its field, what was found and what was expected.
    """
    content = parsed_json(str(path), text, EXPECTED)
    if isinstance(content, list):
        rows = enumerate(content)
        return (_box(path, f"[{row}]", entry, _result_frame(path, row, entry)) for row, entry in rows), None
    frames = _frames(path, _list_of(path, content, "images"), calibration)
    return _annotated(path, content, frames), frames.values()


def _annotated(path: Path, content: Any, frames: Mapping[int | str, int]) -> Iterator[ListedBox]:
    groups = 0
    for row, entry in enumerate(_list_of(path, content, "annotations")):
        where = f"annotations[{row}]"
        image = _key(path, where, entry, "image_id")
        if image not in frames:
            raise PomonaError(f"{path}: {where}: image_id: found {shown(image)}, expected the id of one of the images")
        if entry.get("iscrowd"):
            groups += 1
        else:
            yield _box(path, where, entry, frames[image])
    if groups:
        warnings.warn(f"{path}: left out {groups} groups of fruits (iscrowd)", PomonaWarning, stacklevel=2)


def _frames(path: Path, images: list[Any], calibration: Calibration) -> dict[int | str, int]:
    """Map the ids of images to frame numbers; each frame is there once, in the size of the recording."""
    image_of: dict[int, int | str] = {}
    for row, image in enumerate(images):
        where = f"images[{row}]"
        key, name = _key(path, where, image, "id"), str(_field(path, where, image, "file_name"))
        number = _frame_number(path, where, name)
        if number in image_of:
            other = shown(image_of[number])
            found = f"file_name: found {shown(name)}, frame {number}, which is that of image {other} too"
            raise PomonaError(f"{path}: {where}: {found}, expected each frame once")
        size_px = (image.get("width", calibration.width), image.get("height", calibration.height))
        if size_px != calibration.size_px:
            found = f"{shown(name)}: found {shown(size_px[0])}x{shown(size_px[1])} pixels"
            expected = f"{calibration.width}x{calibration.height} as the recording's pictures"
            raise PomonaError(f"{path}: {where}: {found}, expected {expected}")
        image_of[number] = key
    return {key: number for number, key in image_of.items()}


def _frame_number(path: Path, where: str, name: str) -> int:
    stem = PurePosixPath(name.replace("\\", "/")).stem
    # Roboflow appends the old suffix and a hash: 0007_png.rf.4f0c1e.jpg.
    digits = re.search(r"\d+$", re.sub(r"_(png|jpe?g)\.rf\.\w+$", "", stem, flags=re.IGNORECASE), flags=re.ASCII)
    if digits is None:
        found = f"file_name: found {shown(name)}"
        raise PomonaError(f"{path}: {where}: {found}, expected a frame number at its end, as 0007.png")
    return whole_number(f"{path}: {where}: file_name", digits[0], "a frame number at its end")


def _result_frame(path: Path, row: int, entry: Any) -> int:
    number = number_in(f"{path}: [{row}]", "image_id", _field(path, f"[{row}]", entry, "image_id"))
    if number != int(number):
        raise PomonaError(f"{path}: [{row}]: image_id: found {number:g}, expected a frame number")
    return int(number)


def _box(path: Path, where: str, entry: Mapping[str, Any], frame: int) -> ListedBox:
    place = f"{path}: {where}"
    bbox = _field(path, where, entry, "bbox")
    if not isinstance(bbox, list) or len(bbox) != 4:
        raise PomonaError(f"{place}: bbox: found {str(bbox)[:40]}, expected [x, y, width, height]")
    x, y, width, height = (number_in(place, "bbox", value) for value in bbox)
    if width <= 0 or height <= 0:
        raise PomonaError(f"{place}: bbox: found {width:g}x{height:g} pixels, expected more than 0")
    attributes = entry.get("attributes")
    named = {**(attributes if isinstance(attributes, dict) else {}), **entry}.get("track_id")
    return ListedBox(
        where=where,
        frame=frame,
        corners_px=(x, y, x + width, y + height),
        score=number_in(place, "score", entry.get("score", 1.0)),
        id="" if named is None else str(named),
    )


def _list_of(path: Path, content: Any, name: str) -> list[Any]:
    entries = content.get(name) if isinstance(content, dict) else None
    if not isinstance(entries, list):
        found = "none" if entries is None else type(entries).__name__
        raise PomonaError(f"{path}: {name}: found {found}, expected {EXPECTED}")
    return entries


def _field(path: Path, where: str, entry: Any, name: str) -> Any:
    if not isinstance(entry, dict) or name not in entry:
        found = sorted(entry) if isinstance(entry, dict) else type(entry).__name__
        raise PomonaError(f"{path}: {where}: {name}: missing, found {str(found)[:80]}")
    return entry[name]


def _key(path: Path, where: str, entry: Any, name: str) -> int | str:
    value = _field(path, where, entry, name)
    if not isinstance(value, int | str):
        raise PomonaError(f"{path}: {where}: {name}: found {str(value)[:40]}, expected a number or a name")
    return value
