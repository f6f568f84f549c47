r"""The two numbers of each fruit, its size and its onset: how sure they are given its measurements, and what is left.

With the weights $W_i$ of its measurements, their columns $X_i = (1, g)$ and the covariance $D$ of its two numbers,
their precision is $P_i = D^{-1} + X_i^T W_i X_i$. What the measurements say of everything else, the two integrated out,
is $M_i = W_i - W_i X_i P_i^{-1} X_i^T W_i$.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["OwnNumbers"]

Numbers = NDArray[np.float64]

_LEAST_WEIGHT = 1e-300
"""Of the measurements of a fruit: where it is less, there are none."""


@dataclass(frozen=True, eq=False)
class OwnNumbers:
    """Of N fruits on S visits, for one shape or for any number of them at once.

    Attributes
    ----------
    weights : (..., N, S)
        W, the precisions of the measurements, 0 for none.
    p11, p12 : (..., N)
        Of P.
    determinants : (..., N)
        Of P.
    rows : (..., N, 2, S)
        With P = L L', rows of L^-1 X' W.
    """

    weights: Numbers
    p11: Numbers
    p12: Numbers
    determinants: Numbers
    rows: Numbers

    @classmethod
    def of(cls, weights: Numbers, slopes: Numbers, spreads: tuple[Numbers, Numbers]) -> OwnNumbers:
        """Take weights, slopes g of the curve, (..., S), and the deviations of sizes and of onsets, (..., 1) each."""
        of_size, of_onset = (spread**-2 for spread in spreads)
        slopes = slopes[..., None, :]
        whole, p12 = weights.sum(axis=-1), (weights * slopes).sum(axis=-1)
        p11 = of_size + whole
        # p11 p22 - p12^2 in parts that are none below 0: where the prior says next to nothing, rounding eats the rest.
        apart = slopes - (p12 / np.maximum(whole, _LEAST_WEIGHT))[..., None]
        of_slopes, of_apart = ((weights * part**2).sum(axis=-1) for part in (slopes, apart))
        determinants = of_onset * p11 + of_size * of_slopes + whole * of_apart
        first = weights / np.sqrt(p11)[..., None]
        left = np.sqrt(determinants / p11)[..., None]
        second = weights * (slopes - (p12 / p11)[..., None]) / left
        return cls(weights, p11, p12, determinants, np.stack([first, second], axis=-2))

    def said_by(self, residuals: Numbers) -> tuple[Numbers, Numbers]:
        """Return M r, (..., N, S), and r' M r, (..., N), of residuals r."""
        told = (self.rows * residuals[..., None, :]).sum(axis=-1)
        said = self.weights * residuals - (self.rows * told[..., None]).sum(axis=-2)
        return said, (self.weights * residuals**2).sum(axis=-1) - (told**2).sum(axis=-1)
