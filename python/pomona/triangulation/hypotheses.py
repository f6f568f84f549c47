"""Places where fruits might be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Hypotheses"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Places where fruits might be.

    Attributes
    ----------
    boxes : (H, 2) int64
        Rows of the two boxes.
    positions : (H, 3) float64
        In the model.
    covariances : (H, 3, 3) float64
    diameters : (H,) float64
        Units of the model.
    evidence : (H,) float64
        For one fruit against chance, nats.
    n_proposed : int
        Of how many these are the best.
    """

    boxes: Rows
    positions: Array
    covariances: Array
    diameters: Array
    evidence: Array
    n_proposed: int = 0

    def select(self, rows: NDArray[np.generic]) -> Hypotheses:
        """Give some of them."""
        return Hypotheses(
            self.boxes[rows],
            self.positions[rows],
            self.covariances[rows],
            self.diameters[rows],
            self.evidence[rows],
            self.n_proposed,
        )
