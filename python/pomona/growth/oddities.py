"""Fruits that grow like no other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pomona.growth.fitting import FittedShape
from pomona.growth.hierarchy import Hierarchy
from pomona.growth.size_table import SizeTable

__all__ = ["odd_fruits"]

_ODD_FRUIT = 0.001
"""Chance of a fruit as far from the others in size and onset as one that is called odd."""


def odd_fruits(table: SizeTable, fitted: FittedShape) -> NDArray[np.bool_]:
    """Tell fruits, (N,), whose own size and onset are far from those of the others."""
    shape = fitted.likeliest
    effects = Hierarchy(table, fitted.family, shape).expected()
    squares = (effects.sizes / shape.fruit_spread) ** 2 + (effects.onsets_days / shape.onset_spread_days) ** 2
    return np.asarray(squares > chi2.isf(_ODD_FRUIT, 2))
