"""Which share of the fruits went at each place: a tree is grubbed up, a storm strips a stretch, and the next stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.identity.near_fruits import NearFruits

__all__ = ["fruits_about", "shares_of_places"]

ABOUT = 24
"""Fruits around each, itself left out, that tell the share of its place: a third of a tree."""

SHARES = 1.0 / (1.0 + np.exp(-np.linspace(-7.0, 7.0, 57)))
"""Where the posterior of the share of a place is asked."""

BETWEEN = np.concatenate([[0.0], 0.5 * (SHARES[:-1] + SHARES[1:]), [1.0]])

BY_CHANCE = 2.0
"""Standard errors of the variance of places, by chance of fruits alone, beyond which it counts."""

NOTHING = 1e-6

LEAST_WORTH = 0.1
"""Fruits: nearly all of a place went, or none."""


def fruits_about(places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the rows of the fruits that hang about each, (K, n), itself left out; `places`, (K, 3)."""
    if not len(places):
        return np.empty((0, 0), np.int64)
    rows = NearFruits(places).nearest(places, ABOUT + 1)[1]
    # Of two at one place either may come first.
    is_self = rows == np.arange(len(places))[:, None]
    is_self[~is_self.any(axis=1), -1] = True
    return np.asarray(rows[~is_self].reshape(len(places), max(rows.shape[1] - 1, 0)))


def shares_of_places(
    went: NDArray[np.float64], stayed: NDArray[np.float64], common: float, about: NDArray[np.int64]
) -> NDArray[np.float64]:
    r"""Return the share of the fruits that went about each, (K,), as the fruits around it show it, its own left out.

    Of a fruit that went with $p$ and stayed with $q$ where the share is the `common` one $h$, what was seen is by
    $1 + s\, (h' - h)$ as likely where it is $h'$, with $s = p / h - q / (1 - h)$. Shares of places scatter about the
    common one. How much, fruits that hang side by side say, as what chance has in one says nothing of the next: the
    mean of $s_i s_j$ is the variance times the squared mean of $s^2$. The belief about a place is worth
    $h (1 - h) / \mathrm{variance} - 1$ fruits (a beta distribution).

    Parameters
    ----------
    went, stayed : (K,) float64
        Probabilities that it is a fruit and went before the visit, and that it is one and hung on.
    common : float
    about : (K, n) int64
        As `fruits_about`.
    """
    # A fruit of which the looks say nothing has p = h and q = 1 - h, and tells of no place.
    slopes = went / common - stayed / (1.0 - common)
    telling = np.abs(slopes) > NOTHING
    pairs = telling[:, None] & telling[about]
    known = (slopes[telling] ** 2).mean() if pairs.any() else 0.0
    products = slopes[:, None] * slopes[about]
    beyond = products.sum() - BY_CHANCE * np.sqrt(2.0 * (products**2).sum())
    variance = beyond / max(pairs.sum() * known**2, 1e-300)
    if variance <= 0.0:
        return np.full(len(went), common)
    worth = max(common * (1.0 - common) / variance - 1.0, LEAST_WORTH)
    told = np.log1p(slopes[:, None] * (SHARES - common))
    weights = np.tile(_belief(common, worth), (len(went), 1))
    for one_about in about.T:
        weights += told[one_about]
    weights = np.exp(weights - weights.max(axis=1, keepdims=True))
    return np.asarray(weights @ SHARES / weights.sum(axis=1))


def _belief(common: float, worth: float) -> NDArray[np.float64]:
    """Return the logarithms of how much of a beta distribution with this mean is nearest to each of `SHARES`."""
    from scipy.special import betainc

    return np.asarray(np.log(np.maximum(np.diff(betainc(worth * common, worth * (1.0 - common), BETWEEN)), 1e-300)))
