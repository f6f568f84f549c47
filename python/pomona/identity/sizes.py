"""What sizes say of two sights: a fruit that grew as all do, or two fruits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["size_log_odds"]

SURE = 0.9
"""Pairs from which growth and its spread are taken."""

FEWEST = 10
"""Of them; fewer say nothing of growth."""

LEAST_SPREAD = 0.01
"""Of a ratio of diameters: no camera is better, and no two fruits grow alike to less."""

MOST_AGAINST = 4.0
"""Nats; a size that was measured wrong shall not outweigh the place."""

DEVIATIONS_OF_MAD = 1.4826
"""Standard deviation of a normal variable over its median absolute deviation."""


def size_log_odds(
    log_sizes: tuple[NDArray[np.float64], NDArray[np.float64]],
    of_pairs: tuple[NDArray[np.float64], NDArray[np.float64]],
    probabilities: NDArray[np.float64],
) -> NDArray[np.float64]:
    r"""Return the log-odds of each pair of two visits, (M,), by its ratio of diameters; zero where one is unknown.

    With $r$ the logarithm of the ratio of a pair, less its median over the sure pairs (the growth between the visits
    and the scale of their sizes), $s$ its spread over them, and $S^2$ the sum of both visits' variances:
    $r \sim N(0, s)$ for one fruit, $r \sim N(0, S)$ for two.

    Parameters
    ----------
    log_sizes
        Of all sights of the two visits, NaN where unknown.
    of_pairs
        Of the pairs, (M,) each.
    probabilities
        Of the pairs, by their places, (M,).
    """
    ratios = of_pairs[1] - of_pairs[0]
    known = np.isfinite(ratios)
    sure = ratios[known & (probabilities > SURE)]
    if len(sure) < FEWEST:
        return np.zeros(len(ratios))
    growth = np.median(sure)
    spread = np.hypot(DEVIATIONS_OF_MAD * np.median(np.abs(sure - growth)), LEAST_SPREAD)
    among_all = max(np.sqrt(sum(np.nanvar(sizes) for sizes in log_sizes)), spread)
    off = np.where(known, ratios - growth, 0.0)
    log_odds = 0.5 * (off / among_all) ** 2 - 0.5 * (off / spread) ** 2 + np.log(among_all / spread)
    return np.where(known, np.maximum(log_odds, -MOST_AGAINST), 0.0)
