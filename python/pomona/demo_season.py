"""What the demo tells of the whole season: identities judged by the truth, growth, sizes at the harvest, the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.evaluate import PairScore, score_placed_pairs
from pomona.growth.season_growth import SeasonGrowth, grow_season
from pomona.orchard import OrchardMap
from pomona.truth import WITHIN_M, aligned, true_fruits
from pomona.viewer.season_page import Wishes
from pomona.viewer.season_report import write_report

__all__ = ["DemoSeason", "Told", "told_season"]

TO_HARVEST = timedelta(days=14)
"""From the last visit to the day that is foretold."""

LARGE_MM = 75.0
"""From this size on a fruit is of the class that is paid best; a limit of the usual classes."""

NINETY = (0.05, 0.95)


@dataclass(frozen=True)
class Told:
    """A forecast: its mean and 90 % interval."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, draws: NDArray[np.float64]) -> Told:
        """Sum up equally likely values."""
        return cls(float(draws.mean()), *np.quantile(draws, NINETY).tolist())


@dataclass(frozen=True, eq=False)
class DemoSeason:
    """The season of the demo's row.

    Attributes
    ----------
    identities : PairScore
        One fruit or two, over all pairs of visits, against the truth.
    n_hanging : int
        Fruits that hang on the last visit, for all that the map knows.
    mean_mm, rate_mm_per_day : float
        Of these on the last visit.
    harvest : date
    mean_then_mm, n_large_then : Told
        Mean size on that day, and how many fruits of `LARGE_MM` or more.
    report : Path
    """

    identities: PairScore
    n_hanging: int
    mean_mm: float
    rate_mm_per_day: float
    harvest: date
    mean_then_mm: Told
    n_large_then: Told
    report: Path


def told_season(orchard: Path, truths: Mapping[str, Path], report: Path) -> DemoSeason:
    """Judge the identities of a map, foretell its sizes and write its report.

    Parameters
    ----------
    orchard
        A map of two visits or more.
    truths
        The true fruits at each visit, by the name of its session, in order of time.
    report
        The HTML file.

    Raises
    ------
    PomonaError
        When a file cannot be read or written, or a visit is not where its truth is.
    """
    last = date.fromisoformat(OrchardMap(orchard).visits()[-1].date[:10])
    grown = grow_season(orchard, harvest=last + TO_HARVEST)
    write_report(orchard, report, Wishes(harvest=last + TO_HARVEST))
    now, then = len(grown.days) - 2, len(grown.days) - 1
    of_all = grown.foretold.summaries["blocks"][:, 0]
    return DemoSeason(
        identities=_judged(orchard, truths),
        n_hanging=grown.blocks[0].n_fruits,
        mean_mm=float(of_all[:, now].mean()),
        rate_mm_per_day=float(of_all[:, -1].mean()),
        harvest=last + TO_HARVEST,
        mean_then_mm=Told.of(of_all[:, then]),
        n_large_then=Told.of(_large(grown, then)),
        report=report,
    )


def _large(grown: SeasonGrowth, day: int) -> NDArray[np.float64]:
    """How many fruits are large on a day, draw by draw."""
    first = int(np.searchsorted(grown.limits_mm, LARGE_MM, side="right"))
    return np.asarray(grown.foretold.summaries["counts"][:, first:, day].sum(axis=1))


def _judged(orchard: Path, truths: Mapping[str, Path]) -> PairScore:
    """Compare who is who in the map with the true fruits at the places of its observations."""
    seen = OrchardMap(orchard).observations()
    sessions = np.array(seen.sessions)
    rows = [np.flatnonzero(sessions == name) for name in truths]
    placed = [_placed(seen.positions_in_map[of], path) for of, path in zip(rows, truths.values(), strict=True)]
    score = PairScore(0, 0, 0)
    for one, other in combinations(range(len(rows)), 2):
        pairs = _pairs(seen.fruit_ids[rows[one]], seen.fruit_ids[rows[other]])
        score += score_placed_pairs(pairs, placed[one], placed[other])
    return score


def _placed(positions_in_map: NDArray[np.float64], path: Path) -> Sequence[str]:
    true = FruitCloud.read(path)
    return true_fruits(aligned(FruitCloud(positions_in_map), true), true, within_m=WITHIN_M)


def _pairs(one: NDArray[np.int64], other: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Rows of the same identity on two visits."""
    _, rows, others = np.intersect1d(one, other, return_indices=True)
    return list(zip(rows.tolist(), others.tolist(), strict=True))
