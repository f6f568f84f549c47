"""True boxes around what each fruit shows, and how much of it shows."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from numpy.typing import NDArray

    from pomona.recording.calibration import Calibration
    from pomona.synth.row_geometry import FruitSolids

__all__ = ["TrueBoxes", "boxes_in", "full_pixels", "write_boxes"]


@dataclass(frozen=True, eq=False)
class TrueBoxes:
    """Boxes of one frame.

    Attributes
    ----------
    ids : (B,) int64
    boxes_px : (B, 4) int64
        xmin, ymin, xmax, ymax of the pixels that show the fruit; the far edges are those of the last pixels.
    visible : (B,) float64
        How many pixels show it, against how many would if nothing stood in front and the picture had no end.
    """

    ids: NDArray[np.int64]
    boxes_px: NDArray[np.int64]
    visible: NDArray[np.float64]


def boxes_in(
    mask: NDArray[np.unsignedinteger[Any]],
    fruits: FruitSolids,
    camera: Calibration,
    session_from_camera: NDArray[np.float64],
) -> TrueBoxes:
    """Give the boxes of all fruits in a mask, (H, W)."""
    from scipy.ndimage import find_objects

    slices = find_objects(mask.astype(np.int32))
    ids = np.array([number for number, found in enumerate(slices, start=1) if found is not None], np.int64)
    edges = [(x.start, y.start, x.stop, y.stop) for y, x in filter(None, slices)]
    shown = np.bincount(mask.ravel(), minlength=1)[ids]
    rows = {number: row for row, number in enumerate(fruits.ids.tolist())}
    full = full_pixels(fruits, camera, session_from_camera)[[rows[number] for number in ids.tolist()]]
    return TrueBoxes(ids, np.array(edges, np.int64).reshape(-1, 4), np.minimum(shown / full, 1.0))


def full_pixels(
    fruits: FruitSolids, camera: Calibration, session_from_camera: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Area in pixels, (F,), of each fruit with nothing in front: of an ellipsoid of its diameter and height.

    The shadow of an ellipsoid of semi-axes a, a, b along a ray that leaves its axis by an angle t is an ellipse of
    semi-axes a and (b^2 sin^2 t + a^2 cos^2 t)^(1/2).
    """
    rotation, place = session_from_camera[:3, :3], session_from_camera[:3, 3]
    seen = (fruits.centres_m - place) @ rotation
    rays = (fruits.centres_m - place) / np.linalg.norm(seen, axis=1, keepdims=True)
    along = (rays * fruits.axes).sum(axis=1) ** 2
    a, b = 0.5 * fruits.diameters_m, 0.5 * fruits.heights_m
    area_m2 = np.pi * a * np.sqrt(b**2 * (1.0 - along) + a**2 * along)
    # Off the optical axis a disc is seen larger, by the distance against the depth.
    depth_m = np.maximum(seen[:, 2], 1e-3)
    return np.asarray(area_m2 * camera.fx * camera.fy / depth_m**2 * np.linalg.norm(seen, axis=1) / depth_m)


def write_boxes(path: Path, frames: Iterable[int], boxes: Iterable[TrueBoxes]) -> None:
    """Write `frame,xmin,ymin,xmax,ymax,id,visible`, one line a box."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("frame", "xmin", "ymin", "xmax", "ymax", "id", "visible"))
        for frame, found in zip(frames, boxes, strict=True):
            for number, edges, share in zip(found.ids, found.boxes_px, found.visible, strict=True):
                writer.writerow((frame, *edges, number, f"{share:.3f}"))
