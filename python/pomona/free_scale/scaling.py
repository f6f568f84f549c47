"""The scale of a reconstruction from the fruits of a map, and how sure it is.

Pairs of fruits, m in the map and q in the model, are off by e = m - (s R q + t). Noise of each fruit is one part of e,
the other moves what is near together: drift, sag, a reconstruction that is not straight. Cov(e) = v (D + r K), with D
the variances of the fruits and K_ij a function of |m_i - m_j| / l, rough as drift or smooth as a bend; v, r and l are
unknown. Treated as independent, the residuals of a bent row give a scale that looks surer than it is.

For each r, l and shape of a grid, turn, place and ln s are the generalised least squares, whose restricted likelihood
(Patterson and Thompson, 1971) knows that seven numbers were fitted to the same residuals. The answer is the mean over
the grid, so that what the pairs cannot tell about the bend is uncertainty of the scale too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.matching import Match

__all__ = ["LEAST_PAIRS", "FreeScaling", "scaling_of"]

Array = NDArray[np.float64]

LEAST_PAIRS = 6
"""For an uncertainty: seven numbers are fitted to three of each pair."""

BENDS = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""r: variance of the bend over that of the mean fruit."""

LENGTHS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0, 2.0)
"""l, in lengths of what the pairs reach over."""

SHAPES: tuple[Callable[[Array], Array], ...] = (
    lambda apart: np.exp(-apart),
    lambda apart: (1 + np.sqrt(3) * apart) * np.exp(-np.sqrt(3) * apart),
)
"""K of a distance over l: a random walk that is held, and one of velocities (Matern, 1/2 and 3/2)."""

MOST_PAIRS = 400
"""That the uncertainty is made of; more are thinned out along the row: bends are its most, not noise."""

Z_OF_CONFIDENCE = 1.645
"""Sigmas on both sides of nine draws of ten."""

SCALE2 = 3.0
"""Cauchy's c^2 for places, as in the core's `bundle`."""

LEAST_WEIGHT = 0.01
"""Of a pair that is surely wrong: one of none has a variance without end."""

LEAST_SIGMA = 1e-6
"""Of ln s: no camera and no map is straight to a micrometre in a metre, whatever two copies of one cloud say."""

TINY = 1e-12

FITS = 10
"""Of reweighting."""


@dataclass(frozen=True, eq=False)
class FreeScaling:
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


def scaling_of(match: Match, query: FruitCloud, known: FruitCloud) -> FreeScaling | None:
    """Say how sure the scale of a match is; None where nothing was found, or too few pairs to tell.

    Parameters
    ----------
    match : Match
        With the scale free.
    query, known : FruitCloud
        Of the model and of the map.
    """
    if not match or match.map_from_query is None or len(match.pairs) < LEAST_PAIRS:
        return None
    pairs = _Pairs.of(match, query, known)
    fitted = _fitted(pairs, match.map_from_query)
    step, sigma = _mean_over(_bends(pairs.thinned(), fitted))
    refined = _rescaled(fitted, float(np.exp(step)), pairs)
    scale = _scale(refined)
    low, high = (scale * float(np.exp(side * Z_OF_CONFIDENCE * sigma)) for side in (-1, 1))
    return FreeScaling(refined, scale, scale * sigma, low, high, len(match.pairs))


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
        weights = np.maximum(match.probabilities, LEAST_WEIGHT)
        return cls(query.positions[asked], known.positions[answers], weights, variances)

    def thinned(self) -> _Pairs:
        """Give at most `MOST_PAIRS`, evenly along the row."""
        centred = self.in_map - self.in_map.mean(axis=0)
        order = np.argsort(centred @ np.linalg.svd(centred, full_matrices=False)[2][0], kind="stable")
        rows = order[:: -(-len(order) // MOST_PAIRS)]
        return _Pairs(self.in_model[rows], self.in_map[rows], self.weights[rows], self.variances[rows])


def _scale(transform: Array) -> float:
    return float(np.cbrt(np.linalg.det(transform[:3, :3])))


@dataclass(frozen=True)
class _Bend:
    """A step of ln s under one bend of the grid, its variance, and how likely the bend is."""

    step: float
    variance: float
    log_likelihood: float


def _bends(pairs: _Pairs, fitted: Array) -> list[_Bend]:
    placed = pairs.in_model @ fitted[:3, :3].T + fitted[:3, 3]
    errors = pairs.in_map - placed
    spread = pairs.variances / (pairs.weights / (1 + (errors**2).sum(axis=1) / pairs.variances / SCALE2))
    distances = np.linalg.norm(placed[:, None] - placed[None], axis=2)
    noise, reach = np.diag(spread / np.median(spread)), distances.max() or 1.0
    columns = _columns(placed - placed.mean(axis=0))
    return [
        _of_bend(noise + bend * shape(distances / (length * reach)), columns, errors)
        for shape in SHAPES
        for length in LENGTHS
        for bend in BENDS
    ]


def _mean_over(bends: list[_Bend]) -> tuple[float, float]:
    """Give the mean step over the grid, and its sigma: within each bend, and of what they say."""
    likelihoods = np.array([bend.log_likelihood for bend in bends])
    probabilities = np.exp(likelihoods - likelihoods.max())
    probabilities /= probabilities.sum()
    steps = np.array([bend.step for bend in bends])
    mean = float(probabilities @ steps)
    variances = np.array([bend.variance for bend in bends]) + (steps - mean) ** 2
    return mean, max(float(np.sqrt(probabilities @ variances)), LEAST_SIGMA)


def _columns(placed: Array) -> Array:
    """Give how places (N, 3) about the middle follow turns, steps along the axes and ln s: (N, 3, 7)."""
    x, y, z = placed.T
    nothing, one = np.zeros_like(x), np.ones_like(x)
    rows = [
        [nothing, z, -y, one, nothing, nothing, x],
        [-z, nothing, x, nothing, one, nothing, y],
        [y, -x, nothing, nothing, nothing, one, z],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _of_bend(covariance: Array, columns: Array, errors: Array) -> _Bend:
    """Fit under one bend, by generalised least squares and restricted likelihood, where v is unknown."""
    from scipy.linalg import solve_triangular

    root = np.linalg.cholesky(covariance)
    n = len(errors)
    both = np.concatenate([columns.reshape(n, -1), errors], axis=1)
    white = solve_triangular(root, both, lower=True, check_finite=False)
    design, seen = white[:, :21].reshape(3 * n, 7), white[:, 21:].reshape(3 * n)
    normal = design.T @ design
    normal += TINY * np.trace(normal) * np.eye(7)  # fruits on one line leave a turn open
    answer = np.linalg.solve(normal, design.T @ seen)
    degrees = 3 * n - 7
    variance = max(float(((seen - design @ answer) ** 2).sum()) / degrees, np.finfo(np.float64).tiny)
    log_volumes = 3 * 2 * np.log(np.diag(root)).sum() + np.linalg.slogdet(normal)[1]
    likelihood = -(degrees * np.log(variance) + log_volumes) / 2
    return _Bend(float(answer[6]), variance * float(np.linalg.inv(normal)[6, 6]), float(likelihood))


def _rescaled(transform: Array, factor: float, pairs: _Pairs) -> Array:
    """Give the transform with another scale, the middle of the pairs where it was."""
    middle = (pairs.in_model @ transform[:3, :3].T + transform[:3, 3]).mean(axis=0)
    about = np.eye(4)
    about[:3, :3] *= factor
    about[:3, 3] = (1 - factor) * middle
    return np.asarray(about @ transform)


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
