"""From the labels of a crop to what the network's map should be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.detect.training.shown_crops import PictureCrop

__all__ = ["STRIDE", "Targets", "targets_of"]

STRIDE = 4
"""Pixels of the picture for one cell of the map: a fruit of 7 px is still wider than a cell."""

SPREAD = 0.09
"""Standard deviation of the heat around a centre, as a part of the box's side: at a quarter of the side it is 2 %."""

LEAST_SPREAD = 0.55
"""The same in cells, at least: neighbours of a centre get some heat, or a shift by half a cell would be an error."""

REGRESSED = 0.25
"""Cells of so much heat say where the box is."""


@dataclass(frozen=True, eq=False)
class Targets:
    """What is wanted of the map of one crop, h by w cells.

    Attributes
    ----------
    heat : (h, w) float32
        1 at the centre of a fruit, falling off around it.
    punished : (h, w) float32
        1 where the absence of a fruit is known, 0 where it is not.
    weights : (h, w) float32
        How much the box of a cell counts.
    edges_px : (4, h, w) float32
        Left, top, right, bottom of the box from the middle of the cell.
    visible : (h, w) float32
        NaN where nobody knows.
    """

    heat: NDArray[np.float32]
    punished: NDArray[np.float32]
    weights: NDArray[np.float32]
    edges_px: NDArray[np.float32]
    visible: NDArray[np.float32]


def targets_of(crop: PictureCrop) -> Targets:
    """Give the targets of a crop."""
    cells = len(crop.pixels) // STRIDE
    made = Targets(
        heat=np.zeros((cells, cells), np.float32),
        punished=np.ones((cells, cells), np.float32),
        weights=np.zeros((cells, cells), np.float32),
        edges_px=np.ones((4, cells, cells), np.float32),
        visible=np.full((cells, cells), np.nan, np.float32),
    )
    for box_px in crop.ignored_px:
        made.punished[_cells_in(box_px)] = 0
    # Small fruits last: where boxes overlap, a small one has no other cells.
    areas = np.prod(crop.boxes_px[:, 2:] - crop.boxes_px[:, :2], axis=1)
    for row in np.argsort(-areas, kind="stable"):
        _paint(made, crop.boxes_px[row], crop.visible[row])
    return made


def _cells_in(box_px: NDArray[np.float32]) -> tuple[slice, slice]:
    left, top = np.floor(box_px[:2] / STRIDE).astype(int)
    right, bottom = np.ceil(box_px[2:] / STRIDE).astype(int)
    return slice(max(top, 0), bottom), slice(max(left, 0), right)


def _paint(made: Targets, box_px: NDArray[np.float32], visible: np.float32) -> None:
    """Lay one fruit over the maps."""
    middle, sides = (box_px[:2] + box_px[2:]) / (2 * STRIDE), (box_px[2:] - box_px[:2]) / STRIDE
    spread = np.maximum(SPREAD * sides, LEAST_SPREAD)
    rows, columns = _cells_in(box_px)
    y, x = (np.arange(cells.start, min(cells.stop, len(made.heat))) for cells in (rows, columns))
    centre = np.minimum(middle.astype(int), len(made.heat) - 1)
    across, down = (
        np.exp(-(((at - mid) / wide) ** 2) / 2) for at, mid, wide in zip((x, y), centre, spread, strict=True)
    )
    heat = (down[:, None] * across).astype(np.float32)
    np.maximum(made.heat[rows, columns], heat, out=made.heat[rows, columns])
    nearer = (heat >= REGRESSED) & (heat >= made.weights[rows, columns])
    # The weights of a fruit add up to about the same, whatever its size.
    made.weights[rows, columns][nearer] = heat[nearer]
    at_row, at_column = np.nonzero(nearer)
    x_px, y_px = (x[at_column] + 0.5) * STRIDE, (y[at_row] + 0.5) * STRIDE
    edges_px = np.stack([x_px - box_px[0], y_px - box_px[1], box_px[2] - x_px, box_px[3] - y_px])
    made.edges_px[:, rows, columns][:, nearer] = np.maximum(edges_px, 0.5)
    made.visible[rows, columns][nearer] = visible
