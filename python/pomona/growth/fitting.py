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

_MOST_AT_ONCE = 1 << 16
"""Sizes, of all shapes: what is worked on stays in the caches of a processor."""

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

    def shape(self, z: Numbers) -> Shape[float]:
        return Shape(*(float(number) for number in self._columns(z)))

    def _columns(self, z: Numbers) -> list[Numbers]:
        """Give the numbers of a shape, or of each of several, as they stand there."""
        onset = self.table.times[0] + _ONSET_DAYS[0] + _ONSET_DAYS[1] * z[..., 0]
        numbers = np.exp(self.middle + self.spread * z[..., 1:])
        rate, *spreads = (numbers[..., column] for column in range(numbers.shape[-1]))
        return [rate, onset, *spreads]

    def numbers(self, z: Numbers) -> Numbers:
        """Give the onset in standard deviations, and the logarithms of the others, (8,)."""
        return np.concatenate([z[:1], self.middle + self.spread * z[1:]])

    def of_numbers(self, numbers: Numbers) -> Numbers:
        """Give a shape by what another prior calls its `numbers`."""
        return np.concatenate([numbers[:1], (numbers[1:] - self.middle) / self.spread])

    def __call__(self, z: Numbers) -> Numbers:
        """Tell it of (8,) numbers, or of (K, 8): many at once take a fraction of the time of one after the other."""
        if z.ndim > 1:
            at_once = max(_MOST_AT_ONCE // self.table.logs.size, 1)
            if len(z) > at_once:
                return np.concatenate([self(z[start : start + at_once]) for start in range(0, len(z), at_once)])
        try:
            likelihood = Hierarchy(self.table, self.family, Shape(*self._columns(z))).log_likelihood()
        except np.linalg.LinAlgError:  # so far out that rounding eats what the measurements say
            if z.ndim > 1:
                return np.array([self(one) for one in z])
            likelihood = np.array(_IMPOSSIBLE)
        return np.asarray(likelihood - 0.5 * (z**2).sum(axis=-1) - 0.5 * z.shape[-1] * np.log(2.0 * np.pi))

    def cost_and_slope(self, z: Numbers) -> tuple[float, Numbers]:
        """By central differences: one-sided ones of 1e-8 drown in rounding, and the climb ends on the way."""
        steps = _FINE_STEP * np.eye(len(z))
        here, above, below = np.split(-self(np.concatenate([z[None], z + steps, z - steps])), [1, 1 + len(z)])
        return float(here[0]), (above - below) / (2.0 * _FINE_STEP)


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
    likeliest: Shape[float]
    log_evidence: float
    _posterior: _Posterior
    _mode: Numbers
    _root: Numbers

    def weighed(self, first: Numbers, even: Numbers) -> tuple[tuple[Shape[float], ...], Numbers]:
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
        gain = float(posterior(mode) - self._posterior(self._mode))
        return Hierarchy(posterior.table, self.family, posterior.shape(mode)), gain

    def _round(self, even: Numbers, middle: Numbers, root: Numbers) -> tuple[Numbers, Numbers]:
        drawn = student_points(even, middle, root)
        log_weights = self._posterior(drawn) - student_density(drawn, middle, root)
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
    return FittedShape(family, posterior.shape(mode), float(posterior(mode) + volume), posterior, mode, root)


def likeliest_shape(
    table: SizeTable, family: CurveFamily, start: Numbers | None = None
) -> tuple[Shape[float], Numbers]:
    """Find the mode alone, where visits agree; also as the start of a next search, (8,)."""
    posterior = _Posterior(table.some_fruits(_MOST_FRUITS), family, _AGREEING)
    mode = _climbed(posterior, start)
    return posterior.shape(mode), mode


def _climbed(posterior: _Posterior, start: Numbers | None) -> Numbers:
    """Climb to the mode, from the middle of the prior or from a start."""
    start = np.zeros(N_NUMBERS) if start is None else start
    found = minimize(posterior.cost_and_slope, start, method="BFGS", jac=True, tol=_GRADIENT)
    return np.asarray(found.x)


def _curvature(posterior: _Posterior, mode: Numbers) -> Numbers:
    """Minus the second derivatives at the mode, by differences."""
    steps, pairs = _STEP * np.eye(len(mode)), np.array(list(combinations(range(len(mode)), 2)))
    both_ways = np.concatenate([steps, steps[pairs].sum(axis=1)])
    tried = np.concatenate([mode[None], mode + both_ways, mode - both_ways])
    middle, above, below = np.split(posterior(tried), [1, 1 + len(both_ways)])
    bent = 2.0 * middle - above - below
    of_each, of_pairs = bent[: len(mode)], bent[len(mode) :]
    curvature = np.diag(of_each)
    rows, columns = pairs.T
    curvature[rows, columns] = curvature[columns, rows] = 0.5 * (of_pairs - of_each[rows] - of_each[columns])
    return np.asarray(curvature / _STEP**2)
