"""Which loops are believed: those that drift can explain.

With one loop more, the least sum of squared errors of a graph grows by the squared distance of that loop from where the
graph has it, by the covariances of both: chi-square with six degrees where the loop is true. So each is tried, the ones
with the most fruits first, and one that is refused leaves no trace.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.survey.refinement import Motions, Refined, SeenFruits, refine
from pomona.survey.slam.constellation_links import motions_of
from pomona.survey.slam.loops import Loop

__all__ = ["BELIEVED2", "NO_FRUITS", "explained", "explains", "squared_distances"]

Array = NDArray[np.float64]

BELIEVED2 = 22.5
"""Squared distance up to which a link or a loop is believed: one of a thousand true ones is farther off."""

CAUCHY2 = 6.0
"""Squared distance from which on Cauchy's loss lets a motion go, as the core's adjustment has it."""

NO_FRUITS = SeenFruits(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


def explains(poses: NDArray[np.float64], loop: Loop) -> bool:
    """Say whether poses lie as a loop has them, by what it does not know alone."""
    here = np.linalg.inv(poses[loop.first]) @ poses[loop.second]
    spread = np.asarray(np.linalg.inv(loop.information), np.float64)
    return bool(squared_distances(loop.first_from_second[None], here[None], spread[None])[0] <= BELIEVED2)


def squared_distances(poses: Array, others: Array, spreads: Array) -> Array:
    """Measure how far other poses lie from some, (N, 4, 4) both, by the covariances of the steps between them."""
    from scipy.spatial.transform import Rotation

    left = np.linalg.inv(poses) @ others
    errors = np.concatenate([left[:, :3, 3], Rotation.from_matrix(left[:, :3, :3]).as_rotvec()], axis=1)
    return np.asarray(np.einsum("ni,ni->n", errors, np.linalg.solve(spreads, errors[..., None])[..., 0]), np.float64)


def explained(poses: NDArray[np.float64], motions: Motions, found: Sequence[Loop]) -> tuple[list[int], Refined]:
    """Say which loops are believed, and adjust the poses to them.

    Parameters
    ----------
    poses : (F, 4, 4) float64
        To begin with.
    motions : Motions
        What is known.
    found : sequence of Loop
        What may be wrong.

    Returns
    -------
    rows : list of int
        Of the loops that are believed, ascending.
    adjusted : Refined
    """
    believed: list[int] = []
    now = refine(poses, NO_FRUITS, motions)
    for row in sorted(range(len(found)), key=lambda row: (-len(found[row].pairs), row)):
        closed = motions.and_those(motions_of([found[row]]).trusted())
        then = refine(now.session_from_camera, NO_FRUITS, closed)
        if _cost(then, closed) - _cost(now, motions) <= BELIEVED2:
            motions, now = closed, then
            believed.append(row)
    return sorted(believed), now


def _cost(adjusted: Refined, motions: Motions) -> float:
    """Give what was minimised: of a motion that may be wrong a larger error costs hardly more."""
    errors2, doubtful = adjusted.motion_squared_errors, motions.which_are_doubtful()
    return float(errors2[~doubtful].sum() + CAUCHY2 * np.log1p(errors2[doubtful] / CAUCHY2).sum())
