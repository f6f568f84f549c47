r"""How far each curve is believed, over which time: by what it foretells of the later visits.

Each visit from the third on is foretold from those before it; the sum of the logarithms of those densities is, by the
chain rule, what the evidence of all visits gains over that of the first two days. It judges sizes that a fit has not
seen. None is chosen: visits that are off by 2 % together seldom tell the families apart, and at the harvest they differ
by 10 mm. All are drawn from, each as often as it is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from pomona.growth.curve_families import FAMILIES
from pomona.growth.fitting import FittedShape, fit_shape
from pomona.growth.season_clock import SeasonClock
from pomona.growth.size_table import SizeTable

__all__ = ["WeighedCurve", "weighed_curves"]

_ODDS = {"expolinear": 0.0, "logistic": -1.0, "gompertz": -1.0}
"""Logarithms of the odds before any visit. Apples are expolinear (Lakso and others 1995), but seasons that slow down
towards the harvest, as the others do, are no rarity: three of five are believed to be expolinear."""


@dataclass(frozen=True, eq=False)
class WeighedCurve:
    """A family over a clock, and how far it is believed.

    Attributes
    ----------
    fitted : FittedShape
    clock : SeasonClock
    table : SizeTable
        What it was fitted to, in the time of the clock.
    held_out : float
        Logarithm of the density of the later visits, given those before.
    weight : float
        Its share of the belief, the sum over all curves is 1.
    """

    fitted: FittedShape
    clock: SeasonClock
    table: SizeTable
    held_out: float
    weight: float

    @property
    def name(self) -> str:
        """Of the family and the clock."""
        return f"{self.fitted.family.name} over {self.clock.name}"


def weighed_curves(
    diameters_mm: NDArray[np.float64],
    trees: NDArray[np.int64],
    trust: NDArray[np.float64],
    moments: Sequence[datetime],
    clocks: Sequence[SeasonClock],
) -> tuple[WeighedCurve, ...]:
    """Fit all families over all times; those that are believed most come first.

    Parameters
    ----------
    diameters_mm : (N, S) float64
        NaN where a visit did not measure the fruit; fruits in order of their trees.
    trees : (N,) int64
        Ascending, from 0.
    trust : (N, S) float64
        In each size.
    moments : sequence of S datetime
        Ascending, of two days or more.
    clocks : sequence of SeasonClock
    """
    n_first = _visits_of_two_days(moments)
    tried: list[tuple[FittedShape, SeasonClock, SizeTable, float]] = []
    for clock in clocks:
        table = SizeTable.of(diameters_mm, trees, clock.times(moments)).trusted(trust)
        for family in FAMILIES.values():
            fitted = fit_shape(table, family)
            gain = 0.0
            if n_first < len(moments):
                gain = fitted.log_evidence - fit_shape(table.first_visits(n_first), family).log_evidence
            tried.append((fitted, clock, table, gain))
    log_weights = np.array([gain + _ODDS[fitted.family.name] for fitted, _, _, gain in tried])
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    curves = [WeighedCurve(*one, weight) for one, weight in zip(tried, weights.tolist(), strict=True)]
    return tuple(sorted(curves, key=lambda curve: -curve.weight))


def _visits_of_two_days(moments: Sequence[datetime]) -> int:
    """How many of the first visits make two days, of which growth can be told."""
    days = [moment.date() for moment in moments]
    second = next(day for day in days if day != days[0])
    return sum(day <= second for day in days)
