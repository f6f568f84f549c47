"""What boxes and sizes of a scan say of the detector and of units, where they cannot be right."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaWarning
from pomona.survey.part import Boxes

__all__ = ["check_boxes"]

SAME_BOX = 0.8
"""Area that two boxes share over the area of both together; two fruits of a cluster share half of theirs at most."""

MANY = 0.1
"""Of all boxes; a detector that suppresses such pairs has none."""


def check_boxes(path: Path, parts: Sequence[Boxes]) -> None:
    """Warn where many boxes of one frame lie on another one: each fruit may count twice."""
    n_boxes = sum(len(boxes.frames) for boxes in parts)
    n_twins = sum(_n_twins(boxes.boxes_px[boxes.frames == frame]) for boxes in parts for frame in set(boxes.frames))
    if n_twins > MANY * n_boxes:
        found = (
            f"{n_twins} of {n_boxes} boxes share {SAME_BOX:.0%} or more of their area with another one of their frame"
        )
        advice = "suppress such pairs, with the model's --iou or in the program that wrote them"
        warnings.warn(f"{path}: {found}: {advice}", PomonaWarning, stacklevel=3)


def _n_twins(boxes_px: NDArray[np.float64]) -> int:
    """Count boxes, (D, 4), that lie on another one."""
    low = np.maximum(boxes_px[:, None, :2], boxes_px[None, :, :2])
    high = np.minimum(boxes_px[:, None, 2:], boxes_px[None, :, 2:])
    common = np.clip(high - low, 0, None).prod(axis=2)
    areas = (boxes_px[:, 2:] - boxes_px[:, :2]).prod(axis=1)
    overlap = common / (areas[:, None] + areas - common)
    np.fill_diagonal(overlap, 0.0)
    return int((overlap >= SAME_BOX).any(axis=1).sum())
