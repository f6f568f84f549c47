r"""Which visit's sizes are off together, by more than the scales of visits are.

Every visit has an error of its scale, some 2 %. One in twenty is thought to be off by more, its logarithm by a Gaussian
of standard deviation $B$: another camera, a wrong unit, a ball of another size. Of all visits none is off, or one: the
posterior at its mode with $B^2$ for one of them, against that without, gives the odds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from pomona.growth.fitting import FittedShape
from pomona.growth.hierarchy import Hierarchy

__all__ = ["OddVisit", "odd_visits"]

_OFF = 0.05
"""Share of visits whose scale is off by more, before any is known."""

_OFF_BY = 0.2
"""B: it takes some 10 % to be told from scales that are off by 2 % as usual."""

_REASON = 0.02
"""Logarithm of a scale at which the season's own fit gives a reason to ask."""

_LEAST = 0.2
"""Probability of a visit that is named: of several that are as likely, all are."""


@dataclass(frozen=True)
class OddVisit:
    """A visit of which the scale is likely off.

    Attributes
    ----------
    visit : int
        Its place among the visits.
    probability : float
    scale : float
        Factor of its sizes against those that the other visits foretell.
    """

    visit: int
    probability: float
    scale: float


def odd_visits(fitted: FittedShape, n_visits: int) -> Sequence[OddVisit]:
    """Tell the visits that are likely off, if it is likelier that one is than that none is.

    Parameters
    ----------
    fitted : FittedShape
        Of the curve that is believed most.
    n_visits : int
    """
    if np.abs(fitted.shared_by_visits()).max() < _REASON:
        return ()
    doubted = [fitted.doubting(visit, _OFF_BY**2) for visit in range(n_visits)]
    log_odds = np.array([gain for _, gain in doubted]) + np.log(_OFF / (1.0 - _OFF))
    # That none is off has the logarithm 0.
    chances = np.exp(log_odds - logsumexp(np.append(log_odds, 0.0)))
    if chances.sum() < 0.5:
        return ()
    named = [visit for visit, chance in enumerate(chances.tolist()) if chance >= _LEAST]
    return tuple(OddVisit(visit, float(chances[visit]), _scale(doubted[visit][0], visit)) for visit in named)


def _scale(model: Hierarchy, visit: int) -> float:
    """Return the factor of a visit against the mean of the others."""
    shared = model.expected().visits
    return float(np.exp(shared[visit] - np.delete(shared, visit).mean()))
