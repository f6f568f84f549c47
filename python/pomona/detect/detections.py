"""Boxes around fruits in one picture, and the protocol of what finds them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording import Frame

__all__ = ["Detections", "Detector"]


@dataclass(frozen=True, eq=False)
class Detections:
    """Fruits found in one frame, one row a box.

    Attributes
    ----------
    boxes_px : (D, 4) float64
        xmin, ymin, xmax, ymax; origin at the top left corner of the top left pixel, so a box that covers the whole
        picture is (0, 0, width, height).
    scores : (D,) float64
        Confidence, 0 to 1.
    ids : tuple of D str, optional
        Names of the fruits where they are known; each at most once in a frame.
    looked : bool
        Whether a detector looked at the frame. Where none did, that it has no boxes says nothing.
    """

    boxes_px: NDArray[np.float64]
    scores: NDArray[np.float64]
    ids: tuple[str, ...] | None = None
    looked: bool = True

    def __post_init__(self) -> None:
        boxes_px = np.ascontiguousarray(self.boxes_px, np.float64)
        object.__setattr__(self, "boxes_px", boxes_px)
        object.__setattr__(self, "scores", np.ascontiguousarray(self.scores, np.float64))
        n = len(boxes_px)
        if boxes_px.shape != (n, 4) or self.scores.shape != (n,):
            raise PomonaError(f"detections: found shapes {boxes_px.shape}, {self.scores.shape}, expected (D, 4), (D,)")
        if not np.isfinite(boxes_px).all() or (boxes_px[:, :2] >= boxes_px[:, 2:]).any():
            raise PomonaError("detections: a box is not finite or has xmin >= xmax or ymin >= ymax")
        if not ((self.scores >= 0) & (self.scores <= 1)).all():
            raise PomonaError(
                f"detections: found scores from {self.scores.min():g} to {self.scores.max():g}, expected 0 to 1"
            )
        if self.ids is not None and (len(self.ids) != n or len(set(self.ids)) != n):
            raise PomonaError("detections: ids must be one for each box, each once in a frame")

    def __len__(self) -> int:
        return len(self.boxes_px)

    @classmethod
    def none(cls, *, looked: bool = True) -> Detections:
        """Give the detections of a frame without fruits, or of one that nobody looked at."""
        return cls(np.empty((0, 4)), np.empty(0), looked=looked)


class Detector(Protocol):
    """Finds fruits in a frame; it decodes the picture of the frame only if it needs it."""

    def __call__(self, frame: Frame) -> Detections:
        """Find the fruits of one frame."""
