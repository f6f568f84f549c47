"""Crowns along a row: a comb of trees, each a heap of fruits about its trunk, fitted by expectation-maximisation.

The density of fruits at u along the row, in layer b beside it, is

    p(u | b) = (1 - e) sum_k w_k N(u; m_k, s_b) + e / length

with trees k at m_k that bear shares w_k, one width s_b of crowns for each layer (crowns taper), and a share e of false
detections. Steps m_(k+1) - m_k are normal about the spacing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["STRAY_SHARE", "Crowns", "RowCounts", "fitted", "log_density"]

STRAY_SHARE = 0.02
"""e: of the fruits, those that hang on no tree of the row."""

STEP_SIGMA = 0.06
"""Of the steps from tree to tree, as a share of the spacing: what planters and odometry leave."""

FIRST_WIDTH = 0.25
WIDTHS = (0.06, 0.45)
"""Least and most of the crowns' widths, standard deviations as shares of the spacing; the first guess."""


@dataclass(frozen=True, eq=False)
class RowCounts:
    """Fruits of a row, alike ones together.

    Attributes
    ----------
    along_m : (S,) float64
    layers : (S,) int64
        Layer beside the row, from 0.
    counts : (S,) float64
        How many there are.
    """

    along_m: NDArray[np.float64]
    layers: NDArray[np.int64]
    counts: NDArray[np.float64]

    @property
    def n_layers(self) -> int:
        """How many layers there are."""
        return int(self.layers.max(initial=0)) + 1

    @property
    def length_m(self) -> float:
        """Length of the row."""
        return float(np.ptp(self.along_m)) + 0.2

    def between(self, low_m: float, high_m: float) -> RowCounts:
        """Return those of a stretch."""
        there = (self.along_m >= low_m) & (self.along_m < high_m)
        return RowCounts(self.along_m[there], self.layers[there], self.counts[there])


@dataclass(frozen=True, eq=False)
class Crowns:
    """Trees of a row.

    Attributes
    ----------
    spacing_m : float
    places_m : (K,) float64
        Ascending.
    shares : (K,) float64
        Of the fruits; they sum to 1.
    widths_m : (B,) float64
        Of the crowns by layer.
    """

    spacing_m: float
    places_m: NDArray[np.float64]
    shares: NDArray[np.float64]
    widths_m: NDArray[np.float64]

    def densities(self, along_m: NDArray[np.float64], layers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the part of the density that each tree has, (S, K), without strays."""
        widths = self.widths_m[layers][:, None]
        off = (along_m[:, None] - self.places_m) / widths
        return np.asarray(self.shares * np.exp(-0.5 * off**2) / (widths * np.sqrt(2.0 * np.pi)))

    def select(self, kept: NDArray[np.bool_]) -> Crowns:
        """Return some of the trees."""
        shares = self.shares[kept]
        return Crowns(self.spacing_m, self.places_m[kept], shares / shares.sum(), self.widths_m)


def log_density(counted: RowCounts, crowns: Crowns) -> float:
    """Return the sum of log p over the fruits, and of the steps between trees."""
    density = (1.0 - STRAY_SHARE) * crowns.densities(counted.along_m, counted.layers).sum(axis=1)
    steps = (np.diff(crowns.places_m) - crowns.spacing_m) / (STEP_SIGMA * crowns.spacing_m)
    return float(counted.counts @ np.log(density + STRAY_SHARE / counted.length_m) - 0.5 * (steps**2).sum())


def fitted(counted: RowCounts, spacing_m: float, places_m: NDArray[np.float64], *, rounds: int, moves: bool) -> Crowns:
    """Fit shares and widths, and the places where they may move, from places to begin with."""
    k = len(places_m)
    crowns = Crowns(spacing_m, places_m, np.full(k, 1.0 / k), np.full(counted.n_layers, FIRST_WIDTH * spacing_m))
    for _ in range(rounds):
        crowns = _better(counted, crowns, moves)
    return crowns


def _better(counted: RowCounts, crowns: Crowns, moves: bool) -> Crowns:
    densities = (1.0 - STRAY_SHARE) * crowns.densities(counted.along_m, counted.layers)
    total = densities.sum(axis=1) + STRAY_SHARE / counted.length_m
    belongs = densities * (counted.counts / total)[:, None]
    shares = belongs.sum(axis=0) + 1e-9
    places = _moved(counted, crowns, belongs) if moves else crowns.places_m
    squares = (belongs * (counted.along_m[:, None] - places) ** 2).sum(axis=1)
    n = crowns.widths_m.size
    variances = np.bincount(counted.layers, squares, n) / (np.bincount(counted.layers, belongs.sum(axis=1), n) + 1e-9)
    low, high = (share * crowns.spacing_m for share in WIDTHS)
    return Crowns(crowns.spacing_m, places, shares / shares.sum(), np.clip(np.sqrt(variances), low, high))


def _moved(counted: RowCounts, crowns: Crowns, belongs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the places between their fruits and their neighbours: a chain of springs, solved at once."""
    pulls = belongs / crowns.widths_m[counted.layers][:, None] ** 2
    links = np.full(len(crowns.places_m) - 1, 1.0 / (STEP_SIGMA * crowns.spacing_m) ** 2)
    before, after = np.append(0.0, links), np.append(links, 0.0)
    forces = np.diag(pulls.sum(axis=0) + before + after + 1e-9) - np.diag(links, 1) - np.diag(links, -1)
    wanted = pulls.T @ counted.along_m + crowns.spacing_m * (before - after) + 1e-9 * crowns.places_m
    return np.asarray(np.linalg.solve(forces, wanted))
