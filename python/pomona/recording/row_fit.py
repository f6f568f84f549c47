"""What parts the rows of left and right pictures, fitted to corners of which some are false."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["RowFit", "row_fit"]

Array = NDArray[np.float64]

SPREAD_PX, FIRST_SPREAD, ROUNDS = 0.5, 8.0, 30
"""Deviations beyond four of this count nothing (Tukey's weights); it begins as many times as wide, and narrows."""


@dataclass(frozen=True, eq=False)
class RowFit:
    """A linear fit to N corners.

    Attributes
    ----------
    factors : (K,) float64
        Of the terms.
    inverse : (K, K) float64
        Of the weighted normal matrix: the covariance of the factors is this times the variance of a row.
    weights, left_over : (N,) float64
        How much each corner counts, 0 to 1, and by how many pixels its rows are further apart than the fit says.
    """

    factors: Array
    inverse: Array
    weights: Array
    left_over: Array


def row_fit(terms: Array, apart: Array) -> RowFit | None:
    """Fit the terms, (N, K) and the first of them 1, to what rows are apart, (N,); None where they are not fixed."""
    factors = np.zeros(terms.shape[1])
    factors[0] = np.median(apart)
    inverse, weights = np.eye(len(factors)), np.ones(len(apart))
    for spread_px in SPREAD_PX * FIRST_SPREAD ** np.linspace(1.0, 0.0, ROUNDS):
        weights = np.clip(1.0 - ((apart - terms @ factors) / (4.0 * spread_px)) ** 2, 0.0, None) ** 2
        matrix = (weights[:, None] * terms).T @ terms
        scale = np.sqrt(np.diag(matrix))
        if not (scale > 0).all() or np.linalg.matrix_rank(matrix / np.outer(scale, scale)) < len(matrix):
            return None
        inverse = np.linalg.inv(matrix)
        factors = inverse @ (terms.T @ (weights * apart))
    return RowFit(factors, inverse, weights, apart - terms @ factors)
