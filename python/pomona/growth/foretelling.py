"""Sizes and rates of every fruit on any day, with what is known of them: folded over the draws of the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from pomona.growth.chance import Chance, evenly_spread
from pomona.growth.fitting import N_NUMBERS
from pomona.growth.hierarchy import Hierarchy
from pomona.growth.mixed_quantiles import mixed_quantile
from pomona.growth.shares import equal_shares
from pomona.growth.weighing import WeighedCurve

__all__ = ["CAMERA_SPREAD", "NINETY", "Foretold", "Summary", "foretell"]

Numbers = NDArray[np.float64]

_SHARED_DOUBT = 0.4
"""Of the variance of the lots by which fruits hang, what all share: the chances of seeing and of going that a map
believes in are off for all of its fruits together.
With 0.4 the counts of nine in ten of 42 drawn rows are in their intervals; with none, of four in ten."""

NINETY = (0.05, 0.95)
"""Quantiles of the 90 % intervals."""

_DRAWS, _LEAST_DRAWS, _SHARES = 512, 128, 300
"""Of a curve that is sure, and of each, by weight; and into how many equal shares all are put together."""

_LEAST_BELIEF, _LEAST_WEIGHT = 0.01, 1e-6
"""Of a curve, and of a draw: what is believed less adds nothing but time."""

_FINEST = 1e-9
"""Standard deviation of a logarithm, at least."""

CAMERA_SPREAD = 0.03
"""Standard deviation of the logarithm of the scale that all visits share, as they share their camera: with nominal
intrinsics apples of `kinect_apples` were 8 % too large, with calibrated ones 2 %. The visits cannot tell it."""

_A_DAY = 1.0
"""Over which the rate of the last visit is taken."""

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
        logs += [_Moments()] if belief else []
        for weight, own_logs, own_rates, visits, lots in _draws(curve, belief, moments):
            log_sizes, relative_rates = own_logs[rows], own_rates[rows]
            sizes_mm = np.exp(log_sizes)
            rates_mm = relative_rates * sizes_mm[:, n_visits - 1]
            for kept, drawn in ((logs[-1], log_sizes), (rates, rates_mm), (relative, relative_rates), (scales, visits)):
                kept.add(drawn, weight)
            hangs = (lots[rows] > least).astype(np.float64)
            for name, summary in summaries.items():
                told[name].append(summary(sizes_mm, rates_mm, hangs))
            weights.append(weight)
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


def _count(belief: float) -> int:
    """Part the draws by belief, in powers of two."""
    return max(_LEAST_DRAWS, 1 << int(np.ceil(np.log2(max(_DRAWS * belief, 1.0)))))


def _draws(
    curve: WeighedCurve, belief: float, moments: Sequence[datetime]
) -> Iterator[tuple[float, Numbers, Numbers, Numbers, Numbers]]:
    """Give weight, log sizes (N, Q), relative rates a day (N,) at the last visit, errors of visits (S,), lots (N,).

    Draw by draw; a lot is a standard normal number that says whether a fruit hangs. The sum of the weights is the
    belief in the curve.
    """
    table, family = curve.table, curve.fitted.family
    times, n_visits = curve.clock.times(moments), len(table.times)
    per_day = curve.clock.per_day(moments[n_visits - 1])
    with_next_day = np.insert(times, n_visits, table.times[-1] + _A_DAY)
    chance = Chance(curve.name, _count(belief), N_NUMBERS + 1, n_visits)
    first = evenly_spread(f"{curve.name}: first", _DRAWS, N_NUMBERS + 1)
    shapes, weights = curve.fitted.weighed(first, chance.shapes) if belief else ((), np.empty(0))
    for shape, weight in zip(shapes, belief * weights, strict=True):
        chance.next_draw()
        if weight < _LEAST_WEIGHT:
            continue
        model = Hierarchy(table, family, shape)
        effects = model.draw(chance)
        # Of one camera all sizes are too large alike. The mean takes that up: its prior is wide, so nothing else moves.
        camera = CAMERA_SPREAD * chance.shared("camera")[0]
        own = effects.mean - camera + effects.trees[table.trees] + effects.sizes
        # The onset moves the curve itself here, not its tangent.
        later = times - effects.onsets_days[:, None]
        x = shape.rate_per_day * (table.times[-1] - effects.onsets_days - shape.onset_day)
        strayed = model.draw_stray(effects, with_next_day, chance)
        strays_by = (strayed[n_visits] - strayed[n_visits - 1]) / _A_DAY
        yield (
            float(weight),
            own[:, None] + model.log_size(later) + np.delete(strayed, n_visits),
            per_day * (shape.rate_per_day * family.slope(x) + strays_by),
            effects.visits - strayed[:n_visits],
            np.sqrt(_SHARED_DOUBT) * chance.shared("hanging")[0]
            + np.sqrt(1.0 - _SHARED_DOUBT) * chance.single("hanging", len(own)),
        )


class _Moments:
    """Mean and standard deviation of weighted arrays that come one by one (West 1979)."""

    def __init__(self) -> None:
        self.weight = 0.0
        self.mean: Numbers = np.zeros(())
        self._squares: Numbers = np.zeros(())

    def add(self, values: Numbers, weight: float) -> None:
        self.weight += weight
        away = values - self.mean
        self.mean = self.mean + away * (weight / self.weight)
        self._squares = self._squares + weight * away * (values - self.mean)

    @property
    def sigma(self) -> Numbers:
        return np.asarray(np.sqrt(self._squares / self.weight))
