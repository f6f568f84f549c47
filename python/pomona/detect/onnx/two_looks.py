"""Two looks at one picture, as it is and enlarged, and what they say together: test-time augmentation.

What a look says of a place are log-odds. Where both tell one box they are averaged, and where one of them tells none it
says as little as the least score that is looked at.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.detect.accuracy import areas, overlaps
from pomona.detect.onnx.candidates import Candidates, suppress

__all__ = ["ENLARGED", "LARGEST_PX", "LEAST", "Boxes", "agreed"]

ENLARGED = 1.5
"""How much larger the second look sees the picture. On validation pictures 1.25 is better for fruits of 40 px and worse
for those of 15, 2 worse for both; a third look adds less than half as much again."""

LEAST = 0.01
"""Least score of a look, whatever is asked of both together, so that scores do not depend on that."""

LARGEST_PX = 60.0
"""Larger fruits, by the geometric mean of their sides in the first look, are left to it. In the photographs that the
network has learnt from 99 % are smaller, and they were enlarged by 1.6 at the most; of those of 80 px the second look
finds less than half."""

Boxes = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Corners (N, 4), and scores (N,)."""


def agreed(first: Boxes, second: Boxes, iou: float, largest_px: float, min_score: float) -> Boxes:
    """Make one list of the boxes of two looks.

    Each box of the first, best first, goes with the free box of the second that it overlaps most, where that is `iou`
    or more: such a pair is one box, their mean weighted by the squared scores. On boxes larger than `largest_px` the
    second has no say, as if it said the same.

    Returns
    -------
    (M, 4) float64, (M,) float64
        Boxes and scores of at least `min_score`, best first; no two overlap by more than `iou`.
    """
    (first_px, first_scores), (second_px, second_scores) = first, _up_to(second, largest_px)
    large = areas(first_px) > largest_px**2
    partners = _partners(np.where(large[:, None], 0, overlaps(first_px, second_px)), first_scores, iou)
    paired, n = partners >= 0, len(first_px)
    alone = np.setdiff1d(np.arange(len(second_px)), partners)
    boxes_px = np.concatenate([first_px, second_px[alone]])
    said = np.full((len(boxes_px), 2), LEAST)
    said[:n, 0], said[n:, 1] = first_scores, second_scores[alone]
    said[:n][large, 1] = first_scores[large]
    said[:n][paired, 1] = second_scores[partners[paired]]
    here, there = np.hsplit(said[:n][paired] ** 2, 2)
    boxes_px[:n][paired] = (here * first_px[paired] + there * second_px[partners[paired]]) / (here + there)
    scores = 1 / (1 + np.exp(-_log_odds(said).mean(axis=1)))
    enough = scores >= min_score
    boxes_px, scores, numbers = boxes_px[enough], scores[enough], np.zeros(np.count_nonzero(enough), np.int64)
    kept = suppress(Candidates(boxes_px, scores, numbers, numbers), iou, across_classes=True)
    return kept.boxes_px, kept.scores


def _up_to(boxes: Boxes, largest_px: float) -> Boxes:
    boxes_px, scores = boxes
    small = areas(boxes_px) <= largest_px**2
    return boxes_px[small], scores[small]


def _partners(like: NDArray[np.float64], scores: NDArray[np.float64], iou: float) -> NDArray[np.intp]:
    """Column that goes with each row, each in one pair at the most; -1 where none does."""
    partners = np.full(len(like), -1, np.intp)
    for row in np.argsort(-scores, kind="stable") if like.shape[1] else ():
        column = like[row].argmax()
        if like[row, column] >= iou:
            partners[row] = column
            like[:, column] = 0.0
    return partners


def _log_odds(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    # Within 1e-9 of 0 and 1, where log-odds end.
    inside = np.clip(scores, 1e-9, 1 - 1e-9)
    return np.asarray(np.log(inside) - np.log1p(-inside))
