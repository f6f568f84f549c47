"""How right boxes are: which of them are fruits, average precision, recall where precision is high enough."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.detect.detections import Detections

__all__ = ["Found", "Judged", "areas", "judged", "overlaps", "shared_areas"]

SAME_IOU = 0.5
"""Overlap from which on a box is that of a fruit: the 50 of AP50."""


@dataclass(frozen=True, eq=False)
class Found:
    """What was found in one picture, and what is there.

    Attributes
    ----------
    detections : Detections
    boxes_px : (N, 4) float
        Of the fruits.
    ignored_px : (M, 4) float
        What lies there is neither right nor wrong.
    smallest_px : float
        Smaller boxes, by the geometric mean of their sides, may be fruits of rows behind that nobody labelled: neither
        right nor wrong too.
    """

    detections: Detections
    boxes_px: NDArray[np.floating]
    ignored_px: NDArray[np.floating]
    smallest_px: float = 0.0


@dataclass(frozen=True, eq=False)
class Judged:
    """Boxes of many pictures, best first.

    Attributes
    ----------
    scores : (D,) float64
    right : (D,) bool
        Whether it is a fruit that no better box is.
    n_fruits : int
    """

    scores: NDArray[np.float64]
    right: NDArray[np.bool_]
    n_fruits: int

    @property
    def precision(self) -> NDArray[np.float64]:
        """Share of fruits among the best 1, 2, ... boxes."""
        return np.asarray(np.cumsum(self.right) / np.arange(1, len(self.right) + 1))

    @property
    def recall(self) -> NDArray[np.float64]:
        """Share of all fruits that are among them."""
        return np.asarray(np.cumsum(self.right) / max(self.n_fruits, 1))

    @property
    def average_precision(self) -> float:
        """Area under the highest precision at each recall or a higher one."""
        highest = np.maximum.accumulate(self.precision[::-1])[::-1]
        return float((np.diff(self.recall, prepend=0.0) * highest).sum())

    def recall_at(self, precision: float) -> float:
        """Highest recall where the precision is at least so high; 0 where it never is."""
        return float(self.recall[self.precision >= precision].max(initial=0.0))

    def above(self, score: float) -> tuple[float, float]:
        """Precision and recall of the boxes with at least that score."""
        taken = int((self.scores >= score).sum())
        hits = int(self.right[:taken].sum())
        return hits / max(taken, 1), hits / max(self.n_fruits, 1)

    def score_of_right_count(self) -> float:
        """Score above which there are as many boxes as fruits: as many false ones as missed ones."""
        return float(self.scores[min(self.n_fruits, len(self.scores)) - 1])


def judged(pictures: Iterable[Found]) -> Judged:
    """Judge the boxes of pictures: each is, best first, the fruit that it overlaps most and that is still free."""
    scores, right, n_fruits = [np.empty(0)], [np.empty(0, bool)], 0
    for found in pictures:
        hits = _hits(found)
        free = ~hits & _is_open(found)
        scores.append(found.detections.scores[~free])
        right.append(hits[~free])
        n_fruits += len(found.boxes_px)
    all_scores, all_right = np.concatenate(scores), np.concatenate(right)
    order = np.argsort(-all_scores, kind="stable")
    return Judged(all_scores[order], all_right[order], n_fruits)


def _is_open(found: Found) -> NDArray[np.bool_]:
    boxes_px = found.detections.boxes_px
    return (_share_in(boxes_px, found.ignored_px) >= SAME_IOU) | (areas(boxes_px) < found.smallest_px**2)


def _hits(found: Found) -> NDArray[np.bool_]:
    boxes_px = found.detections.boxes_px
    like = overlaps(boxes_px, found.boxes_px)
    hits = np.zeros(len(boxes_px), bool)
    for row in np.argsort(-found.detections.scores, kind="stable"):
        if like.shape[1] and like[row].max() >= SAME_IOU:
            hits[row] = True
            like[:, like[row].argmax()] = 0
    return hits


def overlaps(one_px: NDArray[np.floating], other_px: NDArray[np.floating]) -> NDArray[np.float64]:
    """Intersection over union of each of (N, 4) boxes with each of (M, 4), (N, M)."""
    shared = shared_areas(one_px, other_px)
    union = areas(one_px)[:, None] + areas(other_px)[None] - shared
    return np.asarray(shared / np.maximum(union, 1e-9))


def _share_in(boxes_px: NDArray[np.floating], regions_px: NDArray[np.floating]) -> NDArray[np.float64]:
    """Share of each box that lies in the region that holds most of it."""
    return np.asarray((shared_areas(boxes_px, regions_px) / areas(boxes_px)[:, None]).max(axis=1, initial=0.0))


def shared_areas(one_px: NDArray[np.floating], other_px: NDArray[np.floating]) -> NDArray[np.float64]:
    """Area that each of (N, 4) boxes shares with each of (M, 4), (N, M)."""
    width, height = (
        np.maximum(
            np.minimum(one_px[:, None, end], other_px[:, end]) - np.maximum(one_px[:, None, start], other_px[:, start]),
            0,
        )
        for start, end in ((0, 2), (1, 3))
    )
    return np.asarray(width * height, np.float64)


def areas(boxes_px: NDArray[np.floating]) -> NDArray[np.float64]:
    """Area of each of (N, 4) boxes, (N,)."""
    return np.asarray((boxes_px[:, 2:] - boxes_px[:, :2]).prod(axis=1), np.float64)
