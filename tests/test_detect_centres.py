"""The map of the fruit network, read."""

from __future__ import annotations

import numpy as np
import pytest

from pomona.detect.onnx.candidates import Selection
from pomona.detect.onnx.centres import SIZE_PX, CentreDecoder

DECODER = CentreDecoder("fruits", stride=4)


def cells_of(centre: tuple[int, int], box_px: tuple[float, float, float, float], noise_px: float = 0.0) -> np.ndarray:
    """Give a map of 12 x 16 cells in which the cell `centre` is a fruit, its neighbours less so: all tell one box."""
    rows, columns = np.mgrid[:12, :16]
    x, y = (columns + 0.5) * 4, (rows + 0.5) * 4
    xmin, ymin, xmax, ymax = box_px
    away = np.maximum(abs(rows - centre[0]), abs(columns - centre[1]))
    off_px = np.random.default_rng(0).normal(0, noise_px, (4, 12, 16)) if noise_px else 0.0
    reaches_px = np.maximum(np.stack([x - xmin, y - ymin, xmax - x, ymax - y]) + off_px, 0.1)
    logits = np.where(away == 0, 2.0, np.where(away == 1, 1.5, -9.0))
    return np.concatenate([logits[None], np.log(reaches_px / SIZE_PX), np.zeros((1, 12, 16))])


def boxes_of(cells: np.ndarray) -> np.ndarray:
    found = DECODER({"fruits": cells.astype(np.float32)}, Selection(0.5))
    assert len(found.boxes_px) == 1
    return found.boxes_px[0]


@pytest.mark.parametrize("centre", [(6, 8), (0, 0), (11, 15), (0, 15), (11, 0)])
def test_where_neighbours_tell_the_same_box_it_is_that_box(centre: tuple[int, int]) -> None:
    x, y = 4 * centre[1] + 2.5, 4 * centre[0] + 1.5
    box_px = (x - 9, y - 8, x + 10, y + 8.5)
    np.testing.assert_allclose(boxes_of(cells_of(centre, box_px)), box_px, atol=1e-4)


def test_neighbours_average_what_single_cells_err_by() -> None:
    box_px = (20.0, 14.0, 46.0, 38.0)
    cells = cells_of((6, 8), box_px, noise_px=1.0)
    single = cells.copy()
    single[0] = np.where(single[0] == 2.0, 2.0, -30.0)
    averaged, alone = (np.abs(boxes_of(one) - box_px).mean() for one in (cells, single))
    assert averaged < 0.6 * alone


def test_a_neighbour_that_is_no_fruit_has_no_say() -> None:
    box_px = (20.0, 14.0, 46.0, 38.0)
    cells = cells_of((6, 8), box_px)
    cells[0, 6, 7], cells[1:5, 6, 7] = -9.0, 2.0
    np.testing.assert_allclose(boxes_of(cells), box_px, atol=0.01)
