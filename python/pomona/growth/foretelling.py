"""Sizes and rates of every fruit on any day, with what is known of them: folded over the draws of the model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from pomona.growth.drawn_fruits import drawn_fruits
from pomona.growth.mixed_quantiles import mixed_quantile
from pomona.growth.shares import equal_shares
from pomona.growth.trust import Trust
from pomona.growth.weighing import WeighedCurve

__all__ = ["NINETY", "Foretold", "Summary", "foretell"]

Numbers = NDArray[np.float64]

NINETY = (0.05, 0.95)
"""Quantiles of the 90 % intervals."""

_SHARES = 300
"""Into how many equal shares all draws are put together."""

_LEAST_BELIEF = 0.01
"""Of a curve: what is believed less adds nothing but time."""

_FINEST = 1e-9
"""Standard deviation of a logarithm, at least."""

Summary = Callable[[Numbers, Numbers, Numbers], Numbers]
"""Takes the (N, Q) sizes in mm and the (N,) rates of one draw and how far each hangs, (N,), 0 or 1 in a draw; gives an
array of what is wanted of all fruits."""


@dataclass(frozen=True, eq=False)
class Foretold:
    """Of N fruits at Q times.

    Attributes
    ----------
    sizes_mm, lows_mm, highs_mm : (N, Q) float64
        Medians and 90 % intervals.
    rates_mm_per_day, rate_sigmas_mm_per_day, relative_rates_per_day : (N,) float64
        At the last visit.
    summaries : mapping of str to (D, ...) float64
        What was asked of all fruits together: means over D equal shares of the probability of each number.
    scales, scale_lows, scale_highs : (S,) float64
        Error of all sizes of each visit, as a factor, and its 90 % interval; without what all visits share.
    """

    sizes_mm: Numbers
    lows_mm: Numbers
    highs_mm: Numbers
    rates_mm_per_day: Numbers
    rate_sigmas_mm_per_day: Numbers
    relative_rates_per_day: Numbers
    summaries: Mapping[str, Numbers]
    scales: Numbers
    scale_lows: Numbers
    scale_highs: Numbers


def foretell(
    curves: Sequence[WeighedCurve],
    moments: Sequence[datetime],
    *,
    n_visits: int,
    trust: Trust,
    rows: NDArray[np.int64],
    hang_chances: Numbers,
    summaries: Mapping[str, Summary],
) -> Foretold:
    """Draw all fruits together again and again, each draw by its weight; keep means and summaries.

    What is told of the visits is the same whatever later moments are asked for.

    Parameters
    ----------
    curves : sequence of WeighedCurve
    moments : sequence of Q datetime
        The visits, then later ones.
    n_visits : int
    trust : Trust
        In the rows of the tables of the curves.
    rows : (N,) int64
        Of each fruit that is told of, the row in the tables of the curves.
    hang_chances : (N,) float64
        That it is a fruit and hangs: by lots of which a part is common to all.
    summaries : mapping of str to Summary
    """
    beliefs = np.array([curve.weight for curve in curves])
    beliefs = np.where(beliefs < _LEAST_BELIEF, 0.0, beliefs)
    beliefs /= beliefs.sum()
    rates, relative, scales = _Moments(), _Moments(), _Moments()
    told: dict[str, list[Numbers]] = {name: [] for name in summaries}
    weights: list[float] = []
    logs: list[_Moments] = []
    least = ndtri(1.0 - hang_chances)
    for curve, belief in zip(curves, beliefs.tolist(), strict=True):
        # What grows and what has stopped are two heaps of draws, of which one Gaussian would say little.
        grown, stood = _Moments(), _Moments()
        logs += [grown, stood] if belief else []
        for one in drawn_fruits(curve, belief, trust, moments):
            log_sizes, relative_rates = one.log_sizes[rows], one.relative_rates[rows]
            stopped = one.stopped[rows, None].astype(np.float64)
            sizes_mm = np.exp(log_sizes)
            rates_mm = relative_rates * sizes_mm[:, n_visits - 1]
            grown.add(log_sizes, one.weight * (1.0 - stopped))
            stood.add(log_sizes, one.weight * stopped)
            for kept, drawn in ((rates, rates_mm), (relative, relative_rates), (scales, one.errors)):
                kept.add(drawn, one.weight)
            hangs = (one.lots[rows] > least).astype(np.float64)
            for name, summary in summaries.items():
                told[name].append(summary(sizes_mm, rates_mm, hangs))
            weights.append(one.weight)
    low, middle, high = (np.exp(_quantile(level, logs)) for level in (NINETY[0], 0.5, NINETY[1]))
    return Foretold(
        sizes_mm=middle,
        lows_mm=low,
        highs_mm=high,
        rates_mm_per_day=rates.mean,
        rate_sigmas_mm_per_day=rates.sigma,
        relative_rates_per_day=relative.mean,
        summaries={name: equal_shares(np.array(drawn), np.array(weights), _SHARES) for name, drawn in told.items()},
        scales=np.exp(scales.mean),
        scale_lows=np.exp(scales.mean + ndtri(NINETY[0]) * scales.sigma),
        scale_highs=np.exp(scales.mean + ndtri(NINETY[1]) * scales.sigma),
    )


def _quantile(level: float, logs: Sequence[_Moments]) -> Numbers:
    means, sigmas = [one.mean for one in logs], [np.maximum(one.sigma, _FINEST) for one in logs]
    return mixed_quantile(level, [one.weight for one in logs], means, sigmas)


class _Moments:
    """Mean and standard deviation of weighted arrays that come one by one (West 1979); NaN where none has a weight.

    A weight is a number, or an array that goes with the values.
    """

    def __init__(self) -> None:
        self.weight: Numbers = np.zeros(())
        self._mean: Numbers = np.zeros(())
        self._squares: Numbers = np.zeros(())

    def add(self, values: Numbers, weight: float | Numbers) -> None:
        self.weight = self.weight + weight
        away = values - self._mean
        step = np.divide(weight, self.weight, out=np.zeros(self.weight.shape), where=self.weight > 0.0)
        self._mean = self._mean + away * step
        self._squares = self._squares + weight * away * (values - self._mean)

    @property
    def mean(self) -> Numbers:
        return np.where(self.weight > 0.0, self._mean, np.nan)

    @property
    def sigma(self) -> Numbers:
        none = np.full(np.broadcast_shapes(self.weight.shape, self._squares.shape), np.nan)
        return np.asarray(np.sqrt(np.divide(self._squares, self.weight, out=none, where=self.weight > 0.0)))
