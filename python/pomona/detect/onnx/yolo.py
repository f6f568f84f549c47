"""Outputs of the YOLO families.

A dense head gives a row for each cell of its grids (strides 8, 16, 32): centre and size in pixels of the input, in some
families an objectness, a score for each class, in -seg models coefficients that mix a mask out of prototypes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.detect.onnx.candidates import Candidates, Selection, from_centres, select
from pomona.detect.onnx.network import Outputs

__all__ = ["DenseDecoder", "EndToEndDecoder", "box_output", "cells_of", "grid", "prototype_output"]

STRIDES = ((8, 16, 32), (8, 16, 32, 64), (4, 8, 16, 32))
"""Of the usual models, of those for large pictures (P6), and of those for small things (P2)."""


def cells_of(size_px: tuple[int, int]) -> dict[int, tuple[int, ...]]:
    """Count the cells of the grids over an input, for each set of strides that is in use."""
    return {sum(math.prod(_cells(size_px, stride)) for stride in strides): strides for strides in STRIDES}


def grid(size_px: tuple[int, int], strides: tuple[int, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (A, 2) of the cells, in cells, and their strides (A, 1), row by row, grid after grid."""
    corners, sizes = [], []
    for stride in strides:
        columns, rows = np.meshgrid(*map(np.arange, _cells(size_px, stride)))
        corners.append(np.stack([columns.ravel(), rows.ravel()], axis=1))
        sizes.append(np.full((columns.size, 1), stride))
    return np.concatenate(corners).astype(np.float64), np.concatenate(sizes).astype(np.float64)


def _cells(size_px: tuple[int, int], stride: int) -> tuple[int, int]:
    return -(-size_px[0] // stride), -(-size_px[1] // stride)


def box_output(outputs: Outputs) -> str | None:
    """Name of the output with the boxes: `output0`, `output` in older exports, or the only one there is."""
    names = list(outputs.keys())
    named = [name for name in ("output0", "output") if name in names] or (names if len(names) == 1 else [])
    return named[0] if named and outputs[named[0]].ndim == 2 else None


def prototype_output(outputs: Outputs) -> str | None:
    """Name of the output with the prototypes of masks (M, h, w), None where there are no masks."""
    return "output1" if "output1" in outputs and outputs["output1"].ndim == 3 else None


@dataclass(frozen=True)
class DenseDecoder:
    """Reads a dense head.

    Attributes
    ----------
    boxes, prototypes : str, str or None
        Names of the outputs.
    n_classes : int
        Scores in a row.
    objectness : bool
        Whether a score comes before those of the classes, which they are to be multiplied by.
    transposed : bool
        Whether a column, and not a row, is a cell.
    cells : (A, 2) and (A, 1) float64, optional
        Corners and strides of the cells, where boxes are relative to them: centre = (corner + out) stride,
        size = exp(out) stride.
    """

    boxes: str
    prototypes: str | None
    n_classes: int
    objectness: bool
    transposed: bool
    cells: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def classes(self) -> Sequence[int]:
        """Numbers of the classes."""
        return range(self.n_classes)

    def __call__(self, outputs: Outputs, selection: Selection) -> Candidates:
        """Give the candidates of one picture."""
        head = outputs[self.boxes].T if self.transposed else outputs[self.boxes]
        first = 4 + self.objectness
        worth = np.flatnonzero(head[:, 4] >= selection.min_score) if self.objectness else np.arange(len(head))
        scores = head[worth, first : first + self.n_classes].astype(np.float64)
        if self.objectness:
            scores *= head[worth, 4:5]
        rows, best, classes = select(scores, selection)
        sources = worth[rows]
        centred = head[sources, :4].astype(np.float64)
        if self.cells is not None:
            corners, strides = self.cells[0][sources], self.cells[1][sources]
            centred = np.hstack([(centred[:, :2] + corners) * strides, np.exp(centred[:, 2:]) * strides])
        masks = _mixed(head[:, first + self.n_classes :], outputs, self.prototypes)
        return Candidates(from_centres(centred), best, classes, sources, masks)


@dataclass(frozen=True)
class EndToEndDecoder:
    """Reads a head that has chosen its boxes: xmin, ymin, xmax, ymax, score, class, coefficients."""

    boxes: str
    prototypes: str | None
    classes: Sequence[int] | None = None

    def __call__(self, outputs: Outputs, selection: Selection) -> Candidates:
        """Give the candidates of one picture."""
        head = outputs[self.boxes]
        classes = head[:, 5].astype(np.int64)
        wanted = np.ones(len(head), bool) if selection.classes is None else np.isin(classes, selection.classes)
        rows = np.flatnonzero(wanted & (head[:, 4] >= selection.min_score))
        masks = _mixed(head[:, 6:], outputs, self.prototypes)
        boxes_px = head[rows, :4].astype(np.float64)
        return Candidates(boxes_px, head[rows, 4].astype(np.float64), classes[rows], rows, masks)


def _mixed(
    coefficients: NDArray[np.float32], outputs: Outputs, prototypes: str | None
) -> Callable[[int], NDArray[np.float32]] | None:
    if prototypes is None:
        return None
    shapes = outputs[prototypes]
    return lambda row: np.asarray(np.tensordot(coefficients[row], shapes, axes=1), np.float32)
