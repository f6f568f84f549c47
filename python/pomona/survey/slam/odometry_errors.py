"""How far told motions are off, learnt from frames that found each other.

What odometry claims of its errors is a claim. Links of the same frames measure the same motions; where they contradict
it much better than chance could, it is mended: by what errs steadily, a scale of all ways (wheels of another size than
was thought) or the same error in every motion (a gyroscope's bias), and by a factor of the covariances. With C for the
covariance that is claimed of a way, or a turn, L for the link's, f for the factor and r for what is left between them
past the steady error, each has the density of Student's t

    -ln p = 1/2 ln |f C + L| + (n + 3) / 2 ln(1 + r^T (f C + L)^-1 r / n) ,

in which a slip, or a false link, costs little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.survey.refinement import Motions
from pomona.survey.slam.constellation_links import ConstellationLink

__all__ = ["OdometryErrors", "learnt_errors"]

Array = NDArray[np.float64]

FACTORS = 4.0 ** np.arange(8)
"""Of covariances: errors are up to 128 times what is claimed; beyond that a motion says nothing beside a link."""

FREEDOM = 4.0
"""Degrees of freedom of Student's t, n: the fewer, the less what is far off counts."""

UNUSUAL_NATS = 6.9
"""Evidence that it takes to mend a claim in one respect: chance has as much once in a thousand drives."""

OFFSET_NATS = 8.1
"""The same of an offset, which has three numbers that chance could fit."""

ROUNDS = 5
"""Of fitting what errs steadily, under weights that depend on it."""

LAST = 300
"""Links that are asked: wheels wear, and a drive may be long."""


@dataclass(frozen=True)
class VectorErrors:
    """How ways, or turns, err.

    Attributes
    ----------
    scale : float
        What is true over what is told.
    offset : tuple of 3 float
        What is added in every motion, as the second camera sees it, metres or radians.
    factor : float
        Of the covariance that is claimed.
    """

    scale: float = 1.0
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    factor: float = 1.0


@dataclass(frozen=True)
class OdometryErrors:
    """What is learnt of told motions."""

    way: VectorErrors = VectorErrors()
    turn: VectorErrors = VectorErrors()

    def mended(self, motions: Motions) -> Motions:
        """Give motions that may be wrong as they are believed now; those that are trusted stay."""
        rows = np.flatnonzero(motions.which_are_doubtful())
        if not len(rows) or self == OdometryErrors():
            return motions
        poses, information = motions.first_from_second.copy(), motions.information.copy()
        poses[rows, :3, :3] = _turned(self.turn.scale * _turns(poses[rows]) + self.turn.offset)
        poses[rows, :3, 3] = self.way.scale * poses[rows, :3, 3] + poses[rows, :3, :3] @ self.way.offset
        sigmas = np.repeat(np.sqrt([self.way.factor, self.turn.factor]), 3)
        information[rows] /= sigmas[:, None] * sigmas
        return Motions(motions.first, motions.second, poses, information, motions.doubtful)


def learnt_errors(motions: Motions, links: Sequence[ConstellationLink]) -> OdometryErrors:
    """Compare motions that may be wrong with the links of the same frames."""
    doubtful = np.flatnonzero(motions.which_are_doubtful()).tolist()
    row_of = {(int(motions.first[row]), int(motions.second[row])): row for row in doubtful}
    both = [(row_of[pair], link) for link in links if (pair := (link.first, link.second)) in row_of][-LAST:]
    if not both:
        return OdometryErrors()
    rows = np.array([row for row, _ in both])
    told, seen = motions.first_from_second[rows], np.array([link.first_from_second for _, link in both])
    # As the second camera sees them: so are the covariances.
    back = np.swapaxes(seen[:, :3, :3], 1, 2)
    told_ways, seen_ways = ((back @ poses[:, :3, 3:])[..., 0] for poses in (told, seen))
    claimed, linked = (
        np.asarray(np.linalg.inv(one), np.float64)
        for one in (motions.information[rows], [link.information for _, link in both])
    )
    return OdometryErrors(
        _fitted(told_ways, seen_ways, claimed[:, :3, :3], linked[:, :3, :3]),
        _fitted(_turns(told), _turns(seen), claimed[:, 3:, 3:], linked[:, 3:, 3:]),
    )


def _fitted(told: Array, seen: Array, claimed: Array, linked: Array) -> VectorErrors:
    """Choose what is likeliest; what is mended has to explain much more than the claim as it is."""
    spreads = FACTORS[:, None, None, None] * claimed + linked
    known: Array = np.asarray(np.linalg.inv(spreads), np.float64)
    volumes = np.linalg.slogdet(spreads)[1].sum(axis=1)
    steady = {
        "right": (np.zeros((len(told), 3, 0)), 0.0),
        "scale": (told[:, :, None], UNUSUAL_NATS),
        "offset": (np.tile(np.eye(3), (len(told), 1, 1)), OFFSET_NATS),
    }
    fits = []
    for name, (slopes, nats) in steady.items():
        numbers = _steady_errors(slopes, seen - told, known)
        squared = _squared(slopes, seen - told, numbers, known)
        unlikely = 0.5 * volumes + 0.5 * (FREEDOM + 3) * np.log1p(squared / FREEDOM).sum(axis=1)
        best = int(np.argmin(unlikely + UNUSUAL_NATS * (FACTORS > 1)))
        fits.append((unlikely[best] + UNUSUAL_NATS * (best > 0) + nats, name, numbers[best], float(FACTORS[best])))
    _, name, numbers, factor = min(fits, key=lambda one: one[0])
    return VectorErrors(
        1.0 + float(numbers[0]) if name == "scale" else 1.0,
        tuple(numbers.tolist()) if name == "offset" else (0.0, 0.0, 0.0),
        factor,
    )


def _steady_errors(slopes: Array, errors: Array, known: Array) -> Array:
    """Fit errors by `slopes` (N, 3, P) times P numbers, (F, P) under each factor, by reweighted least squares."""
    numbers = np.zeros((len(known), slopes.shape[2]))
    along = np.einsum("nip,fnij,njq->fnpq", slopes, known, slopes, optimize=True)
    across = np.einsum("nip,fnij,nj->fnp", slopes, known, errors, optimize=True)
    for _ in range(ROUNDS):
        weights = 1.0 / (FREEDOM + _squared(slopes, errors, numbers, known))
        # The pseudo-inverse: where nothing moves there is nothing to scale.
        inverse = np.linalg.pinv(np.einsum("fn,fnpq->fpq", weights, along), hermitian=True)
        numbers = np.einsum("fpq,fn,fnq->fp", inverse, weights, across)
    return numbers


def _squared(slopes: Array, errors: Array, numbers: Array, known: Array) -> Array:
    """Squared Mahalanobis distance of each motion from its link, (F, N)."""
    left = errors - np.einsum("nip,fp->fni", slopes, numbers)
    return np.asarray(np.einsum("fni,fnij,fnj->fn", left, known, left, optimize=True))


def _turned(vectors: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def _turns(poses: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(poses[:, :3, :3]).as_rotvec())
