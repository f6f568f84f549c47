"""The paper's tables: each video of a set matched with the baseline, by both methods, under three conditions."""

from __future__ import annotations

from pathlib import Path

import pomona
from benchmarks.experiments.scores import Score, mean, score
from benchmarks.experiments.sets import ExperimentSet, Line
from benchmarks.experiments.takes import Take
from benchmarks.experiments.videos import distance_m
from benchmarks.experiments.visits import Visit, visited
from benchmarks.experiments.worse import made_worse
from benchmarks.results import markdown
from pomona.matching import Method

CONDITIONS = ("true", "shipped", "hard")
"""True boxes; the detector that is inside; true boxes and clouds made worse until they are as hard as the paper's."""

SAID = {"true": "true boxes", "shipped": "own detections", "hard": "as hard as the paper's"}

METHODS: tuple[Method, ...] = ("paper", "verified")

HEADER = ("video", "fruits from", "in both", "printed", "paper's method", "verified", "aim", "reached")
ERRORS = (
    "video",
    "fruits from",
    "pairs",
    "of two fruits",
    "with no fruit",
    "missed",
    "by the detector",
    "by the scan",
    "by the match",
)


def table(experiment: ExperimentSet, folder: Path, runs: int) -> str:
    """Measure a whole set and lay it out in markdown: the paper's table, and where the errors come from."""
    scores = {
        (line, condition): measured(experiment.baseline, line.take, condition, folder, runs)
        for condition in CONDITIONS
        for line in experiment.lines
    }
    rows = [_row(line, condition, found) for (line, condition), found in scores.items()]
    errors = [_errors(line, condition, found["verified"]) for (line, condition), found in scores.items()]
    said = "Wrong pairs and missed fruits of the verified method:"
    return f"{markdown(HEADER, rows)}\n{said}\n\n{markdown(ERRORS, errors)}"


def measured(baseline: str, take: Take, condition: str, folder: Path, runs: int) -> dict[str, Score]:
    """Match a take with the baseline by each method, the mean of so many runs."""
    boxes = "true" if condition == "hard" else condition
    map_, query = visited(Take(baseline), boxes, folder), visited(take, boxes, folder)
    scores: dict[str, list[Score]] = {method: [] for method in METHODS}
    for run in range(runs):
        drawn_map, drawn_query = map_, query
        if condition == "hard":
            drawn_map = made_worse(map_, distance_m(baseline), (run, 0))
            drawn_query = made_worse(query, distance_m(take.video), (run, 1))
        for method in METHODS:
            scores[method].append(_matched(drawn_map, drawn_query, method, run))
    return {method: mean(found) for method, found in scores.items()}


def _matched(map_: Visit, query: Visit, method: Method, run: int) -> Score:
    """Match once; the paper's method frame by frame, and what RANSAC draws differs from run to run."""
    paper = method == "paper"
    config = {"paper": {"ransac": {"seed": run}}} if paper else None
    found = pomona.match(query.cloud, map_.cloud, method=method, per_frame=paper, config=config)
    return score(query, map_, found.pairs.tolist())


def _row(line: Line, condition: str, scores: dict[str, Score]) -> tuple[str, ...]:
    paper, verified = (scores[method] for method in METHODS)
    reached = verified.precision >= line.aim[0] and verified.recall >= line.aim[1]
    return (
        line.take.name,
        SAID[condition],
        f"{verified.common:.0f}",
        _shares(*line.printed),
        _shares(paper.precision, paper.recall),
        _shares(verified.precision, verified.recall),
        _shares(*line.aim),
        "yes" if reached else "no",
    )


def _errors(line: Line, condition: str, found: Score) -> tuple[str, ...]:
    counts = (
        found.right + found.to_another + found.to_none,
        found.to_another,
        found.to_none,
        found.common - found.found,
        found.not_detected,
        found.not_scanned,
        found.not_paired,
    )
    return (line.take.name, SAID[condition], *(f"{count:.1f}".removesuffix(".0") for count in counts))


def _shares(precision: float, recall: float) -> str:
    return f"{precision:.3f} / {recall:.3f}"
