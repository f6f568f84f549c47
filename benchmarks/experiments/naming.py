"""Which true fruit a box shows, and so which one a scanned fruit is."""

from __future__ import annotations

from collections import Counter, defaultdict

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiments.boxes import MIN_FRAMES
from benchmarks.recordings import TrueBox
from pomona.survey import Part
from pomona.survey.part import Boxes

SAME_BOX_IOU = 0.5


def named_boxes(boxes: Boxes, truth: list[TrueBox]) -> list[str]:
    """Name the true fruit that each box of a scan shows, "" for none."""
    of_frame: dict[int, list[TrueBox]] = defaultdict(list)
    for box in truth:
        of_frame[box.frame].append(box)
    names = [""] * len(boxes.frames)
    for frame in np.unique(boxes.frames).tolist():
        rows = np.flatnonzero(boxes.frames == frame)
        for row, name in zip(rows.tolist(), _named(boxes.boxes_px[rows], of_frame[frame]), strict=True):
            names[row] = name
    return names


def true_fruits(part: Part, names: list[str]) -> list[str]:
    """Give the true fruit that most boxes of each scanned one show, "" where most show none."""
    votes: list[Counter[str]] = [Counter() for _ in range(len(part.cloud))]
    for fruit, name in zip(part.boxes.fruits.tolist(), names, strict=True):
        if fruit >= 0:
            votes[fruit][name] += 1
    return [vote.most_common(1)[0][0] if vote else "" for vote in votes]


def detected(boxes: Boxes, names: list[str]) -> list[str]:
    """Fruits that a detector found in enough frames, whatever became of its boxes."""
    seen = Counter(name for _, name in {*zip(boxes.frames.tolist(), names, strict=True)} if name)
    return sorted(name for name, frames in seen.items() if frames >= MIN_FRAMES)


def _named(boxes_px: NDArray[np.float64], truth: list[TrueBox]) -> list[str]:
    if not truth:
        return [""] * len(boxes_px)
    overlap = _overlap(boxes_px, np.array([box.box_px for box in truth], np.float64))
    best = overlap.argmax(axis=1)
    same = overlap[np.arange(len(best)), best] >= SAME_BOX_IOU
    return [truth[row].fruit if is_same else "" for row, is_same in zip(best.tolist(), same.tolist(), strict=True)]


def _overlap(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Intersection over union of each box of one with each of the other, (A, B)."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.prod(np.clip(high - low, 0.0, None), axis=2)
    of_first, of_second = (np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) for boxes in (first, second))
    return np.asarray(shared / (of_first[:, None] + of_second[None] - shared))
