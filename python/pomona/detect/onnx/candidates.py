"""What a network proposes in one picture, and which of it stays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.detect.accuracy import shared_areas

__all__ = ["Candidates", "Selection", "from_centres", "select", "suppress"]


PAIRS_AT_ONCE = 1 << 20
"""Pairs of boxes that are compared at once: 8 MB for each number of them."""


@dataclass(frozen=True)
class Selection:
    """Which candidates are worth a look.

    Attributes
    ----------
    min_score : float
        The least confidence.
    classes : (C,) int64 or None
        Classes to keep, None for all.
    """

    min_score: float
    classes: NDArray[np.int64] | None = None


@dataclass(frozen=True, eq=False)
class Candidates:
    """Boxes of one picture, one row each.

    Attributes
    ----------
    boxes_px : (N, 4) float64
        xmin, ymin, xmax, ymax in the pixels of the network's input.
    scores : (N,) float64
        Confidence.
    classes : (N,) int64
        Class of the network.
    sources : (N,) int64
        Row in the network's output.
    mask_of : callable or None
        Gives the mask's logits (h, w), spread over the whole input, of a row in the network's output.
    """

    boxes_px: NDArray[np.float64]
    scores: NDArray[np.float64]
    classes: NDArray[np.int64]
    sources: NDArray[np.int64]
    mask_of: Callable[[int], NDArray[np.float32]] | None = None

    def __len__(self) -> int:
        return len(self.scores)

    def rows(self, rows: NDArray[np.int64]) -> Candidates:
        """Keep some rows, in the order given."""
        return Candidates(self.boxes_px[rows], self.scores[rows], self.classes[rows], self.sources[rows], self.mask_of)


def select(
    scores: NDArray[np.float64], selection: Selection
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Give rows, scores and classes of the rows of (N, C) scores whose best class that is wanted is good enough."""
    classes = np.arange(scores.shape[1]) if selection.classes is None else selection.classes
    wanted = scores[:, classes]
    best = wanted.argmax(axis=1)
    highest = wanted[np.arange(len(best)), best]
    rows = np.flatnonzero(highest >= selection.min_score)
    return rows, highest[rows].astype(np.float64), classes[best[rows]]


def from_centres(boxes_px: NDArray[np.floating]) -> NDArray[np.float64]:
    """Turn centre x, centre y, width, height into corners."""
    centres, halves = boxes_px[:, :2].astype(np.float64), boxes_px[:, 2:4].astype(np.float64) / 2
    return np.hstack([centres - halves, centres + halves])


def suppress(candidates: Candidates, iou: float, *, across_classes: bool) -> Candidates:
    """Keep of boxes that overlap by more than `iou` the one of the highest score: greedy non-maximum suppression.

    With `across_classes` the classes do not count: an apple that is both ripe and unripe is one apple.
    """
    order = np.argsort(-candidates.scores, kind="stable")
    boxes_px, classes = candidates.boxes_px[order], candidates.classes[order]
    alive = np.ones(len(order), bool)
    step = max(1, PAIRS_AT_ONCE // max(len(order), 1))
    for first in range(0, len(order), step):
        rows = first + np.flatnonzero(alive[first : first + step])
        same = _same(boxes_px[rows], boxes_px[first:], iou)
        if not across_classes:
            same &= classes[rows, None] == classes[None, first:]
        for row, repeated in zip(rows, same, strict=True):
            if alive[row]:
                alive[row + 1 :] &= ~repeated[row + 1 - first :]
    return candidates.rows(order[alive])


def _same(one_px: NDArray[np.float64], other_px: NDArray[np.float64], iou: float) -> NDArray[np.bool_]:
    """Whether each of (N, 4) boxes overlaps each of (M, 4) by more than `iou`, (N, M)."""
    shared = shared_areas(one_px, other_px)
    one, other = (np.prod(np.maximum(px[:, 2:] - px[:, :2], 0), axis=1) for px in (one_px, other_px))
    return np.asarray(shared > iou * (one[:, None] + other - shared))
