"""In how many frames a visit sees what no visit saw before: fruits, fruits that hid at first, and false points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.identity.looks import SHARES_OF_VIEWS

__all__ = ["N_BINS", "N_SETTINGS", "UNCOUNTED", "ViewDensities"]

EDGES = np.concatenate([[0.0], SHARES_OF_VIEWS, [1.0]])
WIDTHS, MIDDLES = np.diff(EDGES), 0.5 * (EDGES[:-1] + EDGES[1:])
"""Of the bins of ranks: the classes by which a first look tells of the next."""

UNCOUNTED = -1
"""Bin of a sight of which nobody counted the frames: it says nothing."""

LATENESS, LATENESS_SPREAD = 3.0, 3.0
"""By how much fruits that were missed at first are seen worse than others: the rate of their first sights in ranks."""

FRUITS_STEP, FALSE_STEP = 0.5, 1.0
"""By how much the logarithm of a density differs from one bin to the next. Ranks are of all points of a visit, so they
are nearly even among its fruits. False points may be seen in few frames, in many or in as many as fruits."""

N_BINS = len(WIDTHS)
N_STEPS = N_BINS - 1
N_SETTINGS = 1 + 2 * N_STEPS
"""Lateness, and the steps of either density; each is 0 beforehand, give or take 1."""


@dataclass(frozen=True, eq=False)
class ViewDensities:
    """Densities of the ranks of first sights, against ranks that are spread evenly; B bins.

    Attributes
    ----------
    logs : (3, B + 1) float64
        Logarithms: of fruits that a first look saw, of those that looks had missed, of false points. The last column,
        0, is that of `UNCOUNTED`.
    """

    logs: NDArray[np.float64]

    @classmethod
    def of(cls, settings: NDArray[np.float64]) -> ViewDensities:
        """Return what the settings, (N_SETTINGS,), say."""
        lateness = LATENESS + LATENESS_SPREAD * settings[0]
        fruits, false = np.cumsum(_padded(settings[1:]) * [[FRUITS_STEP], [FALSE_STEP]], axis=1)
        logs = np.stack([fruits, fruits - lateness * MIDDLES, false])
        logs -= np.log(np.exp(logs) @ WIDTHS)[:, None]
        return cls(np.concatenate([logs, np.zeros((3, 1))], axis=1))

    def slopes(self, counts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return by how much the settings, (N_SETTINGS,), raise the sum of the logarithms of so many sights, (3, B)."""
        surplus = counts - counts.sum(axis=1, keepdims=True) * np.exp(self.logs[:, :-1]) * WIDTHS
        steps = np.stack([FRUITS_STEP * (surplus[0] + surplus[1]), FALSE_STEP * surplus[2]])
        # A step moves all bins behind it.
        behind = np.cumsum(steps[:, ::-1], axis=1)[:, ::-1][:, 1:]
        return np.concatenate([[-LATENESS_SPREAD * surplus[1] @ MIDDLES], behind.ravel()])

    def room(self, counts: NDArray[np.float64], doubts: NDArray[np.float64]) -> float:
        r"""Return by how many nats the best density of false points stands above what all that are believed reach.

        Half the logarithm of the determinant of the curvature there against that of the belief (Laplace). The more
        points are taken for false, the more of chance the best density fits.

        Parameters
        ----------
        counts : (B,) float64
            Points taken for false in each bin: the sum of their probabilities $p$.
        doubts : (B,) float64
            The same of $p (1 - p)$.
        """
        share = np.exp(self.logs[2, :-1]) * WIDTHS
        curvature = np.diag(counts.sum() * share - doubts) - (counts + doubts).sum() * np.outer(share, share)
        curvature += np.outer(doubts, share) + np.outer(share, doubts)
        steps = FALSE_STEP * np.tril(np.ones((N_BINS, N_BINS)))[:, 1:]
        curved = np.linalg.eigvalsh(steps.T @ curvature @ steps)
        return float(0.5 * np.log1p(np.maximum(curved, 0.0)).sum())


def _padded(steps: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([np.zeros((2, 1)), steps.reshape(2, N_STEPS)], axis=1)
