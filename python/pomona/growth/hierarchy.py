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

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from pomona.growth.curve_families import CurveFamily
from pomona.growth.size_table import SizeTable
from pomona.growth.straying import straying

__all__ = ["Effects", "Hierarchy", "Shape"]

Numbers = NDArray[np.float64]

_FINEST_MM = 0.01
"""Nothing measures a fruit to less; sizes that agree to the last digit were copied, and say no more than that."""

_SIZE_AT_ONSET_MM, _SIZE_AT_ONSET_SPREAD = 30.0, 0.2
"""A fruit's usual diameter at the onset, give or take a fifth: of apples and their like, whatever the family."""


@dataclass(frozen=True)
class Shape:
    """What is not linear: the block's curve and the spreads.

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

    rate_per_day: float
    onset_day: float
    fruit_spread: float
    onset_spread_days: float
    tree_spread: float
    visit_spread: float
    noise_mm: float
    stray_per_day: float


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

    Parameters
    ----------
    table : SizeTable
    family : CurveFamily
    shape : Shape
    """

    def __init__(self, table: SizeTable, family: CurveFamily, shape: Shape) -> None:
        self.table, self.family, self.shape = table, family, shape
        self._starts = table.tree_starts
        self._curve = self.log_size(table.times)
        self._slopes = -shape.rate_per_day * family.slope(self._x(table.times))
        seen = table.seen
        weights = seen * (table.typical_mm / max(shape.noise_mm, _FINEST_MM)) ** 2
        self._weights = weights
        self._residuals = np.where(seen, table.logs - self._curve, 0.0)
        self._of_fruits()
        self._of_trees()
        self._of_visits()

    def log_size(self, times: Numbers) -> Numbers:
        """Return the block's curve against the middle of the visits, logarithms."""
        middle = np.array(self.table.times.mean())
        return np.asarray(self.family.log_size(self._x(times)) - self.family.log_size(self._x(middle)))

    def _x(self, times: Numbers) -> Numbers:
        return np.asarray(self.shape.rate_per_day * (times - self.shape.onset_day))

    def _of_fruits(self) -> None:
        """Precision (N, 2, 2) of each fruit's size and onset, and what its measurements say of them."""
        weights, slopes = self._weights, self._slopes
        spreads = self.shape.fruit_spread, self.shape.onset_spread_days
        self._p11 = spreads[0] ** -2 + weights.sum(axis=1)
        self._p12 = weights @ slopes
        self._p22 = spreads[1] ** -2 + weights @ slopes**2
        self._determinants = self._p11 * self._p22 - self._p12**2
        # With P = L L', rows of L^-1 X' W: two vectors over the visits for each fruit.
        first = weights / np.sqrt(self._p11)[:, None]
        left = np.sqrt(self._determinants / self._p11)[:, None]
        second = weights * (slopes - (self._p12 / self._p11)[:, None]) / left
        self._rows = np.stack([first, second], axis=1)

    def _of_trees(self) -> None:
        """Sum over the fruits of each tree: precision (T, S, S) and information (T, S) about its visits."""
        weights, residuals, rows = self._weights, self._residuals, self._rows
        told = np.einsum("nks,ns->nk", rows, residuals)
        information = weights * residuals - np.einsum("nks,nk->ns", rows, told)
        self._fit = float((weights * residuals**2).sum() - (told**2).sum())
        shared = rows.transpose(0, 2, 1) @ rows
        self._precision = -np.add.reduceat(shared, self._starts)
        diagonal = np.einsum("tss->ts", self._precision)
        diagonal += np.add.reduceat(weights, self._starts)
        self._information = np.add.reduceat(information, self._starts)
        self._to_tree = self._precision.sum(axis=2)
        self._tree_precision = self._to_tree.sum(axis=1) + self.shape.tree_spread**-2
        self._tree_information = self._information.sum(axis=1)

    def _of_visits(self) -> None:
        """Put the visits' errors and the mean together, (S + 1,), the trees integrated out."""
        shrunk = self._tree_information / self._tree_precision
        information = self._information.sum(axis=0) - shrunk @ self._to_tree
        precision = self._precision.sum(axis=0) - self._to_tree.T @ (self._to_tree / self._tree_precision[:, None])
        n = len(information)
        self._prior_mean = self._mean_from_onset()
        together = np.zeros((n + 1, n + 1))
        self._shared = self.shape.visit_spread**2 * np.eye(n) + self.shape.stray_per_day**2 * self.table.straying
        together[:n, :n] = precision + np.linalg.inv(self._shared)
        together[:n, n] = together[n, :n] = precision.sum(axis=0)
        together[n, n] = precision.sum() + _SIZE_AT_ONSET_SPREAD**-2
        said = np.append(information, information.sum() + self._prior_mean * _SIZE_AT_ONSET_SPREAD**-2)
        self._factor = cho_factor(together, lower=True)
        self._said = said
        self._expected = cho_solve(self._factor, said)

    def _mean_from_onset(self) -> float:
        onset = self.log_size(np.array(self.shape.onset_day))
        return float(np.log(_SIZE_AT_ONSET_MM) - onset)

    def log_likelihood(self) -> float:
        """Logarithm of the density of all measurements, everything linear integrated out."""
        shape, n_fruits = self.shape, len(self._p11)
        of_noise = -np.log(self._weights[self._weights > 0] / (2.0 * np.pi)).sum() + self._fit
        of_fruits = np.log(self._determinants).sum()
        of_fruits += 2.0 * n_fruits * np.log(shape.fruit_spread * shape.onset_spread_days)
        of_trees = np.log(self._tree_precision * shape.tree_spread**2).sum()
        of_trees -= (self._tree_information**2 / self._tree_precision).sum()
        of_visits = 2.0 * np.log(np.diag(self._factor[0])).sum() - float(self._said @ self._expected)
        of_visits += float(np.linalg.slogdet(self._shared)[1]) + 2.0 * np.log(_SIZE_AT_ONSET_SPREAD)
        of_visits += (self._prior_mean / _SIZE_AT_ONSET_SPREAD) ** 2
        return float(-0.5 * (of_noise + of_fruits + of_trees + of_visits))

    def expected(self) -> Effects:
        """Return the expectations of all effects."""
        return self._effects(self._expected, None)

    def draw(self, rng: np.random.Generator) -> Effects:
        """Draw all effects together, given the measurements."""
        noise = solve_triangular(self._factor[0], rng.normal(size=len(self._expected)), lower=True, trans=1)
        return self._effects(self._expected + noise, rng)

    def draw_stray(self, effects: Effects, times: Numbers, rng: np.random.Generator) -> Numbers:
        """Draw how far growth has strayed by each time, (Q,), given what the visits share; the rest is their error.

        Parameters
        ----------
        effects : Effects
        times : (Q,) float64
            The visits', and later ones.
        rng : Generator
        """
        n = len(self.table.times)
        covariance = self.shape.stray_per_day**2 * straying(times)
        # Matheron's rule: a draw from the prior, moved by what it misses of the visits.
        values, axes = np.linalg.eigh(covariance)
        stray = axes @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=len(times)))
        missed = effects.visits - stray[:n] - self.shape.visit_spread * rng.normal(size=n)
        return np.asarray(stray + covariance[:, :n] @ np.linalg.solve(self._shared, missed))

    def _effects(self, together: Numbers, rng: np.random.Generator | None) -> Effects:
        """Go back from the visits to the trees and the fruits; without chance, to their expectations."""
        n_trees, n_fruits = len(self._starts), len(self._p11)
        z = np.zeros((n_trees + 2 * n_fruits,)) if rng is None else rng.normal(size=n_trees + 2 * n_fruits)
        of_trees, first, second = np.split(z, [n_trees, n_trees + n_fruits])
        visits, mean = together[:-1], float(together[-1])
        trees = self._tree_information - self._to_tree @ (visits + mean)
        trees = trees / self._tree_precision + of_trees / np.sqrt(self._tree_precision)
        left = self._weights * (self._residuals - visits - mean - trees[self.table.trees][:, None])
        left[self._weights == 0.0] = 0.0
        b1, b2 = left.sum(axis=1), left @ self._slopes
        onsets = (self._p11 * b2 - self._p12 * b1) / self._determinants + second * np.sqrt(
            self._p11 / self._determinants
        )
        sizes = (b1 - self._p12 * onsets) / self._p11 + first / np.sqrt(self._p11)
        return Effects(mean, visits, trees, sizes, onsets)

    def surprise(self) -> Numbers:
        """Residual of each measurement in its standard deviations, had it not been used for its fruit; (N, S)."""
        effects = self.expected()
        fitted = effects.mean + effects.visits + (effects.trees[self.table.trees] + effects.sizes)[:, None]
        residuals = self._residuals - fitted - effects.onsets_days[:, None] * self._slopes
        leverage = np.einsum("nks,nks->ns", self._rows, self._rows) / np.maximum(self._weights, 1e-300)
        scaled = residuals * np.sqrt(self._weights) / np.sqrt(np.maximum(1.0 - leverage, 1e-9))
        return np.where(self._weights > 0, scaled, np.nan)
