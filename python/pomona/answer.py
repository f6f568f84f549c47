"""What a match says: verdict, registration and pairs."""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.amounts import amount
from pomona.cards import as_card

__all__ = ["Match", "Verdict", "told_by_core"]


class Verdict(StrEnum):
    """What a match says. All four are results; none is an error."""

    FOUND = "Found"
    TOO_FEW = "TooFew"
    AMBIGUOUS = "Ambiguous"
    NO_MATCH = "NoMatch"


@dataclass(frozen=True, eq=False, repr=False)
class Match:
    """Registration, pairs and verdict of one query; true where the query was found.

    Attributes
    ----------
    status
        The verdict.
    map_from_query
        (4, 4), the scale folded in; None where nothing was found.
    scale
        Length in the map over length in the query; None where nothing was found.
    log_odds
        Evidence against chance in nats; NaN where nothing was found.
    pairs
        (M, 2), row in the query and row in the map, one to one, sorted by query row.
    probabilities
        (M,), probability that the two are one fruit.
    distances_m
        (M,), how far the partner lies from where the fruit is expected, metres of the map. Rows bend and branches
        sag, so that is not where `map_from_query` puts it.
    support
        (M,), what speaks for the pair: votes (paper) or nats (verified).
    part_of_pairs
        (M,), which of `parts` each pair belongs to.
    parts
        (4, 4) each: `map_from_query`, and where the query is torn apart, because a camera lost its way, the poses of
        its other parts; empty where nothing was found. `pomona.laid_in_parts` lays a cloud so.
    alternatives
        (4, 4) each: other registrations as good as the first; empty unless ambiguous.
    noise_m
        Relative noise of the two visits per axis, metres; NaN where nothing was found.
    stages
        What happened: stage and count, in order.
    n_query, n_map
        Fruits in the two clouds.
    elapsed_s
        Wall time of the search, and of making the index where it was made for this query.
    """

    status: Verdict
    map_from_query: NDArray[np.float64] | None
    scale: float | None
    log_odds: float
    pairs: NDArray[np.int64]
    probabilities: NDArray[np.float64]
    distances_m: NDArray[np.float64]
    support: NDArray[np.float64]
    part_of_pairs: NDArray[np.int64]
    parts: tuple[NDArray[np.float64], ...]
    alternatives: tuple[NDArray[np.float64], ...]
    noise_m: float
    stages: tuple[tuple[str, float], ...]
    n_query: int
    n_map: int
    elapsed_s: float

    @property
    def n_parts(self) -> int:
        """Parts of the query that lie otherwise to one another in the map; `map_from_query` is the pose of the first.

        More than one where a row is torn apart, because a camera lost its way, or a map whose own parts know nothing of
        each other; 0 where nothing was found.
        """
        return len(self.parts)

    def __bool__(self) -> bool:
        return self.status is Verdict.FOUND

    def __repr__(self) -> str:
        if not self:
            return f"Match({self.status}: {amount(self.n_query, 'fruit')}, {self.n_map} in the map)"
        found = f"{len(self.pairs)} of {amount(self.n_query, 'fruit')} again among {self.n_map}"
        return f"Match({self.status}: {found}, log-odds {self.log_odds:.0f})"

    def _repr_html_(self) -> str:
        facts: dict[str, object] = {"fruits": f"{self.n_query} in the query, {self.n_map} in the map"}
        if self:
            middle_cm = f", {100 * np.median(self.distances_m):.1f} cm apart (median)" if len(self.pairs) else ""
            facts |= {"found again": f"{len(self.pairs)}{middle_cm}", "log-odds": f"{self.log_odds:.0f}"}
            facts |= {"scale": f"{self.scale:.4g}", "noise": f"{100 * self.noise_m:.1f} cm per axis"}
        return as_card(self.status, {**facts, "time": f"{self.elapsed_s:.3f} s"})


def told_by_core(found: _core.Match, n_query: int, n_map: int, start: float) -> Match:
    """Take the core's answer to a question that was asked at `start`, by `time.perf_counter`."""
    pose = found.map_from_query
    return Match(
        status=Verdict(found.status),
        map_from_query=pose,
        scale=found.scale,
        log_odds=float("nan") if found.log_odds is None else found.log_odds,
        pairs=found.pairs,
        probabilities=found.probabilities,
        distances_m=found.distances_m,
        support=found.support,
        part_of_pairs=found.part_of_pairs,
        parts=() if pose is None else (pose, *map(np.array, found.further)),
        alternatives=tuple(np.array(matrix) for matrix, _ in found.alternatives),
        noise_m=found.noise_m,
        stages=tuple(found.stages),
        n_query=n_query,
        n_map=n_map,
        elapsed_s=time.perf_counter() - start,
    )
