r"""What the sizes of one track are if it grows, grows slowly, has stopped, or is a thing that stays as it is.

The logarithms of the sizes of a track are $y_v = s_v + c_v + a + x\, d_v + e_v$ at the visits $v$ that measured it:
$s_v$ the scale of a visit, $c_v$ a curve, $a \sim N(0, \sigma_a)$ its own level, $x$ how far it goes along $d_v$, and
$e_v \sim N(0, \sigma_v)$. Of a track no size is off, or one. With $g_v$ the growth of the planting,

- it *grows*: $c = g$, $d = g - \bar g$, $x \sim N(0, \sigma_b)$; and so too if it is *odd*, smaller or larger than most
  fruits, with three times $\sigma_a$;
- it is *slow*, by anything from nothing to all of the growth: $c = g_1$, $d = g - g_1$, $x$ even from 0 to 1;
- it has *stopped* after visit $z$ and some of the next gain, or, with $z = 0$, before the first: $c = g_{\min(v, z)}$;
- it is a *thing* as large as fruits on any day: $c = g_1$, $d = g_V - g_1$, $x$ even from 0 to 1.

Without growth all of them are the same, so nothing is told; and a thing as large as fruits are at first may well be a
fruit that stopped early, where one as large as they are at last is none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["GROWS", "ODD", "SLOW", "STANDS", "THING", "Growing", "OwnGrowth", "fate_densities", "own_growth"]

Numbers = NDArray[np.float64]

GROWS, ODD, SLOW, THING, STANDS = range(5)
"""Fates; `STANDS` has stopped before the first visit, those behind it after the first, the second and so on."""

OFF = 0.02
"""Share of sizes that are not those of the track: of half a fruit behind a leaf, of the neighbour."""

OFF_BY = 0.5
"""Of the logarithm of such a size: half to twice of what it should be."""

SURPRISE = 4.0
"""Nats by which sizes are less likely than usual, from which one of them may be off: it takes six to believe that."""

ODD_BY = 3.0
"""Times as far from the others as most: a size that is seen late and is small is no proof of a thing."""

UNIFORM_SPREAD = 12.0**-0.5
"""Standard deviation of what is anywhere from 0 to 1."""

LEAST = 1e-9
"""Information on how far a track goes, where its visits say nothing of it."""


@dataclass(frozen=True, eq=False)
class Growing:
    """How a planting grows over V visits, in logarithms of diameters.

    Attributes
    ----------
    growth : (V,)
        Middle of the sizes of fruits that grow, scales of visits apart.
    scales : (V,)
        Of the visits, about 0.
    noises : (V,)
        Standard deviation of a size.
    level_spread, rate_spread : float
        Of fruits' own levels, and of how much more or less than all they grow, as a share.
    """

    growth: Numbers
    scales: Numbers
    noises: Numbers
    level_spread: float
    rate_spread: float

    @property
    def directions(self) -> Numbers:
        """Along which fruits grow more or less than all, (V,)."""
        return np.asarray(self.growth - self.growth.mean())

    def fates(self) -> tuple[Numbers, Numbers]:
        """Return the curves and the directions of all fates, (M, V) both; a way that is normal has a spread of 1."""
        growth, n = self.growth, len(self.growth)
        stops, visits = np.arange(1, n)[:, None], np.arange(n)
        gains = np.maximum(np.diff(growth), 0.0)[:, None] * (visits >= stops)
        first = np.full(n, growth[0])
        curves = np.vstack([growth, growth, first, first, first, growth[np.minimum(visits, stops - 1)] + 0.5 * gains])
        everywhere = np.full(n, growth[-1] - growth[0])
        rates, slower = self.rate_spread * self.directions, growth - growth[0]
        return curves, np.vstack([rates, rates, slower, everywhere, np.zeros(n), UNIFORM_SPREAD * gains])

    def levels(self) -> Numbers:
        """Return the spreads of the levels of all fates, (M,)."""
        fates = np.arange(STANDS + len(self.growth))
        return np.where(fates == ODD, ODD_BY, 1.0) * self.level_spread


@dataclass(frozen=True, eq=False)
class _Sums:
    """Sums over the sizes of a track, all of them and perhaps without each in turn, (N, M, 1 + V), its level apart."""

    density: Numbers
    information: Numbers
    said: Numbers


def fate_densities(log_sizes: Numbers, drops: Numbers, growing: Growing) -> Numbers:
    """Return the logarithm of the density of the sizes of each track, (N, M, 1 + V), for each of the M fates.

    With no size off, and with that of each visit where one may be.

    Parameters
    ----------
    log_sizes : (N, V) float64
        NaN where a visit did not measure the track.
    drops : (N,) float64
        Nats against a fruit that stands still to hang for as long as the track was seen; against one that is slow by
        $x$ they are $1 - x$ as many.
    growing : Growing
    """
    seen = ~np.isnan(log_sizes)
    logs = np.full((len(log_sizes), STANDS + seen.shape[1], 1 + seen.shape[1]), -np.inf)
    logs[:, :, :1] = _densities(log_sizes, drops, growing, _of_all)
    usual = seen @ (np.log1p(-OFF) - np.log(np.sqrt(2.0 * np.pi) * growing.noises) - 0.5)
    rows = np.flatnonzero(logs[:, :, 0].max(axis=1) < usual - SURPRISE)
    logs[rows] = _densities(log_sizes[rows], drops[rows], growing, _without_each)
    return logs


def _densities(log_sizes: Numbers, drops: Numbers, growing: Growing, summed: Callable[[Numbers], Numbers]) -> Numbers:
    sums = _summed(log_sizes, growing, summed)
    sums.density[:, [SLOW, STANDS]] -= drops[:, None, None]
    sums.said[:, SLOW] += drops[:, None]
    return np.asarray(sums.density + _along(sums))


def _summed(log_sizes: Numbers, growing: Growing, summed: Callable[[Numbers], Numbers]) -> _Sums:
    seen, (curves, along) = ~np.isnan(log_sizes), growing.fates()
    weights = (seen / growing.noises**2)[:, None, :]
    off = np.where(seen, log_sizes - growing.scales, 0.0)[:, None, :] - curves
    of_level = growing.levels()[:, None] ** -2
    weighted, sideways = weights * off, weights * along
    weight, gone = summed(weights), summed(sideways)
    said, along_said = summed(weighted), summed(sideways * off)
    together = of_level + weight
    logs = summed(np.where(seen, np.log1p(-OFF) - np.log(np.sqrt(2.0 * np.pi) * growing.noises), 0.0))
    logs[:, 1:] += np.where(seen, np.log(OFF / (np.sqrt(2.0 * np.pi) * OFF_BY)), -np.inf)[:, : logs.shape[1] - 1]
    shares = said / together
    density = logs[:, None, :] - 0.5 * np.log(together / of_level) - 0.5 * (summed(weighted * off) - said * shares)
    information = summed(sideways * along) - gone**2 / together
    return _Sums(density, information, along_said - gone * shares)


def _along(sums: _Sums) -> Numbers:
    """Return what going along the directions adds to the logarithm of the densities, (N, M, 1 + V)."""
    from scipy.special import log_ndtr

    added, fates = np.empty_like(sums.density), np.arange(sums.density.shape[1])
    is_even = (fates == SLOW) | (fates == THING)
    even, normal = fates[is_even], fates[~is_even]
    information, said = sums.information[:, normal], sums.said[:, normal]
    added[:, normal] = 0.5 * said**2 / (1.0 + information) - 0.5 * np.log1p(information)
    information, said = np.maximum(sums.information[:, even], LEAST), sums.said[:, even]
    root = np.sqrt(information)
    ends = -said / root, root - said / root
    # In the lower tail, where a difference of two of them is not lost.
    upper = ends[0] + ends[1] > 0.0
    low, high = np.where(upper, -ends[1], ends[0]), np.where(upper, -ends[0], ends[1])
    logs = log_ndtr(low), log_ndtr(high)
    inside = logs[1] + np.log(-np.expm1(np.minimum(logs[0] - logs[1], -LEAST)))
    added[:, even] = 0.5 * said**2 / information + 0.5 * np.log(2.0 * np.pi / information) + inside
    return added


def _of_all(terms: Numbers) -> Numbers:
    """Return the sum over the last axis."""
    return np.asarray(terms.sum(axis=-1, keepdims=True))


def _without_each(terms: Numbers) -> Numbers:
    """Return the sum over the last axis, and beside it the sums without each of its terms."""
    sums = np.empty((*terms.shape[:-1], terms.shape[-1] + 1))
    terms.sum(axis=-1, out=sums[..., 0])
    np.subtract(sums[..., :1], terms, out=sums[..., 1:])
    return sums


@dataclass(frozen=True, eq=False)
class OwnGrowth:
    """Level and rate of N tracks if they grow, given all sizes, and all but each.

    Attributes
    ----------
    off : (N, 1 + V, V)
        Of each size from what they say.
    variances : (N, 1 + V, V)
        Of what they say.
    squares : (2, N, 1 + V)
        Mean squares of level and rate.
    """

    off: Numbers
    variances: Numbers
    squares: Numbers


def own_growth(log_sizes: Numbers, growing: Growing) -> OwnGrowth:
    """Tell the own level and rate of tracks that grow; see `fate_densities`."""
    seen, along = ~np.isnan(log_sizes), growing.directions
    weights = seen / growing.noises**2
    off = np.where(seen, log_sizes - growing.scales - growing.growth, 0.0)
    weight, gone, around = (_without_each(weights * along**power) for power in range(3))
    said, along_said = _without_each(weights * off), _without_each(weights * along * off)
    weight, around = weight + growing.level_spread**-2, around + growing.rate_spread**-2
    room = weight * around - gone**2
    level, rate = (around * said - gone * along_said) / room, (weight * along_said - gone * said) / room
    foretold = level[:, :, None] + rate[:, :, None] * along
    variances = (around[:, :, None] - 2.0 * gone[:, :, None] * along + weight[:, :, None] * along**2) / room[:, :, None]
    squares = np.stack([level**2 + around / room, rate**2 + weight / room])
    return OwnGrowth(off[:, None, :] - foretold, variances, squares)
