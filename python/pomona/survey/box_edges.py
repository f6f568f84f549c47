"""How large boxes are beside the fruits that pictures show: diameters come out as wrong as the boxes are.

Around each box lie ellipses of its shape, smaller and larger. Where an ellipse lies on the outline of the fruit,
colours inside and outside of it differ all around; elsewhere the texture of fruits and leaves averages out around it.
Summed over many boxes the differences peak where outlines lie, whatever the fruits: of boxes that are 15 % larger the
peak is at 1 / 1.15 of where it is of boxes that fit, to within 1 % in photographs.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaWarning
from pomona.recording import Recording
from pomona.survey.part import Boxes
from pomona.survey.sampled_boxes import pictures_of, sampled_boxes

__all__ = ["check_size_of_boxes", "outline_of"]

Array = NDArray[np.float64]

ELLIPSES = np.geomspace(0.55, 1.7, 46)
"""Radii of the ellipses over those of the box: each is 2.5 % larger than the one before."""

BESIDE = 0.06
"""Of its radius inside and outside of an ellipse, where colours are compared."""

ANGLES = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)

LEAST_RADIUS_PX = 5.0
"""Of a box; what lies inside and outside of the outline of a smaller fruit shares its pixels."""

LOOKED_AT = 20
"""Frames."""

OF_A_FRAME = 50
"""Boxes of a frame that are looked at, at the most."""

MANY = 200
"""Boxes below which their size is not told: of so many the peak is known to within 3 %."""

CLEAR = 1.2
"""Times the median over all ellipses that the peak is high: 1.3 to 3.2 in eight sets of pictures."""

FITTING = (0.89, 1.06)
"""Outlines over boxes that fit, with a margin. Of 200 boxes each they were 0.92 to 1.00, by hand in four kinds of
photographs and the true ones of seven drawn rows; of boxes 15 % larger 0.80 to 0.87, 15 % smaller 1.08 to 1.19."""

USUAL = 0.965
"""Of the same boxes, all together: outlines are seen a little inside of them."""


def check_size_of_boxes(recording: Recording, parts: Sequence[Boxes]) -> None:
    """Warn where boxes are much larger or smaller than the fruits in the pictures."""
    if "left" not in recording.description()["pictures"]:
        return
    pictures = pictures_of(recording, sampled_boxes(parts, LOOKED_AT))
    outline = outline_of(np.concatenate([np.zeros((0, len(ELLIPSES))), *(_edges(*each) for each in pictures)]))
    if outline is not None and not FITTING[0] <= outline <= FITTING[1]:
        found = f"boxes are {USUAL / outline:.2f} times as large as the fruits whose outlines the pictures show"
        advice = "diameters are off by as much; give boxes that close around what shows of each fruit"
        warnings.warn(f"{recording.path}: {found}: {advice}", PomonaWarning, stacklevel=3)


def outline_of(edges: Array) -> float | None:
    """Radius of the outlines over that of the boxes.

    Parameters
    ----------
    edges : (B, E) float64
        How much colours differ at each ellipse of each box.

    Returns
    -------
    float or None
        None where too few boxes show it, or none clearly.
    """
    if len(edges) < MANY:
        return None
    mean = (edges / np.maximum(edges.max(axis=1, keepdims=True), 1e-9)).mean(axis=0)
    peak = int(np.argmax(mean))
    if not 0 < peak < len(mean) - 1 or mean[peak] < CLEAR * np.median(mean):
        return None
    before, at, after = mean[peak - 1 : peak + 2]
    between = 0.5 * (before - after) / (before - 2.0 * at + after)
    return float(ELLIPSES[peak] * (ELLIPSES[1] / ELLIPSES[0]) ** between)


def _edges(picture: NDArray[np.uint8], boxes_px: Array) -> Array:
    """Give by how much colours beside each ellipse differ, (B, E), of boxes whose ellipses are in the picture."""
    import cv2

    # Half a pixel: the middle of the first pixel is 0 to OpenCV, and half a pixel from the edge to a box.
    centres = (boxes_px[:, :2] + boxes_px[:, 2:]) / 2.0 - 0.5
    radii = (boxes_px[:, 2:] - boxes_px[:, :2]) / 2.0
    reach = ELLIPSES[-1] * (1.0 + BESIDE) * radii
    is_whole = ((centres >= reach) & (centres + reach <= np.array(picture.shape[1::-1]) - 1)).all(axis=1)
    rows = np.flatnonzero(is_whole & (radii.min(axis=1) >= LEAST_RADIUS_PX))
    around = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=-1)
    shares = np.concatenate([ELLIPSES * (1.0 - BESIDE), ELLIPSES * (1.0 + BESIDE)])
    unit = shares[:, None, None] * around
    colours = cv2.cvtColor(picture, cv2.COLOR_BGR2Lab).astype(np.float32)
    n_rows = min(len(rows), OF_A_FRAME)
    edges = np.empty((n_rows, len(ELLIPSES)))
    for each, row in enumerate(rows[np.arange(n_rows) * len(rows) // max(n_rows, 1)]):
        points = (centres[row] + radii[row] * unit).astype(np.float32)
        inside, outside = np.split(cv2.remap(colours, points[..., 0], points[..., 1], cv2.INTER_LINEAR).mean(axis=1), 2)
        edges[each] = np.linalg.norm(outside - inside, axis=1)
    return edges
