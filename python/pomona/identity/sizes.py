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

NOT_SLOW = 4.0
"""Fruits that are not slow, and are counted beside those that were seen: so that one or two odd sizes make no share."""

ROUNDS = 30
"""Of expectation-maximisation: from a tenth each, shares move by less than a hundredth afterwards."""

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
    $r \sim N(0, s)$ for one fruit, $r \sim N(0, S)$ for two. A share of fruits, learned from the sure pairs, has grown
    less, as those do that will drop: by anything from none to all of the growth $g$, $r \sim N(-x, s)$ over $x$ from 0
    to $g$.

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
    share = _share_slow(sure - growth, spread, among_all, growth)
    with np.errstate(divide="ignore"):
        grown, slow = np.log1p(-share) + _log_normal(off, spread), np.log(share * _slow(off, spread, growth))
    log_odds = np.logaddexp(grown, slow) - _log_normal(off, among_all)
    return np.where(known, np.maximum(log_odds, -MOST_AGAINST), 0.0)


def _share_slow(off: NDArray[np.float64], spread: float, among_all: float, growth: float) -> float:
    """Return the share of pairs that grew less, beside those that grew as all do and those that are no pairs."""
    grown, wrong = np.exp(_log_normal(off, spread)), np.exp(_log_normal(off, among_all))
    densities = np.stack([_slow(off, spread, growth), wrong + np.finfo(float).tiny, grown])
    shares, beside = np.array([0.1, 0.1, 0.8]), np.array([0.0, 0.0, NOT_SLOW])
    for _ in range(ROUNDS):
        of_each = shares[:, None] * densities
        shares = (of_each / of_each.sum(axis=0)).sum(axis=1) + beside
        shares /= shares.sum()
    return float(shares[0] / (1.0 - shares[1]))


def _log_normal(off: NDArray[np.float64], spread: float) -> NDArray[np.float64]:
    return np.asarray(-0.5 * (off / spread) ** 2 - np.log(np.sqrt(2.0 * np.pi) * spread))


def _slow(off: NDArray[np.float64], spread: float, growth: float) -> NDArray[np.float64]:
    """Return the density of fruits that grew less; 0 where none grew."""
    from scipy.special import ndtr

    if growth <= spread:
        return np.zeros(len(off))
    return np.asarray((ndtr((off + growth) / spread) - ndtr(off / spread)) / growth)
