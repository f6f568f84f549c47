r"""Which curve, over which time: what foretells the later visits best.

Each visit from the third on is foretold from those before it; the sum of the logarithms of those densities is, by the
chain rule, what the evidence of all visits gains over that of the first two. It judges sizes that a fit has not seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from pomona.growth.curve_families import FAMILIES
from pomona.growth.fitting import FittedShape, fit_shape
from pomona.growth.season_clock import SeasonClock
from pomona.growth.size_table import SizeTable

__all__ = ["ChosenCurve", "choose_curve"]

_ODDS = {"expolinear": 0.0, "logistic": -3.0, "gompertz": -3.0}
"""Logarithms of the odds before any visit. Apples are expolinear (Lakso and others 1995); the others bend more than
they do until late in the season, so they are taken when visits speak for them by twenty to one."""


@dataclass(frozen=True, eq=False)
class ChosenCurve:
    """The curve that foretells best.

    Attributes
    ----------
    fitted : FittedShape
    clock : SeasonClock
    table : SizeTable
        What it was fitted to, in the time of the clock.
    held_out : mapping of str to float
        Logarithm of the density of the later visits, given those before, of each curve that was tried.
    """

    fitted: FittedShape
    clock: SeasonClock
    table: SizeTable
    held_out: Mapping[str, float]


def choose_curve(
    diameters_mm: NDArray[np.float64],
    trees: NDArray[np.int64],
    moments: Sequence[datetime],
    clocks: Sequence[SeasonClock],
) -> ChosenCurve:
    """Fit all families over all times, and take the one that foretells best.

    Parameters
    ----------
    diameters_mm : (N, S) float64
        NaN where a visit did not measure the fruit; fruits in order of their trees.
    trees : (N,) int64
        Ascending, from 0.
    moments : sequence of S datetime
        Ascending, of two days or more.
    clocks : sequence of SeasonClock
    """
    n_first = _visits_of_two_days(moments)
    tried: list[tuple[float, ChosenCurve]] = []
    held_out: dict[str, float] = {}
    for clock in clocks:
        table = SizeTable.of(diameters_mm, trees, clock.times(moments))
        for name, family in FAMILIES.items():
            fitted = fit_shape(table, family)
            gain = 0.0
            if n_first < len(moments):
                first = fit_shape(table.first_visits(n_first), family)
                gain = fitted.log_evidence - first.log_evidence
            held_out[f"{name} over {clock.name}"] = gain
            tried.append((gain + _ODDS[name], ChosenCurve(fitted, clock, table, held_out)))
    return max(tried, key=lambda odds_and_curve: odds_and_curve[0])[1]


def _visits_of_two_days(moments: Sequence[datetime]) -> int:
    """How many of the first visits make two days, of which growth can be told."""
    days = [moment.date() for moment in moments]
    second = next(day for day in days if day != days[0])
    return sum(day <= second for day in days)
