"""From a mask to the box that fits it tightly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.detect.onnx.candidates import Candidates

__all__ = ["tightened"]


def tightened(candidates: Candidates, size_px: tuple[int, int]) -> NDArray[np.float64]:
    """Give the boxes (N, 4) of the masks in the network's input; where a mask is empty, the box that there was.

    A mask counts inside its box only: the families are trained so, outside it may be anything.
    """
    if candidates.mask_of is None:
        return candidates.boxes_px
    boxes_px = candidates.boxes_px.copy()
    for row, source in enumerate(candidates.sources):
        tight_px = _tight(candidates.mask_of(int(source)), boxes_px[row], size_px)
        boxes_px[row] = boxes_px[row] if tight_px is None else tight_px
    return boxes_px


def _tight(
    logits: NDArray[np.float32], box_px: NDArray[np.float64], size_px: tuple[int, int]
) -> NDArray[np.float64] | None:
    columns, across = _interpolation(box_px[0], box_px[2], size_px[0], logits.shape[1])
    rows, down = _interpolation(box_px[1], box_px[3], size_px[1], logits.shape[0])
    inside = down @ logits.astype(np.float64) @ across.T > 0  # a logit of 0 is a probability of 1/2
    if not inside.any():
        return None
    x, y = columns[inside.any(axis=0)], rows[inside.any(axis=1)]
    tight_px = np.array([x[0], y[0], x[-1] + 1, y[-1] + 1], np.float64)
    return np.concatenate([np.maximum(tight_px[:2], box_px[:2]), np.minimum(tight_px[2:], box_px[2:])])


def _interpolation(
    low_px: float, high_px: float, size_px: int, cells: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Pixels from `low_px` to `high_px`, and weights (P, cells) that interpolate a mask of cells at their centres."""
    pixels = np.arange(max(int(np.floor(low_px)), 0), min(int(np.ceil(high_px)), size_px))
    places = np.clip((pixels + 0.5) * cells / size_px - 0.5, 0, cells - 1)
    weights = np.maximum(1 - np.abs(places[:, None] - np.arange(cells)), 0)
    return pixels, weights
