"""How a row is planted: the spacing that its fruits speak for, and whether trees can be told at all.

Two stories are compared for every spacing and every phase of the comb: crowns, heaps of fruits about trunks
(`crowns.py`), and a hedge, in which fruits hang evenly from step to step with sharp ends. Each is scored by its log
likelihood less half the log of the number of fruits for every parameter (Schwarz 1978). Fruits of one cluster are no
independent evidence: every fruit counts by the inverse of how many hang together (`crowding`), so a row that is known
better tells more and not less. Only where crowns beat every hedge are there trees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.tree_rows.crowns import STRAY_SHARE, Crowns, RowCounts, fitted, log_density

__all__ = ["Planting", "crowding", "planting_at", "planting_of"]

SPACINGS_M = (0.65, 4.3)
"""Between trunks, from columns to old plantings."""

SPACING_RATIO = 1.05
GIVEN_WITHIN = 0.05
"""A spacing that is given is the planter's: the trees stand in it within so much, odometry being what it is."""

HEDGE_PHASES = 12
"""Of the steps of a hedge, that one fits best."""

STRETCH_M = 12.0
"""Spacing is asked of stretches: over a longer one planters and odometry lose step."""

MOST_STRETCHES = 3
LAYERS = 3
CLUSTER_M = 0.16
"""Fruits nearer than this may be of one cluster: two that touch are 7 to 10 cm apart, four together reach so far."""

BIN_M = 0.08

FIRST_ROUNDS, LAST_ROUNDS, FINALISTS = 6, 30, 5

LEAST_LOG_ODDS = 0.0
"""Crowns are told where they are likelier than any hedge. Of drawn rows 18 more are told right than at e to one, and
one more wrong; of roofs and walls, where none is to be told, two more."""

LEAST_TREES = 2
"""Of one nobody knows that it is one."""

LEAST_OF_TREE = 0.2
"""Of a usual tree's fruits; with fewer no tree is there."""

LEAST_ON_TREE = 4.0

EVENNESS = 0.6
"""Standard deviation of the log of what trees bear; the last ones of a row may be seen in part."""

HOLE = 4.0
"""Log odds, beyond `MISSING`, against a hole as wide as a step in what is said to be a hedge."""

MISSING = 3.5
"""Log odds against a tree that is missing within the row: one of thirty."""


@dataclass(frozen=True, eq=False)
class Planting:
    """How a row is planted.

    Attributes
    ----------
    crowns : Crowns or None
        Its trees; None where no trees can be told.
    spacing_m : float
    log_odds : float
        For crowns against a hedge.
    layer_edges_m : (B - 1,) float64
        Between the layers of the fruits beside the row.
    """

    crowns: Crowns | None
    spacing_m: float
    log_odds: float
    layer_edges_m: NDArray[np.float64]

    def bearers(
        self, along_m: NDArray[np.float64], beside_m: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the tree of each fruit, (M,), and how likely it is that one, 0 to 1; -1 for none."""
        if self.crowns is None:
            return np.full(len(along_m), -1), np.zeros(len(along_m))
        layers = np.searchsorted(self.layer_edges_m, beside_m[:, 0])
        densities = (1.0 - STRAY_SHARE) * self.crowns.densities(along_m, layers)
        stray = STRAY_SHARE / (np.ptp(along_m) + 0.2)
        best = densities.argmax(axis=1)
        chances = densities.max(axis=1) / (densities.sum(axis=1) + stray)
        is_stray = densities.sum(axis=1) < stray
        return np.where(is_stray, -1, best), np.where(is_stray, 0.0, chances)


def planting_of(
    positions: NDArray[np.float64],
    along_m: NDArray[np.float64],
    beside_m: NDArray[np.float64],
    spacing_m: float | None = None,
) -> Planting:
    """Find the trees of a row.

    Parameters
    ----------
    positions : (M, 3) float64
    along_m, beside_m : (M,) and (M, 2) float64
        As in `RowLine`.
    spacing_m : float, optional
        Between trunks, where it is known.
    """
    edges, counted = _counted(positions, along_m, beside_m)
    found = _spacing(counted, spacing_m)
    if found is None:
        return Planting(None, 0.0, -np.inf, edges)
    log_odds, first = found
    if log_odds < LEAST_LOG_ODDS:
        return Planting(None, first.spacing_m, log_odds, edges)
    crowns = _bearing(_along_all(counted, first), counted)
    if len(crowns.places_m) < LEAST_TREES:
        return Planting(None, first.spacing_m, log_odds, edges)
    return Planting(crowns, float(np.median(np.diff(crowns.places_m))), log_odds, edges)


def planting_at(
    positions: NDArray[np.float64],
    along_m: NDArray[np.float64],
    beside_m: NDArray[np.float64],
    places_m: NDArray[np.float64],
) -> Planting:
    """Take trees that are known, (K,) places along the row, ascending; only what they bear is found."""
    edges, counted = _counted(positions, along_m, beside_m)
    spacing_m = float(np.median(np.diff(places_m))) if len(places_m) > 1 else 2.0
    crowns = fitted(counted, spacing_m, places_m, rounds=LAST_ROUNDS, moves=False)
    return Planting(crowns, spacing_m, np.inf, edges)


def _counted(
    positions: NDArray[np.float64], along_m: NDArray[np.float64], beside_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], RowCounts]:
    """Give fruits in layers of equal numbers, counted in bins along the row, clusters as `crowding` says."""
    edges = np.quantile(beside_m[:, 0], np.arange(1, LAYERS) / LAYERS)
    layers = np.searchsorted(edges, beside_m[:, 0])
    bins = np.floor(along_m / BIN_M).astype(np.int64)
    used, number = np.unique(np.stack([bins, layers], axis=1), axis=0, return_counts=True)
    return edges, RowCounts((used[:, 0] + 0.5) * BIN_M, used[:, 1], number / crowding(positions))


def crowding(positions: NDArray[np.float64]) -> float:
    """Return how many fruits tell as much as one that hangs for itself, 1 or more: the design effect of clusters.

    That is 1 and the fruits of its cluster beside a usual fruit: those within `CLUSTER_M`, less those who hang there
    anyway, by the shell around them, which is seven times as large. It is one number for the whole row: were fruits
    that touch counted as one, crowns would count for least where most hangs, and look ever more like a hedge the more
    of their fruits are known.
    """
    from scipy.spatial import KDTree

    tree = KDTree(positions)
    # Each fruit is its own neighbour, too.
    near, reached = (tree.count_neighbors(tree, within_m) - len(positions) for within_m in (CLUSTER_M, 2.0 * CLUSTER_M))
    return max(1.0, 1.0 + float(near - (reached - near) / 7.0) / len(positions))


def _spacing(counted: RowCounts, given_m: float | None) -> tuple[float, Crowns] | None:
    """Return the log odds for crowns against a hedge, and the crowns of the stretch that speaks most for them."""
    stretches = _stretches(counted)
    length_m = max(stretch.length_m for stretch in stretches)
    spacings = _candidates(given_m, length_m)
    if not len(spacings):
        return None
    # A spacing is one for the whole row, its phase is each stretch's own.
    found = [[_best_crowns(stretch, spacing) for spacing in spacings] for stretch in stretches]
    scores = np.array([[score for score, _ in of_stretch] for of_stretch in found])
    hedges = np.array(
        [max(_hedge_score(stretch, spacing) for spacing in _candidates(None, length_m)) for stretch in stretches]
    )
    totals = scores.sum(axis=0)
    finalists = np.argsort(-totals, kind="stable")[:FINALISTS]
    best, best_crowns = -np.inf, found[0][finalists[0]][1]
    for number in finalists.tolist():
        refined = [
            fitted(stretch, crowns.spacing_m, crowns.places_m, rounds=LAST_ROUNDS, moves=True)
            for stretch, (_, crowns) in zip(stretches, [of_stretch[number] for of_stretch in found], strict=True)
        ]
        each = [_score(stretch, crowns) for stretch, crowns in zip(stretches, refined, strict=True)]
        if sum(each) > best:
            best, best_crowns = sum(each), refined[int(np.argmax(np.array(each) - hedges))]
    return best - float(hedges.sum()), best_crowns


def _candidates(given_m: float | None, length_m: float) -> NDArray[np.float64]:
    low, high = SPACINGS_M if given_m is None else (given_m * (1 - GIVEN_WITHIN), given_m * (1 + GIVEN_WITHIN))
    if given_m is None:
        # Of one tree nobody knows the spacing.
        high = min(high, length_m / 1.25)
    if high < low:
        return np.empty(0)
    count = max(3, round(np.log(high / low) / np.log(SPACING_RATIO)) + 1)
    return np.geomspace(low, high, count)


def _stretches(counted: RowCounts) -> list[RowCounts]:
    low, high = counted.along_m.min(), counted.along_m.max()
    count = max(1, int((high - low) // STRETCH_M))
    edges = np.linspace(low, high + BIN_M, count + 1)
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_STRETCHES)).round().astype(int))
    parts = [counted.between(edges[part], edges[part + 1]) for part in chosen]
    return [part for part in parts if part.counts.sum() >= 2 * LEAST_ON_TREE] or [counted]


def _best_crowns(counted: RowCounts, spacing_m: float) -> tuple[float, Crowns]:
    """Return the best phase of a comb that stands still."""
    low, high = counted.along_m.min() - spacing_m / 2.0, counted.along_m.max() + spacing_m / 2.0
    # The mean on the circle of one spacing; the ends of a short row pull it aside, so its opposite is tried too.
    turns = np.exp(2j * np.pi * counted.along_m / spacing_m)
    mean_m = np.angle(counted.counts @ turns) / (2.0 * np.pi) * spacing_m
    tried = [
        fitted(
            counted,
            spacing_m,
            np.arange(low + (start_m - low) % spacing_m, high, spacing_m),
            rounds=FIRST_ROUNDS,
            moves=False,
        )
        for start_m in (mean_m, mean_m + spacing_m / 2.0)
    ]
    scored = [(_score(counted, crowns), _trimmed(crowns, counted)) for crowns in tried]
    return max(scored, key=lambda pair: pair[0])


def _score(counted: RowCounts, crowns: Crowns) -> float:
    """Return the log likelihood less what parameters cost, and what uneven or missing trees do."""
    n = counted.counts.sum()
    n_parameters = _bears(crowns.shares, n).sum() + counted.n_layers + 1
    return float(log_density(counted, crowns) - 0.5 * np.log(n) * n_parameters - _unevenness(crowns.shares, n))


def _hedge_score(counted: RowCounts, step_m: float) -> float:
    """Return the score of fruits that hang evenly from step to step, in the best phase."""
    n = counted.counts.sum()
    best = -np.inf
    for phase in np.arange(HEDGE_PHASES) / HEDGE_PHASES:
        steps = np.floor(counted.along_m / step_m - phase).astype(np.int64)
        steps -= steps.min()
        shares = np.bincount(steps, counted.counts) / n
        density = (1.0 - STRAY_SHARE) * shares[steps] / step_m
        total = counted.counts @ np.log(density + STRAY_SHARE / counted.length_m)
        costs = 0.5 * np.log(n) * (_bears(shares, n).sum() + 2) + _unevenness(shares, n) + HOLE * _n_missing(shares, n)
        best = max(best, float(total - costs))
    return best


def _unevenness(shares: NDArray[np.float64], n: float) -> float:
    """Return what speaks against trees, or steps of a hedge, that bear so differently; the ends may be seen in part."""
    bearing = np.flatnonzero(_bears(shares, n))
    if len(bearing) < 2:
        return 0.0
    loads = np.log(shares[bearing[1:-1]])
    uneven = 0.5 * (((loads - loads.mean()) / EVENNESS) ** 2).sum() if len(loads) else 0.0
    return float(uneven + MISSING * _n_missing(shares, n))


def _n_missing(shares: NDArray[np.float64], n: float) -> int:
    """Return how many bear nothing between those that bear."""
    bearing = np.flatnonzero(_bears(shares, n))
    return int(bearing[-1] - bearing[0] + 1 - len(bearing)) if len(bearing) else 0


def _bears(shares: NDArray[np.float64], n: float) -> NDArray[np.bool_]:
    """Tell which trees of a comb, or steps, are there by the shares of the fruits that they bear."""
    usual = np.median(shares[shares * n >= LEAST_ON_TREE]) if (shares * n >= LEAST_ON_TREE).any() else 0.0
    return np.asarray(shares * n >= max(LEAST_ON_TREE, LEAST_OF_TREE * usual * n))


def _bearing(crowns: Crowns, counted: RowCounts) -> Crowns:
    """Leave out the trees that bear nothing."""
    kept = _bears(crowns.shares, counted.counts.sum())
    return crowns.select(kept) if kept.any() else crowns


def _trimmed(crowns: Crowns, counted: RowCounts) -> Crowns:
    """Leave out what bears nothing at the ends; what is missing within keeps its place, so that steps are steps."""
    bearing = np.flatnonzero(_bears(crowns.shares, counted.counts.sum()))
    kept = np.zeros(len(crowns.shares), bool)
    if len(bearing):
        kept[bearing[0] : bearing[-1] + 1] = True
    return crowns.select(kept) if kept.any() else crowns


def _along_all(counted: RowCounts, first: Crowns) -> Crowns:
    """Go on from the trees of a stretch to both ends of the row, tree by tree, and fit all of them together."""
    places = list(first.places_m)
    width = float(first.widths_m.mean())
    low, high = counted.along_m.min(), counted.along_m.max()
    while places[-1] + 0.5 * first.spacing_m < high:
        places.append(_next(counted, places[-1] + first.spacing_m, first.spacing_m, width))
    while places[0] - 0.5 * first.spacing_m > low:
        places.insert(0, _next(counted, places[0] - first.spacing_m, first.spacing_m, width))
    return fitted(
        counted, first.spacing_m, _whole_comb(np.array(places), first.spacing_m), rounds=LAST_ROUNDS, moves=True
    )


def _next(counted: RowCounts, expected_m: float, spacing_m: float, width_m: float) -> float:
    """Return where the next tree is, between where the spacing and where the fruits say."""
    near = counted.between(expected_m - spacing_m / 2.0, expected_m + spacing_m / 2.0)
    weights = near.counts * np.exp(-0.5 * ((near.along_m - expected_m) / width_m) ** 2)
    if not weights.sum():
        return expected_m
    told = float(weights @ near.along_m / weights.sum())
    trust = weights.sum() / (weights.sum() + (width_m / (0.1 * spacing_m)) ** 2)
    return expected_m + float(trust) * (told - expected_m)


def _whole_comb(places_m: NDArray[np.float64], spacing_m: float) -> NDArray[np.float64]:
    """Return places with those of the trees that are missing between."""
    gaps = np.maximum(np.round(np.diff(places_m) / spacing_m).astype(int), 1)
    parts = [
        np.linspace(one, other, gap, endpoint=False)
        for one, other, gap in zip(places_m[:-1], places_m[1:], gaps, strict=True)
    ]
    return np.concatenate([*parts, places_m[-1:]])
