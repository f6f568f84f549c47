r"""How far each size is believed to be one of the row's curve: a probability, by which it counts.

Some sizes are none of their fruit: of half a fruit behind a leaf, of another fruit, of none at all. And some fruits
have stopped growing, and hang on: their sizes are their own, but none of the row's curve any more. A verdict on each
would let one fruit at the border move the growth of all, so each size counts by its probability.

Beforehand a fruit has stopped after $z$ of the $S$ visits (see `stopped_fruits`) with the share $\pi_z$ of its tree
(see `stop_shares`). Whether it does or not, one size in a hundred is off, its logarithm by a
Gaussian error of standard deviation $B$: of a fruit none is off, or one. With $z_s$ the surprise at a size, given the
fruit's others, in standard deviations $\sigma_s$, the odds that this one is off against none are

$$ \frac{p}{1-p} \frac{1}{\sqrt{1 + q_s}} \exp\frac{z_s^2 q_s}{2 (1 + q_s)}, \qquad q_s = (B / \sigma_s)^2 $$

The shape and the shares are fitted with the sizes so trusted, and fruits and sizes are judged by them, in turn
until none moves (expectation-maximisation): fitted to all of them, the shape would believe the worst. It may climb the
wrong hill. Where a tree or half a row has stopped, a curve that suits no fruit can, with onsets far apart and scales
of visits that double, suit all somewhat, and none has stopped by it. So it is begun twice, from all fruits and from the
quarter that grows fastest, and the highest place on either way is believed: the last turns may lead down again, as
shares are learned where a stop shows alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from pomona.growth.curve_families import FAMILIES
from pomona.growth.fitting import likeliest_shape
from pomona.growth.hierarchy import Hierarchy
from pomona.growth.size_table import SizeTable
from pomona.growth.stop_shares import StopShares
from pomona.growth.stopped_fruits import four_numbers

__all__ = ["OFF_BY", "Trust", "trust_in_sizes"]

Numbers = NDArray[np.float64]

_OFF = 0.01
"""Share of sizes that are thought not to be their fruit's, before any is known."""

OFF_BY = 0.5
"""B, the standard deviation of the logarithm of such a size: half to twice of what it should be."""

_FASTEST, _HALF = 0.75, 0.5
"""From which quantile of growth on fruits are trusted where it is begun from the fastest, and which share has stopped
there: the rest."""

_BETTER = 3.0
"""By how much more, a logarithm, the second way must explain: what is no better is the same place, or as good a one."""

_LEAST_PRECISION = 1e-9
"""Of a logarithm that is foretold: of a size that is all but unknown, where rounding leaves less than nothing."""

_LEAST_SHARE = 1e-300
"""No fruit stops between two visits of one moment, and what follows from that it did has to be a number."""

_ROUNDS, _CLOSE = 30, 0.01
"""Of turns at most, and by how much the trust in a size may move in the last of them."""


@dataclass(frozen=True, eq=False)
class Trust:
    """In the sizes of N fruits on S visits, and in that they grow.

    Attributes
    ----------
    stops : (N, S + 1) float64
        Probability that the fruit stopped growing after so many visits; the last is that it still grows.
    in_size : (N, S + 1, S) float64
        Probability that a size is its fruit's own, where that stopped so; 1 where there is none.
    are_fruits : (N,) float64
        Probability that it is a fruit at all, and no thing that stays as it is.
    """

    stops: Numbers
    in_size: Numbers
    are_fruits: Numbers

    @property
    def in_curve(self) -> Numbers:
        """Probability of each size to be its fruit's own, and on the row's curve, (N, S)."""
        grew = np.arange(self.stops.shape[1])[:, None] > np.arange(self.in_size.shape[2])
        own = np.einsum("nz,zs,nzs->ns", self.stops, grew.astype(np.float64), self.in_size)
        return np.asarray(own * self.are_fruits[:, None])

    @property
    def stopped(self) -> Numbers:
        """Probability of each fruit that it has stopped growing, (N,)."""
        return np.asarray(self.stops[:, :-1].sum(axis=1))

    @property
    def put_aside(self) -> NDArray[np.bool_]:
        """The worst size of each fruit that likelier has one of another than not, (N, S)."""
        off = 1.0 - np.einsum("nz,nzs->ns", self.stops, self.in_size)
        return np.asarray((off.sum(axis=1, keepdims=True) > 0.5) & (off == off.max(axis=1, keepdims=True)))


def trust_in_sizes(table: SizeTable, are_fruits: Numbers | None = None) -> Trust:
    """Return how far sizes and fruits are trusted.

    Parameters
    ----------
    table : SizeTable
        Its own trust is not asked.
    are_fruits : (N,) float64, optional
        Probability of each that it is a fruit at all; for sure where that is not said.
    """
    are_fruits = np.ones(len(table.logs)) if are_fruits is None else are_fruits
    found, reached = _climbed_from(table, are_fruits, table.seen, StopShares.before(table))
    fastest = _fastest(table)
    if fastest.any():
        other, higher = _climbed_from(table, are_fruits, fastest[:, None] & table.seen, StopShares.before(table, _HALF))
        found = other if higher > reached + _BETTER else found
    return found


def _fastest(table: SizeTable) -> NDArray[np.bool_]:
    """Which fruits grow fastest against the middle of all, (N,), of those that were measured twice."""
    twice = np.flatnonzero(table.seen.sum(axis=1) > 1)
    fastest = np.zeros(len(table.logs), dtype=bool)
    if len(twice):
        beside = (table.logs - np.nanmedian(table.logs, axis=0))[twice]
        rows, seen = np.arange(len(twice)), table.seen[twice]
        last = seen.shape[1] - 1 - seen[:, ::-1].argmax(axis=1)
        growth = beside[rows, last] - beside[rows, seen.argmax(axis=1)]
        fastest[twice] = growth >= np.quantile(growth, _FASTEST)
    return fastest


def _climbed_from(
    table: SizeTable, are_fruits: Numbers, trusted: NDArray[np.bool_], shares: StopShares
) -> tuple[Trust, float]:
    """Fit and judge in turn, from sizes that are trusted, (N, S), and shares; also how well it explains all sizes."""
    start, in_curve = None, np.where(table.seen, trusted * are_fruits[:, None], 1.0)
    best: tuple[Trust, float] | None = None
    for _ in range(_ROUNDS):
        before, table = in_curve, table.trusted(in_curve)
        shape, start = likeliest_shape(table, FAMILIES["expolinear"], start)
        trust, explained = _judged(Hierarchy(table, FAMILIES["expolinear"], shape), shares, are_fruits)
        explained += shares.log_prior() - 0.5 * float(start @ start)
        if best is None or explained > best[1]:
            best = trust, explained
        shares = StopShares.learned(table, trust.stops, are_fruits)
        in_curve = np.where(table.seen, trust.in_curve, 1.0)
        if np.abs(in_curve - before).max() < _CLOSE:
            break
    assert best is not None
    return best


def _judged(model: Hierarchy, shares: StopShares, are_fruits: Numbers) -> tuple[Trust, float]:
    """Judge fruits and sizes by a model; also the logarithm of the density of all, what fruits share at its best."""
    table, effects = model.table, model.expected()
    n, n_visits = table.logs.shape
    strayed, rows, whole = model.expected_stray(effects), np.arange(n), np.ones((n, n_visits))
    log_priors = np.log(np.maximum(shares.trees, _LEAST_SHARE))[table.trees]
    log_odds = []
    for stop in range(n_visits + 1):
        own = four_numbers(model, effects, strayed, rows, np.full(n, stop), whole)
        off = np.where(table.seen, _log_odds_off(own.said, own.precisions), -np.inf)
        log_odds.append((log_priors[:, stop] + own.log_densities)[:, None] + np.pad(off, ((0, 0), (1, 0))))
    together = np.stack(log_odds, axis=1)
    of_stops = logsumexp(together, axis=2)
    of_fruits = logsumexp(of_stops, axis=1)
    trust = Trust(
        np.exp(of_stops - of_fruits[:, None]), -np.expm1(together[:, :, 1:] - of_stops[:, :, None]), are_fruits
    )
    return trust, float(are_fruits @ (of_fruits + model.log_scales()) + model.log_prior(effects))


def _log_odds_off(said: Numbers, precisions: Numbers) -> Numbers:
    """Return the log-odds that this size of a fruit is off against none, (N, S)."""
    precisions = np.maximum(precisions, _LEAST_PRECISION)
    ratio = OFF_BY**2 * precisions
    odds = np.log(_OFF / (1.0 - _OFF)) + 0.5 * (said**2 / precisions * ratio / (1.0 + ratio) - np.log1p(ratio))
    return np.asarray(odds)
