"""What the identities follow from: what each visit saw, and how every two visits match."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["SeenVisit", "Sights", "VisitPair", "all_sights"]


@dataclass(frozen=True, eq=False)
class SeenVisit:
    """What one visit saw, in its own frame.

    Attributes
    ----------
    key : tuple of str
        Date and content hash: the order of the visits, whatever their order in the map.
    day : float
        Days, from any beginning.
    positions : (N, 3) float64
        Metres.
    diameters_m : (N,) float64
        NaN where unknown.
    covariances : (N, 3, 3) float64, optional
        Square metres.
    n_views : (N,) int64, optional
        Frames that saw each fruit.
    cameras : (F, 4, 4) float64, optional
        `session_from_camera` of its frames.
    """

    key: tuple[str, str]
    day: float
    positions: NDArray[np.float64]
    diameters_m: NDArray[np.float64]
    covariances: NDArray[np.float64] | None = None
    n_views: NDArray[np.int64] | None = None
    cameras: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.positions)


@dataclass(frozen=True, eq=False)
class VisitPair:
    """How two visits match, found from the two alone.

    Attributes
    ----------
    first, second : int
        Numbers of the visits, the earlier one first.
    first_from_second : (4, 4) float64
        Similarity.
    log_odds : float
        Evidence for it in nats.
    rows : (M, 2) int64
        Row of the first visit and row of the second, one to one.
    probabilities : (M,) float64
        That the two are one fruit.
    """

    first: int
    second: int
    first_from_second: NDArray[np.float64]
    log_odds: float
    rows: NDArray[np.int64]
    probabilities: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sights:
    """The sights of all visits, one after the other: (S,) rows.

    Attributes
    ----------
    visits : (S,) int64
        Number of the visit.
    starts : (V,) int64
        First sight of each visit.
    log_sizes : (S,) float64
        Logarithm of the diameter, NaN where unknown.
    days : (V,) float64
        Of each visit.
    """

    visits: NDArray[np.int64]
    starts: NDArray[np.int64]
    log_sizes: NDArray[np.float64]
    days: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.visits)

    def rows_of(self, visits: slice) -> slice:
        """Return the rows of some visits that follow each other."""
        ends = [*self.starts.tolist(), len(self)]
        return slice(ends[visits.start], ends[visits.stop])

    def of(self, visits: slice) -> Sights:
        """Return the sights of some visits that follow each other, numbered from the first of these."""
        rows = self.rows_of(visits)
        return Sights(
            visits=self.visits[rows] - visits.start,
            starts=self.starts[visits] - rows.start,
            log_sizes=self.log_sizes[rows],
            days=self.days[visits],
        )


def all_sights(visits: Sequence[SeenVisit]) -> Sights:
    """Lay the sights of all visits in one row."""
    counts = np.array([len(visit) for visit in visits], np.int64)
    diameters_m = np.concatenate([visit.diameters_m for visit in visits])
    return Sights(
        visits=np.repeat(np.arange(len(visits)), counts),
        starts=np.cumsum(counts) - counts,
        log_sizes=np.log(diameters_m),
        days=np.array([visit.day for visit in visits], np.float64),
    )
