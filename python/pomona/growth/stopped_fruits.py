r"""Fruits that have stopped growing and hang on: about which sizes they are measured, and what their own say of it.

A fruit stopped after $z$ of the $S$ visits, $z = S$ if it still grows. Until then it is on the row's curve. From then
on its sizes are that of the visit before, what it still grew, and what it grows on: anything from none to all of the
row's growth $G_z$ up to the next visit, by its moments $G_z (1/2 + u / \sqrt{12})$ with $u$ of variance 1, and of the
row's later growth a share $w$ about none, as thirsty fruits grow a little and then shrink. What stopped before the
first visit has the size that the curve has there, but for its own. So a fruit has four numbers, its size $a$, its
onset $o$, $u$ and $w$, Gaussian given $z$, and its sizes have a density in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.growth.hierarchy import Effects, Hierarchy

__all__ = ["FourNumbers", "fates", "four_numbers", "kept_growth", "stopped_growth"]

Numbers = NDArray[np.float64]

_UNIFORM = 12.0**-0.5
"""Standard deviation of what is anywhere from 0 to 1."""

_KEPT = 0.15
"""Standard deviation of w, the share of the row's growth that a fruit keeps once it has stopped. With none, half a row
that grew on at .15 of its pace was taken for growing, and the curve suited neither half."""


@dataclass(frozen=True, eq=False)
class FourNumbers:
    """Size, onset, u and w of M fruits, given their sizes and after how many visits each stopped.

    Attributes
    ----------
    middles : (M, 4)
    roots : (M, 4, 4)
        Lower triangles L with the precision L L'.
    log_densities : (M,)
        Of the sizes, but for what does not depend on when the fruit stopped.
    said, precisions : (M, S)
        How far each size is off, times the precision with which the fruit's others foretell it; and that precision.
    """

    middles: Numbers
    roots: Numbers
    log_densities: Numbers
    said: Numbers
    precisions: Numbers

    def drawn(self, noise: Numbers) -> Numbers:
        """Move the middles by (M, 4) standard normal numbers, (M, 4)."""
        return np.asarray(self.middles + np.linalg.solve(self.roots.transpose(0, 2, 1), noise[:, :, None])[:, :, 0])


def fates(model: Hierarchy, strayed: Numbers) -> tuple[Numbers, Numbers]:
    """Return what a stop after z visits makes of sizes, z = 0 to S.

    Parameters
    ----------
    model : Hierarchy
    strayed : (S,)
        How far the row's growth has strayed from its curve by each visit.

    Returns
    -------
    (S + 1, S)
        How far the logarithms of sizes are from those of a fruit that grows.
    (S + 1, S, 4)
        How they go with the fruit's four numbers.
    """
    line, slopes = model.curve + strayed, model.slopes
    n = len(line)
    visits, stops = np.arange(n), np.arange(n + 1)[:, None]
    until = np.minimum(visits, np.maximum(stops - 1, 0))
    # None before all visits, none after all, and none where a row is not said to grow.
    gains = np.pad(np.maximum(np.diff(line), 0.0), 1)
    stood = visits >= stops
    stands = stood * gains[:, None]
    later = np.where(stood, line - line[np.minimum(stops, n - 1)], 0.0)
    columns = np.stack([np.ones(until.shape), slopes[until], _UNIFORM * stands, _KEPT * later], axis=2)
    return line[until] - line + 0.5 * stands, columns


def stopped_growth(growth: Numbers, stops: NDArray[np.int64], shares: Numbers, kept: Numbers) -> Numbers:
    """Let the growth of fruits end, (K, Q), logarithms: after so many visits and a share of the next gain, (K,) each.

    Parameters
    ----------
    growth : (K, Q)
        As if they grew, at the visits and later.
    stops : (K,) int64
        0 for those that stopped before the first visit.
    shares, kept : (K,)
        u and w of each.
    """
    rows, last = np.arange(len(stops)), np.maximum(stops - 1, 0)
    gains = np.where(stops > 0, np.maximum(growth[rows, stops] - growth[rows, last], 0.0), 0.0)
    ends = growth[rows, last] + gains * (0.5 + _UNIFORM * shares)
    later = kept_growth(growth - growth[rows, stops][:, None], kept[:, None])
    return np.where(np.arange(growth.shape[1]) < stops[:, None], growth, ends[:, None] + later)


def kept_growth(growth: Numbers, kept: Numbers) -> Numbers:
    """Return what a fruit that has stopped keeps of growth, given its w."""
    return np.asarray(_KEPT * kept * growth)


def four_numbers(
    model: Hierarchy,
    effects: Effects,
    strayed: Numbers,
    rows: NDArray[np.int64],
    stops: NDArray[np.int64],
    trust: Numbers,
) -> FourNumbers:
    """Tell the own numbers of fruits, given what they share with others.

    Parameters
    ----------
    model : Hierarchy
    effects : Effects
        Of which the mean, the visits and the trees are taken.
    strayed : (S,)
    rows : (M,) int64
        The fruits, rows of the model's table.
    stops : (M,) int64
        After how many visits each stopped.
    trust : (M, S)
        In each size, given that.
    """
    shifts, columns = fates(model, strayed)
    weights, own = trust * model.whole[rows], columns[stops]
    off = np.where(model.table.seen[rows], model.against(effects)[rows] - shifts[stops], 0.0)
    weighted = weights[:, :, None] * own
    spreads = np.array([model.shape.fruit_spread, model.shape.onset_spread_days, 1.0, 1.0])
    precision = own.transpose(0, 2, 1) @ weighted + np.diag(spreads**-2)
    roots = np.asarray(np.linalg.cholesky(precision), np.float64)
    told = np.linalg.solve(roots, weighted.transpose(0, 2, 1))
    gathered = np.einsum("mks,ms->mk", told, off)
    densities = 0.5 * (gathered**2).sum(axis=1) - 0.5 * (weights * off**2).sum(axis=1)
    densities -= np.log(np.einsum("mkk->mk", roots)).sum(axis=1)
    middles = np.linalg.solve(roots.transpose(0, 2, 1), gathered[:, :, None])[:, :, 0]
    said = weights * off - np.einsum("mks,mk->ms", told, gathered)
    return FourNumbers(middles, roots, densities, said, weights - (told**2).sum(axis=1))
