"""A mesh of four-cornered faces with values at its corners."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Surface", "frames_along", "grid_faces"]


@dataclass(frozen=True, eq=False)
class Surface:
    """Many bodies of one material as one mesh.

    Attributes
    ----------
    vertices_m : (V, 3) float32
        Row frame.
    faces : (F, 4) int32
        Corners, anticlockwise seen from outside; of a leaf, from above.
    values : name to (V,) or (V, 3) float32
        What the material asks for at each vertex.
    """

    vertices_m: NDArray[np.float32]
    faces: NDArray[np.int32]
    values: dict[str, NDArray[np.float32]] = field(default_factory=dict)


def grid_faces(bodies: int, rows: int, columns: int, *, closed: bool) -> NDArray[np.int32]:
    """Join the vertices of `bodies` grids of `rows` x `columns`, numbered row by row, to faces.

    `closed` joins the last column to the first. Rows run away from a viewer whose columns run to the right.
    """
    last = columns if closed else columns - 1
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(last), indexing="ij")
    here, right = row * columns + column, row * columns + (column + 1) % columns
    one = np.stack([here, right, right + columns, here + columns], axis=-1).reshape(-1, 4)
    first = np.arange(bodies) * rows * columns
    return np.asarray((first[:, None, None] + one).reshape(-1, 4), dtype=np.int32)


def frames_along(axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations, (F, 3, 3), that take z to each axis."""
    aside = np.where(np.abs(axes[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(aside, axes)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(axes, first), axes], axis=-1)
