"""Boxes that a file lists, checked against the recording they belong to."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.detect.detections import Detections
from pomona.errors import PomonaError, PomonaWarning
from pomona.reading import shown
from pomona.recording import Calibration

__all__ = ["ListedBox", "by_frame"]

LEAST_INSIDE = 0.5
"""Of a box, the part in its picture."""


@dataclass(frozen=True, slots=True)
class ListedBox:
    """One box of a file.

    Attributes
    ----------
    where : str
        Its place in the file, for messages: `line 7`, `annotations[6]`.
    frame : int
        Frame number.
    corners_px : tuple of four float
        xmin, ymin, xmax, ymax in our pixels.
    score : float
        Confidence.
    id : str
        Name of the fruit, empty where the file does not name it.
    """

    where: str
    frame: int
    corners_px: tuple[float, float, float, float]
    score: float = 1.0
    id: str = ""


def by_frame(
    path: Path, boxes: Iterable[ListedBox], calibration: Calibration, numbers: Sequence[int]
) -> dict[int, Detections]:
    """Sort boxes by frame; a box partly outside the picture is cut at its edge, and it is told where most are outside.

    Boxes of frames whose pictures are missing are left out, and told.

    Raises
    ------
    PomonaError
        When a box is not in a frame there is and in none that is missing between those, wholly outside the picture, or
        its score is not 0 to 1; when only some boxes have ids, or one frame has an id twice.
    """
    frames: dict[int, list[ListedBox]] = {}
    without_picture: list[ListedBox] = []
    known = set(numbers)
    for box in boxes:
        if box.frame not in known:
            have = f"{min(known)} to {max(known)}" if known else "none"
            if not known or not min(known) < box.frame < max(known):
                raise PomonaError(f"{path}: {box.where}: frame: found {box.frame}, expected a frame there is ({have})")
            without_picture.append(box)
            continue
        _check(path, box, calibration)
        frames.setdefault(box.frame, []).append(box)
    _tell_without_picture(path, without_picture, sum(map(len, frames.values())))
    _require_ids_of_all_or_none(path, frames)
    _tell_outside(path, [box for found in frames.values() for box in found], calibration)
    return {number: _detections(path, number, found, calibration) for number, found in sorted(frames.items())}


def _tell_without_picture(path: Path, boxes: Sequence[ListedBox], others: int) -> None:
    """Warn of boxes of frames that are missing among those there are; where most are, they are of other frames."""
    if not boxes:
        return
    missing = amount(len({box.frame for box in boxes}), "frame")
    found = f"{boxes[0].where}: frame: found {boxes[0].frame}, which has no picture"
    if len(boxes) > others:
        raise PomonaError(f"{path}: {found}, as {len(boxes)} of {amount(len(boxes) + others, 'box')}: of other frames?")
    warnings.warn(
        f"{path}: {found}: {amount(len(boxes), 'box')} of {missing} are left out", PomonaWarning, stacklevel=4
    )


def _check(path: Path, box: ListedBox, calibration: Calibration) -> None:
    xmin, ymin, xmax, ymax = box.corners_px
    for axis, low, high in (("x", xmin, xmax), ("y", ymin, ymax)):
        if low >= high:
            found = f"found {axis}min {low:g} and {axis}max {high:g}"
            raise PomonaError(f"{path}: {box.where}: {found}, expected {axis}min below")
    width, height = calibration.size_px
    if xmax <= 0 or ymax <= 0 or xmin >= width or ymin >= height:
        found = f"the box {xmin:g},{ymin:g},{xmax:g},{ymax:g} is outside the picture of {width}x{height} pixels"
        raise PomonaError(f"{path}: {box.where}: {found}")
    if not 0 <= box.score <= 1:
        raise PomonaError(f"{path}: {box.where}: score: found {box.score:g}, expected 0 to 1")


def _tell_outside(path: Path, boxes: Sequence[ListedBox], calibration: Calibration) -> None:
    """Warn of boxes that are cut to less than half: a detector sees nothing out there, so they are of others."""
    corners_px = np.array([box.corners_px for box in boxes]).reshape(-1, 4)
    is_cut = _area(_clipped(corners_px, calibration)) < LEAST_INSIDE * _area(corners_px)
    if is_cut.any():
        first = boxes[int(is_cut.argmax())]
        shown_px = ",".join(f"{corner:g}" for corner in first.corners_px)
        width, height = calibration.size_px
        warnings.warn(
            f"{path}: {first.where}: the box {shown_px} is mostly outside the picture of {width}x{height} pixels, and "
            f"cut at its edge, as {int(is_cut.sum())} of {amount(len(boxes), 'box')} are",
            PomonaWarning,
            stacklevel=3,
        )


def _area(corners_px: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(over="ignore"):  # numbers of a stranger; what has no end is outside all the same
        return np.asarray(np.prod(corners_px[:, 2:] - corners_px[:, :2], axis=1), np.float64)


def _clipped(corners_px: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    return np.clip(corners_px, 0.0, np.tile(np.array(calibration.size_px, float), 2))


def _require_ids_of_all_or_none(path: Path, frames: dict[int, list[ListedBox]]) -> None:
    boxes = [box for found in frames.values() for box in found]
    nameless = next((box for box in boxes if not box.id), None)
    if nameless is not None and any(box.id for box in boxes):
        raise PomonaError(f"{path}: {nameless.where}: id: found none, expected ids for all boxes or for none")


def _detections(path: Path, number: int, boxes: list[ListedBox], calibration: Calibration) -> Detections:
    first: dict[str, ListedBox] = {}
    for box in boxes:
        if box.id and (earlier := first.setdefault(box.id, box)) is not box:
            places = f"{earlier.where} and {box.where}"
            raise PomonaError(f"{path}: {places}: id: found {shown(box.id)} twice in frame {number}, expected it once")
    return Detections(
        boxes_px=_clipped(np.array([box.corners_px for box in boxes]), calibration),
        scores=np.array([box.score for box in boxes]),
        ids=tuple(box.id for box in boxes) if boxes[0].id else None,
    )
