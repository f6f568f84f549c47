"""How far diameters agree with calipers (Bland and Altman 1986): bias, RMSE and limits of agreement."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pomona.growth.caliper_pairs import CaliperPair
from pomona.growth.drawn_names import drawn_name
from pomona.plot.sheet import FAINT, INK

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Agreement", "agreement_by_date", "agreement_of", "draw_agreement"]

_SIGMAS = 1.96
"""Of the limits of agreement: 95 % of the differences lie between them."""

_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#000000", "#999933")


@dataclass(frozen=True)
class Agreement:
    """Diameters against calipers, measured minus caliper, mm.

    Attributes
    ----------
    n : int
        Pairs.
    bias_mm, rmse_mm : float
        Mean difference, and the root of the mean square.
    low_mm, high_mm : float
        Limits of agreement, bias and 1.96 standard deviations; NaN for a single pair.
    """

    n: int
    bias_mm: float
    rmse_mm: float
    low_mm: float
    high_mm: float


def agreement_of(pairs: Sequence[CaliperPair]) -> Agreement:
    """Compare one pair or more."""
    differences = np.array([pair.measured_mm - pair.caliper_mm for pair in pairs])
    bias = float(differences.mean())
    sigma = float(differences.std(ddof=1)) if len(pairs) > 1 else math.nan
    rmse = float(np.sqrt((differences**2).mean()))
    return Agreement(len(pairs), bias, rmse, bias - _SIGMAS * sigma, bias + _SIGMAS * sigma)


def agreement_by_date(pairs: Sequence[CaliperPair]) -> dict[str, Agreement]:
    """Compare visit by visit, in order of date; visits of one day go by their names too."""
    return {name: agreement_of(of_visit) for name, of_visit in _by_visit(pairs).items()}


def _by_visit(pairs: Sequence[CaliperPair]) -> dict[str, list[CaliperPair]]:
    """Take the pairs apart by visit, each called by its day, and by its session where the day had several."""
    visits = sorted({(pair.day, pair.session) for pair in pairs})
    days = [day for day, _ in visits]
    return {
        day.isoformat() if days.count(day) == 1 else f"{day} {session}": [
            pair for pair in pairs if (pair.day, pair.session) == (day, session)
        ]
        for day, session in visits
    }


def draw_agreement(pairs: Sequence[CaliperPair]) -> Figure:
    """Draw differences against means, with the bias and the limits of agreement; a colour for each visit."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.6), dpi=110, layout="constrained")
    axes = figure.subplots()
    visits = _by_visit(pairs)
    for number, (name, of_visit) in enumerate(visits.items()):
        means = [(pair.measured_mm + pair.caliper_mm) / 2 for pair in of_visit]
        differences = [pair.measured_mm - pair.caliper_mm for pair in of_visit]
        colour = _COLOURS[number % len(_COLOURS)]
        axes.plot(means, differences, "o", color=colour, markersize=4, alpha=0.8, label=drawn_name(name))
    found = agreement_of(pairs)
    lines = (("bias", found.bias_mm, "-"), ("lower limit", found.low_mm, "--"), ("upper limit", found.high_mm, "--"))
    for name, value, style in lines:
        if not math.isnan(value):
            axes.axhline(value, color=INK, linestyle=style, linewidth=1)
            at = axes.get_yaxis_transform()
            axes.text(1.0, value, f" {name} {value:+.1f}", transform=at, va="center", color=INK, fontsize="small")
    axes.axhline(0.0, color=FAINT, linewidth=1, zorder=0)
    axes.set(xlabel="mean of both, mm", ylabel="measured minus caliper, mm")
    axes.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"{found.n} diameters against calipers", x=0.02, ha="left", fontsize="x-large", fontweight="bold")
    if len(visits) <= len(_COLOURS):
        figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure
