r"""Three shapes of growth, each one function of one number: $\ln d = \mu + h(k (t - t_0))$.

A family is its $h$ and the slope $h'$; the rate $k$ and the onset $t_0$ are the block's, the size is each fruit's own.
Expolinear is Goudriaan and Monteith (1990) in mass, so a cube root in diameter; logistic and Gompertz are of diameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, log_expit

__all__ = ["FAMILIES", "CurveFamily", "FamilyName"]

FamilyName = Literal["expolinear", "logistic", "gompertz"]

Numbers = NDArray[np.float64]

_MOST_EXPONENT = 50.0
"""Keeps a Gompertz curve of long before its onset finite: a fruit of no size."""


@dataclass(frozen=True)
class CurveFamily:
    """A shape of growth.

    Attributes
    ----------
    name : str
    log_size, slope : callable
        h and h' of k (t - t0), arrays of any shape.
    usual_rate_per_day : float
        Rate k of apples, where the prior has its middle.
    """

    name: FamilyName
    log_size: Callable[[Numbers], Numbers]
    slope: Callable[[Numbers], Numbers]
    usual_rate_per_day: float


def _expolinear(x: Numbers) -> Numbers:
    return np.asarray(np.log(_softplus(x)) / 3.0)


def _expolinear_slope(x: Numbers) -> Numbers:
    return np.asarray(expit(x) / (3.0 * _softplus(x)))


def _softplus(x: Numbers) -> Numbers:
    return np.asarray(np.logaddexp(0.0, np.maximum(x, -_MOST_EXPONENT)))


def _logistic(x: Numbers) -> Numbers:
    return np.asarray(log_expit(x))


def _logistic_slope(x: Numbers) -> Numbers:
    return np.asarray(expit(-x))


def _gompertz(x: Numbers) -> Numbers:
    return -_gompertz_slope(x)


def _gompertz_slope(x: Numbers) -> Numbers:
    return np.asarray(np.exp(np.minimum(-x, _MOST_EXPONENT)))


FAMILIES: dict[FamilyName, CurveFamily] = {
    "expolinear": CurveFamily("expolinear", _expolinear, _expolinear_slope, 0.09),
    "logistic": CurveFamily("logistic", _logistic, _logistic_slope, 0.025),
    "gompertz": CurveFamily("gompertz", _gompertz, _gompertz_slope, 0.018),
}
"""The rates are those of apples: Lakso and others (1995); fits of the diameters of twelve Fuji over a season."""
