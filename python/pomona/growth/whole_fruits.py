"""Expected fruits as whole ones, in one way for every table and for the page."""

from __future__ import annotations

import math

__all__ = ["whole_fruits"]

_SAME = 1e-6
"""Sums of the same probabilities in another order differ by less."""


def whole_fruits(expected: float) -> int:
    """Round what is expected: halves up, as the page does."""
    return math.floor(expected + 0.5 + _SAME)
