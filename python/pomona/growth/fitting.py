r"""The nonlinear rest of the growth model: a prior, the mode, and draws weighted by the exact likelihood.

The numbers of `Shape` are drawn around the mode of their posterior, from a multivariate t with the curvature
there, and weighted by the ratio of the posterior to that density: importance sampling, so that neither the bend of the
curve nor the skew of the spreads is lost, which a linearised fit loses.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from pomona.growth.curve_families import CurveFamily
from pomona.growth.hierarchy import Hierarchy, Shape
from pomona.growth.size_table import SizeTable
from pomona.growth.student_points import student_density, student_points

__all__ = ["N_NUMBERS", "FittedShape", "fit_shape", "likeliest_shape"]

Numbers = NDArray[np.float64]

_MOST_FRUITS = 1000
"""That a shape is fitted to; eight numbers need no more."""

_GRADIENT = 0.05
"""At which the climb ends: the draws are weighted, so their middle need not be the mode to the last digit."""

_STEP, _FINE_STEP = 0.05, 1e-3
"""Of the differences that tell the curvature and the slope, in standard deviations of the prior."""

_IMPOSSIBLE = -1e9
"""Logarithm of a likelihood below any that is met."""

# Medians and standard deviations: of the logarithms, but of the onset, in days against the first visit.
_ONSET_DAYS = (-10.0, 30.0)
"""A season may be begun at any time of the months in which fruits are measured."""
_RATE_SPREAD = 0.30
"""Curves of one crop bend by as different rates: few visits show the bend by halves, and the prior tells the rest."""
_SPREADS = (
    (0.07, 0.5),  # of a fruit's size
    (3.0, 0.5),  # of its onset, days
    (0.02, 0.7),  # of a tree's size
    (0.02, 0.5),  # of a visit's scale
    (2.0, 0.6),  # of a diameter, mm
    (7e-4, 1.0),  # of the block's relative growth a day, against the curve
)
"""Straying was chosen on drawn blocks; twelve Fuji by calipers do not tell it: 0.01 to 0.07 % a day by the prior. With
less, a late expolinear curve is a cube root, and its rate is believed to be surer than three visits can tell it."""

_AGREEING = (*_SPREADS[:3], (_SPREADS[3][0], 0.2), _SPREADS[4], (1e-4, 0.5))
"""The same where visits agree and growth keeps to its curve: by these who has stopped is told. With visits that measure
three times what there is, or growth that strays as it may, one curve suits a row of two sorts of which one has
stopped."""

N_NUMBERS = len(_SPREADS) + 2
"""Of a shape."""


class _Posterior:
    """The logarithm of the posterior over the shape, in standard deviations of the prior."""

    def __init__(
        self, table: SizeTable, family: CurveFamily, spreads: tuple[tuple[float, float], ...] = _SPREADS
    ) -> None:
        self.table, self.family = table, family
        medians = (family.usual_rate_per_day, *(median for median, _ in spreads))
        self.middle = np.log(medians)
        self.spread = np.array([_RATE_SPREAD, *(spread for _, spread in spreads)])

    def shape(self, z: Numbers) -> Shape:
        onset = float(self.table.times[0] + _ONSET_DAYS[0] + _ONSET_DAYS[1] * z[0])
        rate, *spreads = np.exp(self.middle + self.spread * z[1:]).tolist()
        return Shape(rate, onset, *spreads)

    def numbers(self, z: Numbers) -> Numbers:
        """Give the onset in standard deviations, and the logarithms of the others, (8,)."""
        return np.concatenate([z[:1], self.middle + self.spread * z[1:]])

    def of_numbers(self, numbers: Numbers) -> Numbers:
        """Give a shape by what another prior calls its `numbers`."""
        return np.concatenate([numbers[:1], (numbers[1:] - self.middle) / self.spread])

    def __call__(self, z: Numbers) -> float:
        try:
            likelihood = Hierarchy(self.table, self.family, self.shape(z)).log_likelihood()
        except np.linalg.LinAlgError:  # so far out that rounding eats what the measurements say
            likelihood = _IMPOSSIBLE
        return likelihood - 0.5 * float(z @ z) - 0.5 * len(z) * float(np.log(2.0 * np.pi))

    def cost(self, z: Numbers) -> float:
        return -self(z)

    def slope_of_cost(self, z: Numbers) -> Numbers:
        """By central differences: one-sided ones of 1e-8 drown in rounding, and the climb ends on the way."""
        steps = _FINE_STEP * np.eye(len(z))
        return np.array([self.cost(z + step) - self.cost(z - step) for step in steps]) / (2.0 * _FINE_STEP)


@dataclass(frozen=True, eq=False)
class FittedShape:
    """What the measurements say of the shape.

    Attributes
    ----------
    family : CurveFamily
    likeliest : Shape
        At the mode.
    log_evidence : float
        Logarithm of the density of the measurements, the shape integrated out by the curvature at the mode (Laplace).
    """

    family: CurveFamily
    likeliest: Shape
    log_evidence: float
    _posterior: _Posterior
    _mode: Numbers
    _root: Numbers

    def weighed(self, first: Numbers, even: Numbers) -> tuple[tuple[Shape, ...], Numbers]:
        """Spread shapes over the posterior, and weigh them by the exact one and not by its curvature.

        They are spread as wide as a first round of others finds the posterior (adaptive importance sampling, Oh and
        Berger 1992): at the mode the scales of visits are all but right, and the curve seems surer than it is.

        Parameters
        ----------
        first, even : (D, 9) float64
            Points in the unit cube: for the eight numbers, and for how far into the tails.

        Returns
        -------
        tuple of D Shape, and (D,) float64
            The sum of the weights is 1.
        """
        tried, weights = self._round(first, self._mode, self._root)
        middle = weights @ tried
        away = tried - middle
        root = np.asarray(np.linalg.cholesky(away.T @ (weights[:, None] * away)), np.float64)
        drawn, weights = self._round(even, middle, root)
        return tuple(self._posterior.shape(z) for z in drawn), weights

    def shared_by_visits(self) -> Numbers:
        """Return what the sizes of each visit share at the mode, logarithms, (S,)."""
        return Hierarchy(self._posterior.table, self.family, self.likeliest).expected().visits

    def doubting(self, visit: int, variance: float) -> tuple[Hierarchy, float]:
        """Fit the shape anew where the scale of one visit has a variance of its own.

        Returns
        -------
        Hierarchy
            At the mode.
        float
            By how much the logarithm of the posterior is higher there than without the doubt.
        """
        posterior = _Posterior(self._posterior.table.doubting(visit, variance), self.family)
        mode = _climbed(posterior, self._mode)
        gain = posterior(mode) - self._posterior(self._mode)
        return Hierarchy(posterior.table, self.family, posterior.shape(mode)), gain

    def _round(self, even: Numbers, middle: Numbers, root: Numbers) -> tuple[Numbers, Numbers]:
        drawn = student_points(even, middle, root)
        log_weights = np.array([self._posterior(z) for z in drawn]) - student_density(drawn, middle, root)
        weights = np.exp(log_weights - log_weights.max())
        # One shape in a corner that few reach must not speak for all (truncated importance sampling, Ionides 2008).
        weights = np.minimum(weights, np.sqrt(len(weights)) * weights.mean())
        return drawn, weights / weights.sum()


def fit_shape(table: SizeTable, family: CurveFamily) -> FittedShape:
    """Fit the shape of one family to a table of at least two visits at different times."""
    posterior = _Posterior(table.some_fruits(_MOST_FRUITS), family)
    # To growth that strays as it may two parts of a row whose sizes differ are visits that err by a fifth as well: so
    # it is begun where visits agree, rounded, so that their order does not tell by what it leaves in the last digits.
    agreeing = _Posterior(posterior.table, family, _AGREEING)
    start = posterior.of_numbers(agreeing.numbers(_climbed(agreeing, None)))
    mode = _climbed(posterior, np.round(start, 1))
    values, axes = np.linalg.eigh(_curvature(posterior, mode))
    # Where the differences see no bend, the prior's own is there. The triangle is one of a kind; axes have any sign.
    root = np.linalg.cholesky((axes / np.maximum(values, 1.0)) @ axes.T)
    volume = 0.5 * len(mode) * np.log(2.0 * np.pi) + np.linalg.slogdet(root)[1]
    return FittedShape(family, posterior.shape(mode), posterior(mode) + float(volume), posterior, mode, root)


def likeliest_shape(table: SizeTable, family: CurveFamily, start: Numbers | None = None) -> tuple[Shape, Numbers]:
    """Find the mode alone, where visits agree; also as the start of a next search, (8,)."""
    posterior = _Posterior(table.some_fruits(_MOST_FRUITS), family, _AGREEING)
    mode = _climbed(posterior, start)
    return posterior.shape(mode), mode


def _climbed(posterior: _Posterior, start: Numbers | None) -> Numbers:
    """Climb to the mode, from the middle of the prior or from a start."""
    start = np.zeros(N_NUMBERS) if start is None else start
    found = minimize(posterior.cost, start, method="BFGS", jac=posterior.slope_of_cost, tol=_GRADIENT)
    return np.asarray(found.x)


def _curvature(posterior: _Posterior, mode: Numbers) -> Numbers:
    """Minus the second derivatives at the mode, by differences."""
    steps = _STEP * np.eye(len(mode))
    middle = posterior(mode)
    ends = [(posterior(mode + step), posterior(mode - step)) for step in steps]
    curvature = np.diag([2.0 * middle - above - below for above, below in ends])
    for i, j in combinations(range(len(mode)), 2):
        both = posterior(mode + steps[i] + steps[j]) + posterior(mode - steps[i] - steps[j])
        curvature[i, j] = curvature[j, i] = 0.5 * (sum(ends[i]) + sum(ends[j]) - 2.0 * middle - both)
    return np.asarray(curvature / _STEP**2)
