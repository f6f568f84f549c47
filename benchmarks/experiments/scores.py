"""How right a match of two visits is, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import astuple, dataclass

import numpy as np

from benchmarks.experiments.visits import Visit


@dataclass(frozen=True)
class Score:
    """Counts of one match, or their means over several.

    Attributes
    ----------
    right : float
        Pairs that join the same fruit.
    to_another, to_none : float
        Pairs of two different fruits, and of a fruit with what is none of the row's.
    common : float
        Fruits that show clearly in enough frames of both videos.
    found : float
        Of these, those that were joined.
    not_detected, not_scanned : float
        Of these, those that one of the two detectors, or else one of the two scans, does not have.
    """

    right: float
    to_another: float
    to_none: float
    common: float
    found: float
    not_detected: float
    not_scanned: float

    @property
    def precision(self) -> float:
        """Share of the pairs that are right; 0 without any."""
        return _share(self.right, self.right + self.to_another + self.to_none)

    @property
    def recall(self) -> float:
        """Share of the common fruits that were joined."""
        return _share(self.found, self.common)

    @property
    def not_paired(self) -> float:
        """Common fruits that both scans have and the match did not join."""
        return self.common - self.found - self.not_detected - self.not_scanned


def score(query: Visit, map: Visit, pairs: Iterable[tuple[int, int]]) -> Score:
    """Judge pairs of rows. Of two that are both no fruit of the row nobody knows whether they are the same thing."""
    named = [(query.true_ids[row], map.true_ids[other]) for row, other in pairs]
    right = [first for first, second in named if first and first == second]
    common = query.countable & map.countable
    missed = common - set(right)
    seen = missed & query.detected & map.detected
    return Score(
        right=len(right),
        to_another=sum(first != second for first, second in named if first and second),
        to_none=sum(bool(first) != bool(second) for first, second in named),
        common=len(common),
        found=len(common & set(right)),
        not_detected=len(missed - seen),
        not_scanned=len(seen - (set(query.true_ids) & set(map.true_ids))),
    )


def mean(scores: list[Score]) -> Score:
    """Average each count."""
    return Score(*np.mean([astuple(one) for one in scores], axis=0).tolist())


def _share(part: float, whole: float) -> float:
    return part / whole if whole else 0.0
