"""Pictures with boxes around their fruits."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["Labelled"]

USUAL_PX = 35.0
"""Side of a usual fruit in a picture without any."""

SMALLEST = 0.6
"""Where small fruits have no boxes: what is smaller than this times the usual labelled fruit may be one of them."""


@dataclass(frozen=True, eq=False)
class Labelled:
    """One picture and what is known of it.

    Attributes
    ----------
    picture : Path
        The file.
    boxes_px : (N, 4) float32
        Fruits: xmin, ymin, xmax, ymax.
    visible : (N,) float32
        How much of each fruit is seen, 0 to 1; NaN where nobody knows.
    ignored_px : (M, 4) float32
        Where something may or may not be called a fruit: neither wanted nor punished.
    complete : bool
        Whether every fruit is in one of both; else small ones, of rows behind, are without a box.
    """

    picture: Path
    boxes_px: NDArray[np.float32]
    visible: NDArray[np.float32]
    ignored_px: NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 4), np.float32))
    complete: bool = False

    @property
    def smallest_px(self) -> float:
        """Side, in the geometric mean, from which on a fruit is sure to have a box."""
        if self.complete:
            return 0.0
        sides_px = np.sqrt(np.prod(self.boxes_px[:, 2:] - self.boxes_px[:, :2], axis=1))
        return SMALLEST * float(np.median(sides_px) if len(sides_px) else USUAL_PX)
