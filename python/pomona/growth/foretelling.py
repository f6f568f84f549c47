"""Sizes and rates of every fruit on any day, with what is known of them: folded over the draws of the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.growth.choosing import ChosenCurve
from pomona.growth.hierarchy import Hierarchy

__all__ = ["NINETY", "Foretold", "Summary", "foretell"]

Numbers = NDArray[np.float64]

NINETY = (0.05, 0.95)
"""Quantiles of the 90 % intervals."""

_NINETY_SIGMAS = 1.6449
_SEED = 22

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


def foretell(curve: ChosenCurve, times: Numbers, *, per_day: float, summaries: Mapping[str, Summary]) -> Foretold:
    """Draw all fruits together again and again, and keep means, spreads and summaries.

    Parameters
    ----------
    curve : ChosenCurve
    times : (Q,) float64
        In the time of the curve's clock.
    per_day : float
        How fast that clock runs at the last visit.
    summaries : mapping of str to Summary
    """
    logs, rates, relative, scales = _Moments(), _Moments(), _Moments(), _Moments()
    told: dict[str, list[Numbers]] = {name: [] for name in summaries}
    for log_sizes, relative_rates, visits in _draws(curve, times):
        sizes_mm = np.exp(log_sizes)
        at_last = len(curve.table.times) - 1
        rates_mm = per_day * relative_rates * sizes_mm[:, at_last]
        logs.add(log_sizes)
        rates.add(rates_mm)
        relative.add(per_day * relative_rates)
        scales.add(visits)
        for name, summary in summaries.items():
            told[name].append(summary(sizes_mm, rates_mm))
    away = _NINETY_SIGMAS * logs.sigma
    return Foretold(
        sizes_mm=np.exp(logs.mean),
        lows_mm=np.exp(logs.mean - away),
        highs_mm=np.exp(logs.mean + away),
        rates_mm_per_day=rates.mean,
        rate_sigmas_mm_per_day=rates.sigma,
        relative_rates_per_day=relative.mean,
        summaries={name: np.array(drawn) for name, drawn in told.items()},
        scales=np.exp(scales.mean),
    )


def _draws(curve: ChosenCurve, times: Numbers) -> Iterator[tuple[Numbers, Numbers, Numbers]]:
    """Give log sizes (N, Q), relative rates (N,) at the last visit and errors of visits (S,), draw by draw."""
    rng = np.random.default_rng(_SEED)
    table, family = curve.table, curve.fitted.family
    for shape in curve.fitted.draws(rng):
        model = Hierarchy(table, family, shape)
        effects = model.draw(rng)
        own = effects.mean + effects.trees[table.trees] + effects.sizes
        # The onset moves the curve itself here, not its tangent.
        later = times - effects.onsets_days[:, None]
        x = shape.rate_per_day * (table.times[-1] - effects.onsets_days - shape.onset_day)
        yield own[:, None] + model.log_size(later), shape.rate_per_day * family.slope(x), effects.visits


class _Moments:
    """Mean and standard deviation of arrays that come one by one (Welford 1962)."""

    def __init__(self) -> None:
        self._count = 0
        self.mean: Numbers = np.zeros(())
        self._squares: Numbers = np.zeros(())

    def add(self, values: Numbers) -> None:
        self._count += 1
        away = values - self.mean
        self.mean = self.mean + away / self._count
        self._squares = self._squares + away * (values - self.mean)

    @property
    def sigma(self) -> Numbers:
        return np.asarray(np.sqrt(self._squares / max(self._count - 1, 1)))
