"""The map of the fruit network: where a fruit's centre is, and how far its box reaches from there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.detect.onnx.candidates import Candidates, Selection
from pomona.detect.onnx.network import Outputs

__all__ = ["CHANNELS", "CentreDecoder"]

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

CHANNELS = 6
"""Of the map: logit of a centre; log of left, top, right, bottom over `SIZE_PX`; logit of the visible share."""

SIZE_PX = 16.0
"""What distances to the edges of a box are told against."""

FARTHEST = 4.0
"""Logs of distances are cut there: e^4 times 16 px is wider than the input."""

AROUND = tuple((down, right) for down in (-1, 0, 1) for right in (-1, 0, 1))
"""A cell and its neighbours. Each tells the whole box, and they err less together than the best of them alone; farther
ones may tell another fruit's."""

MOST = 1000
"""Boxes of one picture: the best, where a least score near 0 would take every cell for one."""


@dataclass(frozen=True)
class CentreDecoder:
    """Reads a map (6, h, w).

    Attributes
    ----------
    map : str
        Name of the output.
    stride : int
        Pixels of the input for one cell.
    """

    map: str
    stride: int

    @property
    def classes(self) -> Sequence[int]:
        """Numbers of the classes: fruit."""
        return (0,)

    def __call__(self, outputs: Outputs, selection: Selection) -> Candidates:
        """Give a candidate for every cell that no neighbour outdoes."""
        cells = outputs[self.map].astype(np.float64)
        # Beyond 60 float64 has no more to say.
        scores = 1 / (1 + np.exp(-np.clip(cells[0], -60, 60)))
        rows, columns = np.nonzero((scores >= selection.min_score) & (scores >= _highest_around(scores)))
        best = np.argsort(-scores[rows, columns], kind="stable")[:MOST]
        rows, columns = rows[best], columns[best]
        boxes_px = self._boxes_px(cells[1:5], scores, rows, columns)
        sources = rows * scores.shape[1] + columns
        return Candidates(boxes_px, scores[rows, columns], np.zeros(len(rows), np.int64), sources)

    def _boxes_px(self, reaches: Array, scores: Array, rows: Rows, columns: Rows) -> Array:
        """Mean of the boxes that each of these cells and its neighbours tell, weighted by their squared scores."""
        height, width = scores.shape
        summed, weights = np.zeros((len(rows), 4)), np.zeros(len(rows))
        for down, right in AROUND:
            row, column = rows + down, columns + right
            inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
            row, column = row.clip(0, height - 1), column.clip(0, width - 1)
            edges_px = SIZE_PX * np.exp(np.clip(reaches[:, row, column].T, -FARTHEST, FARTHEST))
            middles_px = (np.stack([column, row], axis=1) + 0.5) * self.stride
            boxes_px = np.hstack([middles_px - edges_px[:, :2], middles_px + edges_px[:, 2:]])
            weight = np.where(inside, scores[row, column] ** 2, 0.0)
            summed += weight[:, None] * boxes_px
            weights += weight
        return summed / weights[:, None]


def _highest_around(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Highest of each cell and its eight neighbours."""
    height, width = scores.shape
    padded = np.pad(scores, 1, constant_values=-1.0)
    across = np.maximum(np.maximum(padded[:, :width], padded[:, 1 : width + 1]), padded[:, 2:])
    return np.asarray(np.maximum(np.maximum(across[:height], across[1 : height + 1]), across[2:]))
