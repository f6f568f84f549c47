r"""How far each size is believed to be its fruit's own: a probability, by which it counts.

Some sizes are not: of half a fruit behind a leaf, of another fruit, of none at all. A verdict on each would let one
fruit at the border move the growth of all, so each size counts by its probability. Beforehand one size in a hundred is
off, its logarithm by a Gaussian error of standard deviation $B$. Of a fruit none is off, or one: with $z_s$ the
surprise at a size, given the fruit's others, in standard deviations $\sigma_s$, the odds that this one is off against
none are

$$ \frac{p}{1-p} \frac{1}{\sqrt{1 + q_s}} \exp\frac{z_s^2 q_s}{2 (1 + q_s)}, \qquad q_s = (B / \sigma_s)^2 $$

The shape is fitted with the sizes so trusted, and the sizes are judged by the shape, in turn until neither moves
(expectation-maximisation): fitted to all of them, it would believe the worst.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from pomona.growth.curve_families import FAMILIES
from pomona.growth.fitting import likeliest_shape
from pomona.growth.hierarchy import Hierarchy
from pomona.growth.size_table import SizeTable

__all__ = ["OFF_BY", "put_aside", "trust_in_sizes"]

Numbers = NDArray[np.float64]

_OFF = 0.01
"""Share of sizes that are thought not to be their fruit's, before any is known."""

OFF_BY = 0.5
"""B, the standard deviation of the logarithm of such a size: half to twice of what it should be."""

_ROUNDS, _CLOSE = 30, 0.01
"""Of turns at most, and by how much the trust in a size may move in the last of them."""


def trust_in_sizes(table: SizeTable) -> Numbers:
    """Return the probability of each size to be its fruit's own, (N, S), 1 where there is none.

    Parameters
    ----------
    table : SizeTable
        Its own trust is not asked.
    """
    trust, start = np.ones(table.logs.shape), None
    for _ in range(_ROUNDS):
        before, table = trust, table.trusted(trust)
        shape, start = likeliest_shape(table, FAMILIES["expolinear"], start)
        trust = _judged(*Hierarchy(table, FAMILIES["expolinear"], shape).surprise())
        if np.abs(trust - before).max() < _CLOSE:
            break
    return trust


def _judged(surprise: Numbers, sigmas: Numbers) -> Numbers:
    """Return the trust that surprises deserve, both (N, S) and NaN where there is no size."""
    ratio = (OFF_BY / sigmas) ** 2
    log_odds = np.log(_OFF / (1.0 - _OFF)) + 0.5 * (surprise**2 * ratio / (1.0 + ratio) - np.log1p(ratio))
    log_odds = np.where(np.isnan(surprise), -np.inf, log_odds)
    # That none is off has the logarithm 0.
    together = logsumexp(np.pad(log_odds, ((0, 0), (1, 0))), axis=1, keepdims=True)
    return np.asarray(-np.expm1(log_odds - together))


def put_aside(trust: Numbers) -> NDArray[np.bool_]:
    """Tell the worst size of each fruit that likelier has one of another than not, (N, S)."""
    off = 1.0 - trust
    return np.asarray((off.sum(axis=1, keepdims=True) > 0.5) & (off == off.max(axis=1, keepdims=True)))
