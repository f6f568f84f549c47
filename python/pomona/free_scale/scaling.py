"""The scale of a reconstruction from the fruits of a map, and how sure it is.

The similarity is fitted to the pairs anew, each weighted by its probability, by its covariance, and by Cauchy's loss.
Residuals of neighbouring fruits are alike (drift, sag, a bent reconstruction), so that their number says little: the
uncertainty is that of the jackknife over stretches of the row. Left out one after the other, `k` stretches give
scales `s_i`; the variance of `ln s` is (k - 1)/k sum (ln s_i - mean)^2, and Student's t with k - 1 degrees of freedom
gives the interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.matching import Match

__all__ = ["LEAST_PAIRS", "Scaling", "scaling_of"]

Array = NDArray[np.float64]

LEAST_PAIRS = 6
"""For an uncertainty: four numbers of the similarity are turns and scale, and each stretch has a pair at least."""

STRETCHES = 12
"""Of the row, with about as many pairs each."""

CONFIDENCE = 0.9

SCALE2 = 3.0
"""Cauchy's c^2 for places, as in the core's `bundle`."""

FITS = 10
"""Of reweighting."""


@dataclass(frozen=True, eq=False)
class Scaling:
    """How a reconstruction lies in a map.

    Attributes
    ----------
    map_from_model : (4, 4) float64
        Similarity, metres a unit of the model folded in.
    scale : float
        Metres a unit of the model.
    sigma : float
        Standard deviation of `scale`.
    low, high : float
        Interval that holds the true scale nine times of ten.
    n_pairs : int
        Fruits that say it.
    """

    map_from_model: Array
    scale: float
    sigma: float
    low: float
    high: float
    n_pairs: int


def scaling_of(match: Match, query: FruitCloud, known: FruitCloud) -> Scaling | None:
    """Say how sure the scale of a match is; None where nothing was found, or too few pairs to tell.

    Parameters
    ----------
    match : Match
        With the scale free.
    query, known : FruitCloud
        Of the model and of the map.
    """
    from scipy.stats import t

    if not match or match.map_from_query is None or len(match.pairs) < LEAST_PAIRS:
        return None
    pairs = _Pairs.of(match, query, known)
    fitted = _fitted(pairs, match.map_from_query)
    stretches = _stretches(pairs.in_map)
    left_out = [_fitted(pairs.select(stretches != one), fitted) for one in range(stretches.max() + 1)]
    logs = np.log([_scale(transform) for transform in left_out])
    n = len(logs)
    sigma = float(np.sqrt((n - 1) / n * ((logs - logs.mean()) ** 2).sum()))
    reach = float(t.ppf((1 + CONFIDENCE) / 2, n - 1)) * sigma
    scale = _scale(fitted)
    return Scaling(fitted, scale, scale * sigma, scale * np.exp(-reach), scale * np.exp(reach), len(match.pairs))


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Places of pairs in both frames, (M, 3), a weight of each, and its variance in the map per axis."""

    in_model: Array
    in_map: Array
    weights: Array
    variances: Array

    @classmethod
    def of(cls, match: Match, query: FruitCloud, known: FruitCloud) -> _Pairs:
        assert match.map_from_query is not None
        asked, answers = match.pairs.T
        variances = np.full(len(asked), max(match.noise_m, 1e-9 * float(np.ptp(known.positions))) ** 2)
        if query.covariances is not None:
            in_map = np.trace(query.covariances[asked], axis1=1, axis2=2) / 3
            variances = variances + in_map * _scale(match.map_from_query) ** 2
        return cls(query.positions[asked], known.positions[answers], match.probabilities, variances)

    def select(self, rows: NDArray[np.bool_]) -> _Pairs:
        return _Pairs(self.in_model[rows], self.in_map[rows], self.weights[rows], self.variances[rows])


def _scale(transform: Array) -> float:
    return float(np.cbrt(np.linalg.det(transform[:3, :3])))


def _stretches(positions: Array) -> NDArray[np.int64]:
    """Give numbers to the stretches of the row in which places lie, as many in each."""
    centred = positions - positions.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
    order = np.argsort(np.argsort(along, kind="stable"), kind="stable")
    return np.asarray(order * min(STRETCHES, len(positions)) // len(positions))


def _fitted(pairs: _Pairs, start: Array) -> Array:
    transform = start
    for _ in range(FITS):
        errors = pairs.in_map - (pairs.in_model @ transform[:3, :3].T + transform[:3, 3])
        squared = (errors**2).sum(axis=1) / pairs.variances
        transform = _similarity(pairs, pairs.weights / (pairs.variances * (1 + squared / SCALE2)))
    return transform


def _similarity(pairs: _Pairs, weights: Array) -> Array:
    """Give the weighted least squares similarity (Umeyama, 1991)."""
    weights = weights / weights.sum()
    middle_model, middle_map = weights @ pairs.in_model, weights @ pairs.in_map
    model, map_ = pairs.in_model - middle_model, pairs.in_map - middle_map
    u, singular, vt = np.linalg.svd((weights[:, None] * map_).T @ model)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    scale = (singular * signs).sum() / (weights @ (model**2).sum(axis=1))
    transform = np.eye(4)
    transform[:3, :3] = scale * (u * signs) @ vt
    transform[:3, 3] = middle_map - transform[:3, :3] @ middle_model
    return transform
