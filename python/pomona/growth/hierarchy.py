r"""The linear middle of the growth model: sizes of fruits, trees and visits, given the curve and the spreads.

Of fruit $i$ on tree $t$ at visit $s$, time $\tau_s$, the logarithm of the diameter is

$$ y_{is} = \mu + m_s + b_t + a_i + o_i g_s + c_s + e_{is}, \qquad m_s = h(x_s) - h(x_\mathrm{mid}), \quad
   g_s = -k h'(x_s), \quad x_s = k (\tau_s - t_0) $$

with $a_i$ its own size and $o_i$ its own onset, in which the curve is linear to 0.1 mm; $c_s$ is what all sizes of a
visit share: the error of its scale, and how far the block's growth has strayed from the curve by then. All of them are
Gaussian given `Shape`, so they are integrated out exactly: first each fruit's two numbers, then each tree's one, then
the visits' and the mean together. docs/growth.md has the derivation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from pomona.growth.chance import Chance
from pomona.growth.curve_families import CurveFamily
from pomona.growth.own_numbers import OwnNumbers
from pomona.growth.size_table import SizeTable
from pomona.growth.straying import straying, straying_root

__all__ = ["Effects", "Hierarchy", "Shape"]

Numbers = NDArray[np.float64]
Number = TypeVar("Number", float, Numbers)

_FINEST_MM = 0.01
"""Nothing measures a fruit to less; sizes that agree to the last digit were copied, and say no more than that."""

_SIZE_AT_ONSET_MM, _SIZE_AT_ONSET_SPREAD = 30.0, 0.2
"""A fruit's usual diameter at the onset, give or take a fifth: of apples and their like, whatever the family."""


@dataclass(frozen=True)
class Shape(Generic[Number]):
    """What is not linear: the block's curve and the spreads; numbers, or arrays, (K,), of several at once.

    Attributes
    ----------
    rate_per_day, onset_day : float
        k and t0.
    fruit_spread, onset_spread_days, tree_spread, visit_spread : float
        Standard deviations of a, o, b and of the error that a visit's sizes share.
    noise_mm : float
        Standard deviation of a single diameter.
    stray_per_day : float
        Standard deviation of the block's relative growth a day against the curve's.
    """

    rate_per_day: Number
    onset_day: Number
    fruit_spread: Number
    onset_spread_days: Number
    tree_spread: Number
    visit_spread: Number
    noise_mm: Number
    stray_per_day: Number


@dataclass(frozen=True, eq=False)
class Effects:
    """One draw of all that is linear.

    Attributes
    ----------
    mean : float
        Logarithm of the block's diameter in mm at the middle of the visits.
    visits : (S,)
        c, what sizes of a visit share: its error and how far growth has strayed from the curve.
    trees : (T,)
        b.
    sizes, onsets_days : (N,)
        a and o.
    """

    mean: float
    visits: Numbers
    trees: Numbers
    sizes: Numbers
    onsets_days: Numbers


class Hierarchy:
    """The model of a table, given a family and a shape.

    Of several shapes at once the likelihoods are told, and nothing is drawn.

    Parameters
    ----------
    table : SizeTable
    family : CurveFamily
    shape : Shape
    """

    def __init__(self, table: SizeTable, family: CurveFamily, shape: Shape[float] | Shape[Numbers]) -> None:
        self.table, self.family, self.shape = table, family, shape
        self._starts = table.tree_starts
        self.curve = self.log_size(table.times)
        self.slopes = -_column(shape.rate_per_day) * family.slope(self._x(table.times))
        self._residuals = np.where(table.seen, table.logs - self.curve[..., None, :], 0.0)
        noise_mm = np.maximum(_column(shape.noise_mm), _FINEST_MM)
        self.whole = table.seen * ((table.typical_mm / noise_mm) ** 2)[..., None, :]
        spreads = _column(shape.fruit_spread), _column(shape.onset_spread_days)
        self._own = OwnNumbers.of(table.trust * self.whole, self.slopes, spreads)
        self._of_trees()
        self._of_visits()

    def log_size(self, times: Numbers) -> Numbers:
        """Return the block's curve against the middle of the visits, logarithms."""
        middle = self.table.times.mean(keepdims=True)
        return np.asarray(self.family.log_size(self._x(times)) - self.family.log_size(self._x(middle)))

    def _x(self, times: Numbers) -> Numbers:
        return np.asarray(_column(self.shape.rate_per_day) * (times - _column(self.shape.onset_day)))

    def _of_trees(self) -> None:
        """Sum over the fruits of each tree: precision (..., T, S, S) and information (..., T, S) about its visits."""
        own = self._own
        information, fits = own.said_by(self._residuals)
        self._fit = fits.sum(axis=-1)
        shared = own.rows.swapaxes(-1, -2) @ own.rows
        self._precision = -np.add.reduceat(shared, self._starts, axis=-3)
        diagonal = np.einsum("...ss->...s", self._precision)
        diagonal += np.add.reduceat(own.weights, self._starts, axis=-2)
        self._information = np.add.reduceat(information, self._starts, axis=-2)
        self._to_tree = self._precision.sum(axis=-1)
        self._tree_precision = self._to_tree.sum(axis=-1) + _column(self.shape.tree_spread) ** -2
        self._tree_information = self._information.sum(axis=-1)

    def _of_visits(self) -> None:
        """Put the visits' errors and the mean together, (..., S + 1), the trees integrated out."""
        shape, table = self.shape, self.table
        shrunk = self._to_tree / self._tree_precision[..., None]
        information = self._information.sum(axis=-2) - (self._tree_information[..., None] * shrunk).sum(axis=-2)
        precision = self._precision.sum(axis=-3) - self._to_tree.swapaxes(-1, -2) @ shrunk
        n = len(table.times)
        self._prior_mean = self._mean_from_onset()
        scales = (_column(shape.visit_spread) ** 2 + table.doubt)[..., None] * np.eye(n)
        self._shared = scales + _column(shape.stray_per_day)[..., None] ** 2 * table.straying
        together = np.zeros((*information.shape[:-1], n + 1, n + 1))
        together[..., :n, :n] = precision + np.linalg.inv(self._shared)
        together[..., :n, n] = together[..., n, :n] = precision.sum(axis=-2)
        together[..., n, n] = precision.sum(axis=(-1, -2)) + _SIZE_AT_ONSET_SPREAD**-2
        of_mean = information.sum(axis=-1) + self._prior_mean * _SIZE_AT_ONSET_SPREAD**-2
        self._said = np.concatenate([information, of_mean[..., None]], axis=-1)
        self._root = np.linalg.cholesky(together)
        halfway = np.linalg.solve(self._root, self._said[..., None])
        self._expected = np.asarray(np.linalg.solve(self._root.swapaxes(-1, -2), halfway)[..., 0], np.float64)

    def _mean_from_onset(self) -> Numbers:
        onset = self.log_size(_column(self.shape.onset_day))[..., 0]
        return np.asarray(np.log(_SIZE_AT_ONSET_MM) - onset)

    def log_likelihood(self) -> Numbers:
        """Logarithm of the density of all measurements, everything linear integrated out.

        A density that is trusted by a share counts to the power of it, so what is not trusted says nothing.
        """
        shape, table, n_fruits = self.shape, self.table, len(self.table.logs)
        # What was not measured has a precision of 0: of none there is nothing to take the logarithm of.
        of_each = np.log(np.where(table.seen, self.whole, 1.0)) - np.log(2.0 * np.pi)
        of_noise = -(table.trust * table.seen * of_each).sum(axis=(-1, -2)) + self._fit
        of_fruits = np.log(self._own.determinants).sum(axis=-1)
        of_fruits += 2.0 * n_fruits * np.log(shape.fruit_spread * shape.onset_spread_days)
        of_trees = np.log(self._tree_precision * _column(shape.tree_spread) ** 2).sum(axis=-1)
        of_trees -= (self._tree_information**2 / self._tree_precision).sum(axis=-1)
        of_visits = 2.0 * np.log(np.einsum("...ss->...s", self._root)).sum(axis=-1)
        of_visits -= (self._said * self._expected).sum(axis=-1)
        of_visits += np.linalg.slogdet(self._shared)[1] + 2.0 * np.log(_SIZE_AT_ONSET_SPREAD)
        of_visits += (self._prior_mean / _SIZE_AT_ONSET_SPREAD) ** 2
        return np.asarray(-0.5 * (of_noise + of_fruits + of_trees + of_visits))

    def log_prior(self, effects: Effects) -> float:
        """Logarithm of the density of what fruits share, before any measurement: the mean, the visits, the trees."""
        spread = self.shape.tree_spread
        of_visits = effects.visits @ np.linalg.solve(self._shared, effects.visits)
        of_visits += float(np.linalg.slogdet(2.0 * np.pi * self._shared)[1])
        of_trees = ((effects.trees / spread) ** 2 + 2.0 * np.log(spread) + np.log(2.0 * np.pi)).sum()
        of_mean = ((effects.mean - self._prior_mean) / _SIZE_AT_ONSET_SPREAD) ** 2
        return float(-0.5 * (of_visits + of_trees + of_mean))

    def log_scales(self) -> Numbers:
        """Logarithms of what scales the density of each fruit's sizes: their noise and the spreads of its own, (N,)."""
        of_noise = np.log(self.whole, where=self.table.seen, out=np.zeros(self.whole.shape))
        return np.asarray(0.5 * of_noise.sum(axis=1) - np.log(self.shape.fruit_spread * self.shape.onset_spread_days))

    def expected(self) -> Effects:
        """Return the expectations of all effects."""
        return self._effects(self._expected, None)

    def draw(self, chance: Chance) -> Effects:
        """Draw all effects together, given the measurements."""
        noise = solve_triangular(self._root, chance.shared("visits"), lower=True, trans=1)
        return self._effects(self._expected + noise, chance)

    def draw_stray(self, effects: Effects, times: Numbers, chance: Chance) -> Numbers:
        """Draw how far growth has strayed by each time, (Q,), given what the visits share; the rest is their error.

        Parameters
        ----------
        effects : Effects
        times : (Q,) float64
            The visits', the day after the last of them, and others, of which no draw of the former depends.
        chance : Chance
        """
        n = len(self.table.times)
        covariance = self.shape.stray_per_day**2 * straying(times)
        noise = np.append(chance.shared("straying"), chance.single("later", len(times) - n - 1))
        # Matheron's rule: a draw from the prior, moved by what it misses of the visits.
        stray = self.shape.stray_per_day * (straying_root(times) @ noise)
        missed = effects.visits - stray[:n] - self.shape.visit_spread * chance.shared("errors")
        return np.asarray(stray + covariance[:, :n] @ np.linalg.solve(self._shared, missed))

    def _effects(self, together: Numbers, chance: Chance | None) -> Effects:
        """Go back from the visits to the trees and the fruits; without chance, to their expectations."""
        own, table = self._own, self.table
        visits, mean = together[:-1], float(together[-1])
        trees = (self._tree_information - self._to_tree @ (visits + mean)) / self._tree_precision
        if chance is not None:
            trees = trees + chance.single("trees", len(trees)) / np.sqrt(self._tree_precision)
        left = own.weights * (self._residuals - visits - mean - trees[table.trees][:, None])
        b1, b2 = left.sum(axis=1), left @ self.slopes
        first, second = self._of_fruits(chance)
        onsets = (own.p11 * b2 - own.p12 * b1) / own.determinants + second * np.sqrt(own.p11 / own.determinants)
        sizes = (b1 - own.p12 * onsets) / own.p11 + first / np.sqrt(own.p11)
        return Effects(mean, visits, trees, sizes, onsets)

    def _of_fruits(self, chance: Chance | None) -> Numbers:
        """Two standard normal numbers for each fruit, (2, N), or none of chance."""
        if chance is None:
            return np.zeros((2, len(self.table.logs)))
        return chance.single("fruits", 2 * len(self.table.logs)).reshape(2, -1)[:, self.table.ranks]

    def against(self, effects: Effects) -> Numbers:
        """Return how far each size is from the curve and from what its fruit shares with others, (N, S); 0 for none."""
        around = effects.mean + effects.visits + effects.trees[self.table.trees][:, None]
        return np.where(self.table.seen, self._residuals - around, 0.0)

    def expected_stray(self, effects: Effects) -> Numbers:
        """Return how far growth is expected to have strayed by each visit, (S,), given what the visits share."""
        return np.asarray(
            self.shape.stray_per_day**2 * self.table.straying @ np.linalg.solve(self._shared, effects.visits)
        )


def _column(number: float | Numbers) -> Numbers:
    """Give a number, or each of several, an axis of its own."""
    return np.asarray(number, np.float64)[..., None]
