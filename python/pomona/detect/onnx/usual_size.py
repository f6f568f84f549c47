"""Pictures in which fruits are larger than a network has learnt from: it sees them smaller.

A network that takes pictures in their own size knows fruits of some sizes. In a photograph of 448 px it finds 41 px
ones; in the same one four times as large it finds their edges, and leaves.
"""

from __future__ import annotations

import numpy as np

from pomona.detect.accuracy import areas
from pomona.detect.onnx.two_looks import Boxes

__all__ = ["SHRUNK_LOOKS", "SMALL_PX", "USUAL_PX", "shrunk_by"]

USUAL_PX = 40.0
"""Side of a fruit, the geometric mean of its box's: of those that the shipped network has learnt from, the median in
photographs."""

SMALL_PX = 16.0
"""Median side of the boxes of a recording below which many fruits are missed: of an outsider's rendered rows of green
fruits 22 to 68 %, at 9.9 to 15.3 px, and 9 % at 16.6; those of `examples/row` have 19."""

TOO_LARGE = 1.5
"""Of the side that half of what is found is larger than, by area, against that: of edges and leaves that are taken for
fruits there may be many, but they are small."""

SHRUNK_LOOKS = 3
"""At the most: at first too much of what is found are no fruits, and they are smaller."""

SURE = 0.5
"""Score of the boxes that tell."""


def shrunk_by(found: Boxes, seen: float, usual_px: float | None) -> float:
    """Return by how much a picture is to be shrunk once more so that its fruits have their usual size; 1 where it fits.

    Parameters
    ----------
    found : boxes and scores
        Of a look, in the pixels of the picture.
    seen : float
        By how much that look saw it enlarged.
    usual_px : float, optional
        What the file of a network says; `USUAL_PX` where it is None.
    """
    boxes_px, scores = found
    sure_px2 = np.sort(areas(boxes_px[scores >= SURE]))
    if not len(sure_px2):
        return 1.0
    covered = np.cumsum(sure_px2)
    side_px = seen * float(np.sqrt(sure_px2[np.searchsorted(covered, 0.5 * covered[-1])]))
    usual = USUAL_PX if usual_px is None else usual_px
    return usual / side_px if side_px > TOO_LARGE * usual else 1.0
