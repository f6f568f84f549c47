"""Which fruits are in a layer that is clearly farther away than the others, as rows one behind the other are.

The distances are parted where the two sides scatter least about their middles. Of one row these middles are 3.5
scatters apart where its fruits are spread evenly, and 4.1 where they hang on a ring, as in an open vase; of two rows
they are 6 and more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["farther_layer"]

LEAST_APART_M = 1.5
"""Between the middles of two rows: an alley, and half of each row."""

SCATTERS_APART = 5.0
"""Between them too; between those of one row, and of two."""


def farther_layer(away_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which fruits, (N,) and so far away, are in a layer of their own behind others; none of one row."""
    n = len(away_m)
    if n < 2:
        return np.zeros(n, bool)
    sums, squares = (np.cumsum(np.sort(away_m) ** power) for power in (1, 2))
    n_near = np.arange(1, n)
    n_far = n - n_near
    near_m, far_m = sums[:-1] / n_near, (sums[-1] - sums[:-1]) / n_far
    scatter = np.maximum(squares[-1] - n_near * near_m**2 - n_far * far_m**2, 0.0)
    best = int(scatter.argmin())
    apart_m = far_m[best] - near_m[best]
    if apart_m < max(LEAST_APART_M, SCATTERS_APART * np.sqrt(scatter[best] / n)):
        return np.zeros(n, bool)
    return np.asarray(away_m > (near_m[best] + far_m[best]) / 2)
