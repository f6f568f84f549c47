"""How the life of each fruit ends: it drops, is thinned or picked, or hangs on; drawn once, for the whole season."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.design import RowDesign

__all__ = ["ALIVE", "DROPPED", "PICKED", "STATES", "THINNED", "FruitLives", "draw_lives"]

STATES = ("alive", "dropped", "thinned", "picked")
ALIVE, DROPPED, THINNED, PICKED = range(4)

_JUNE_DROP_DAYS = (35.0, 56.0)
"""After bloom."""


@dataclass(frozen=True, eq=False)
class FruitLives:
    """When fruits go, and how.

    Attributes
    ----------
    ends_days : (F,)
        Days after bloom; infinite for those that hang on.
    causes : (F,) int64
        State from then on, a number of `STATES`.
    """

    ends_days: NDArray[np.float64]
    causes: NDArray[np.int64]

    def states(self, days: float) -> NDArray[np.int64]:
        """State of each fruit, (F,), on a day; on the day it goes it is gone."""
        return np.where(self.ends_days <= days, self.causes, ALIVE)


def draw_lives(
    rng: np.random.Generator, design: RowDesign, clusters: NDArray[np.int64], sizes: NDArray[np.float64]
) -> FruitLives:
    """Draw the lives of fruits of clusters, (F,) both; the biggest are the ripest."""
    n = len(clusters)
    ends, causes = np.full(n, np.inf), np.full(n, ALIVE)
    harvest = design.apple.harvest_after_bloom_days
    late = (_JUNE_DROP_DAYS[1], max(harvest, _JUNE_DROP_DAYS[1] + 1.0))
    for share, between in ((design.june_drop_share, _JUNE_DROP_DAYS), (design.late_drop_share, late)):
        drops = (rng.random(n) < share) & np.isinf(ends)
        ends[drops], causes[drops] = rng.uniform(*between, n)[drops], DROPPED
    _thin(rng, design, clusters, ends, causes)
    for day, share in sorted(design.pickings):
        hanging = np.flatnonzero(ends > day)
        ripest = hanging[np.argsort(-sizes[hanging], kind="stable")][: round(share * len(hanging))]
        ends[ripest], causes[ripest] = day, PICKED
    return FruitLives(ends, causes)


def _thin(
    rng: np.random.Generator,
    design: RowDesign,
    clusters: NDArray[np.int64],
    ends: NDArray[np.float64],
    causes: NDArray[np.int64],
) -> None:
    """Take a share of all fruits that hang, out of their clusters, of which each keeps one."""
    day = design.thinned_after_bloom_days
    hanging = np.flatnonzero(ends > day)
    if len(hanging) == 0:
        return
    order = rng.permutation(hanging)
    _, keepers = np.unique(clusters[order], return_index=True)
    spare = np.delete(order, keepers)[: round(design.thinned_share * len(hanging))]
    ends[spare], causes[spare] = day, THINNED
