"""What does not belong: sizes that are not their fruit's, and fruits that grow like no other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pomona.growth.curve_families import FAMILIES
from pomona.growth.fitting import FittedShape, fit_shape
from pomona.growth.hierarchy import Hierarchy
from pomona.growth.size_table import SizeTable

__all__ = ["odd_fruits", "odd_measurements"]

_SURPRISE = 4.0
"""Standard deviations beyond which a size is not its fruit's: one in 16,000 by chance."""

_ODD_FRUIT = 0.001
"""Chance of a fruit as far from the others in size and onset as one that is called odd."""


def odd_measurements(table: SizeTable) -> NDArray[np.bool_]:
    """Tell sizes, (N, S), that the rest of the table does not believe; of a fruit the worst, of a visit never all.

    A fruit taken for another, half of one behind a leaf, a starving one that stopped growing.
    """
    fitted = fit_shape(table, FAMILIES["expolinear"])
    surprise = np.abs(Hierarchy(table, fitted.family, fitted.likeliest).surprise())
    surprise = np.where(np.isnan(surprise), 0.0, surprise)
    odd = (surprise > _SURPRISE) & (surprise == surprise.max(axis=1, keepdims=True))
    return np.asarray(odd & (table.seen & ~odd).any(axis=0))


def odd_fruits(table: SizeTable, fitted: FittedShape) -> NDArray[np.bool_]:
    """Tell fruits, (N,), whose own size and onset are far from those of the others."""
    shape = fitted.likeliest
    effects = Hierarchy(table, fitted.family, shape).expected()
    squares = (effects.sizes / shape.fruit_spread) ** 2 + (effects.onsets_days / shape.onset_spread_days) ** 2
    return np.asarray(squares > chi2.isf(_ODD_FRUIT, 2))
