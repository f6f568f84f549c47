"""Sizes and rates of every fruit on any day, with what is known of them: folded over the draws of the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from pomona.growth.hierarchy import Hierarchy
from pomona.growth.mixed_quantiles import mixed_quantile
from pomona.growth.weighing import WeighedCurve

__all__ = ["NINETY", "Foretold", "Summary", "foretell"]

Numbers = NDArray[np.float64]

NINETY = (0.05, 0.95)
"""Quantiles of the 90 % intervals."""

_SEED = 22

_DRAWS, _LEAST = 300, 3
"""Of all curves together, and of one that is drawn from at all: one alone has no spread."""

_FINEST = 1e-9
"""Standard deviation of a logarithm, at least."""

_A_DAY = 1.0
"""Over which the rate of the last visit is taken."""

Summary = Callable[[Numbers, Numbers], Numbers]
"""Takes the (N, Q) sizes in mm and the (N,) rates of one draw, gives an array of what is wanted of all fruits."""


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
        What was asked of all fruits together, for each of D draws.
    scales : (S,) float64
        Error of all sizes of each visit, as a factor.
    """

    sizes_mm: Numbers
    lows_mm: Numbers
    highs_mm: Numbers
    rates_mm_per_day: Numbers
    rate_sigmas_mm_per_day: Numbers
    relative_rates_per_day: Numbers
    summaries: Mapping[str, Numbers]
    scales: Numbers


def foretell(
    curves: Sequence[WeighedCurve], moments: Sequence[datetime], *, n_visits: int, summaries: Mapping[str, Summary]
) -> Foretold:
    """Draw all fruits together again and again, of each curve as often as it is believed; keep means and summaries.

    Parameters
    ----------
    curves : sequence of WeighedCurve
    moments : sequence of Q datetime
        The visits, then later ones.
    n_visits : int
    summaries : mapping of str to Summary
    """
    rng = np.random.default_rng(_SEED)
    counts = _counts([curve.weight for curve in curves])
    rates, relative, scales = _Moments(), _Moments(), _Moments()
    told: dict[str, list[Numbers]] = {name: [] for name in summaries}
    logs: list[_Moments] = []
    for curve, count in zip(curves, counts, strict=True):
        logs += [_Moments()] if count else []
        for log_sizes, relative_rates, visits in _draws(curve, count, moments, rng):
            sizes_mm = np.exp(log_sizes)
            rates_mm = relative_rates * sizes_mm[:, n_visits - 1]
            for kept, drawn in ((logs[-1], log_sizes), (rates, rates_mm), (relative, relative_rates), (scales, visits)):
                kept.add(drawn)
            for name, summary in summaries.items():
                told[name].append(summary(sizes_mm, rates_mm))
    low, middle, high = (np.exp(_quantile(level, logs)) for level in (NINETY[0], 0.5, NINETY[1]))
    return Foretold(
        sizes_mm=middle,
        lows_mm=low,
        highs_mm=high,
        rates_mm_per_day=rates.mean,
        rate_sigmas_mm_per_day=rates.sigma,
        relative_rates_per_day=relative.mean,
        summaries={name: np.array(drawn) for name, drawn in told.items()},
        scales=np.exp(scales.mean),
    )


def _counts(weights: Sequence[float]) -> list[int]:
    """Part the draws by weight; a curve of which fewer than `_LEAST` would come is left out."""
    shares = np.array(weights)
    shares = np.where(shares * _DRAWS < _LEAST, 0.0, shares)
    ends = np.round(np.cumsum(shares) / shares.sum() * _DRAWS).astype(int)
    return [int(count) for count in np.diff(ends, prepend=0)]


def _quantile(level: float, logs: Sequence[_Moments]) -> Numbers:
    means, sigmas = [one.mean for one in logs], [np.maximum(one.sigma, _FINEST) for one in logs]
    return mixed_quantile(level, [one.count / _DRAWS for one in logs], means, sigmas)


def _draws(
    curve: WeighedCurve, count: int, moments: Sequence[datetime], rng: np.random.Generator
) -> Iterator[tuple[Numbers, Numbers, Numbers]]:
    """Give log sizes (N, Q), relative rates a day (N,) at the last visit and errors of visits (S,), draw by draw."""
    table, family = curve.table, curve.fitted.family
    times, n_visits = curve.clock.times(moments), len(table.times)
    per_day = curve.clock.per_day(moments[n_visits - 1])
    for shape in curve.fitted.draws(rng, count) if count else ():
        model = Hierarchy(table, family, shape)
        effects = model.draw(rng)
        own = effects.mean + effects.trees[table.trees] + effects.sizes
        # The onset moves the curve itself here, not its tangent.
        later = times - effects.onsets_days[:, None]
        x = shape.rate_per_day * (table.times[-1] - effects.onsets_days - shape.onset_day)
        strayed = model.draw_stray(effects, np.append(times, table.times[-1] + _A_DAY), rng)
        strays_by = (strayed[-1] - strayed[n_visits - 1]) / _A_DAY
        yield (
            own[:, None] + model.log_size(later) + strayed[:-1],
            per_day * (shape.rate_per_day * family.slope(x) + strays_by),
            effects.visits - strayed[:n_visits],
        )


class _Moments:
    """Mean and standard deviation of arrays that come one by one (Welford 1962)."""

    def __init__(self) -> None:
        self.count = 0
        self.mean: Numbers = np.zeros(())
        self._squares: Numbers = np.zeros(())

    def add(self, values: Numbers) -> None:
        self.count += 1
        away = values - self.mean
        self.mean = self.mean + away / self.count
        self._squares = self._squares + away * (values - self.mean)

    @property
    def sigma(self) -> Numbers:
        return np.asarray(np.sqrt(self._squares / max(self.count - 1, 1)))
