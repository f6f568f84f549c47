"""Every test cell with every method, beside the oracle.

Writes cells_METHOD.csv (one row a pair of visits), reliability_METHOD.csv, cells.md and reliability.png. A run replaces
the rows of the methods, cells and noise settings that it ran and keeps the others.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

import pomona
from benchmarks import cells_report
from benchmarks.oracle import gated_pairs, oracle_pairs
from benchmarks.pose import pose_error
from benchmarks.results import read_rows, write_rows
from pomona.evaluate import score_pairs
from pomona.synth.clouds import CELLS, ScenePair, scene_pair

METHODS = ("paper", "verified")
PROBABILITY_BINS = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0)
SURE = 0.9
RUNS = {"noov": 1000, "noovsim3": 300, "big5k": 20, "frame40-trees1000": 20}
"""Pairs of visits of the committed tables, 100 for other cells; 20 of each for the paper's method."""
MOST_TREES_ON_PAPER = 100
"""Trees of a map beyond which the paper's method is left out: it would take hours."""


@dataclass(frozen=True)
class Job:
    """One pair of visits to match."""

    method: str
    cell: str
    noise: str
    seed: int


def main(arguments: list[str]) -> None:
    options = _options(arguments)
    for method in options.methods:
        jobs = [
            Job(method, cell, noise, seed)
            for cell in options.cells
            for noise in options.noise
            for seed in range(*(options.seeds or (0, usual_runs(method, cell))))
        ]
        rows, bins = [], []
        for done, (row, counts) in enumerate(_answers(jobs, options.processes), 1):
            rows.append(row)
            bins.extend(counts)
            if done % 20 == 0 or done == len(jobs):
                sys.stderr.write(f"{method}: {done} of {len(jobs)} pairs, at {row['cell']}\n")
        _keep_others(f"cells_{method}.csv", rows, ("cell", "noise"))
        _keep_others(f"reliability_{method}.csv", _summed(bins), ("cell", "noise"))
    cells_report.write(METHODS)


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks cells", description=__doc__)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--cells", nargs="+", choices=CELLS, default=list(CELLS), metavar="CELL")
    parser.add_argument("--seeds", type=_seed_range, metavar="FIRST:END", help="default: as in the committed tables")
    parser.add_argument("--noise", nargs="+", choices=("given", "estimated"), default=["estimated"])
    parser.add_argument("--processes", type=int, default=1, help="more than the cores spoil the times")
    return parser.parse_args(arguments)


def usual_runs(method: str, cell: str) -> int:
    if method == "paper":
        return 20 if CELLS[cell].seen <= MOST_TREES_ON_PAPER else 0
    return RUNS.get(cell, 100)


def _seed_range(text: str) -> tuple[int, int]:
    first, _, end = text.partition(":")
    return int(first), int(end)


def _answers(jobs: list[Job], processes: int) -> Iterator[tuple[dict[str, object], list[dict[str, object]]]]:
    if processes == 1:
        yield from map(answer, jobs)
        return
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(answer, jobs)


def answer(job: Job) -> tuple[dict[str, object], list[dict[str, object]]]:
    """Match one pair of visits: its row, and its pairs counted by probability."""
    pair = scene_pair(job.cell, job.seed)
    start_s = time.process_time()
    match = pomona.match(
        pair.query,
        pair.map,
        scale=pair.cell.scale,
        method=job.method,
        noise_m=pair.noise_m if job.noise == "given" else None,
        up=pair.up,
        threads=1,
    )
    cpu_s = time.process_time() - start_s
    found = match.status == "Found"
    score = score_pairs(match.pairs.tolist() if found else [], pair.query.ids or (), pair.map.ids or ())
    sure = match.pairs[match.probabilities >= SURE].tolist() if found else []
    sure_score = score_pairs(sure, pair.query.ids or (), pair.map.ids or ())
    oracle, gated = (
        score_pairs(ceiling(pair).tolist() if pair.cell.has_answer else [], pair.query.ids or (), pair.map.ids or ())
        for ceiling in (oracle_pairs, gated_pairs)
    )
    error = pose_error(match.map_from_query, pair.map_from_query, pair.query.positions) if found else None
    row: dict[str, object] = {
        "cell": job.cell,
        "noise": job.noise,
        "seed": job.seed,
        "verdict": str(match.status),
        "outcome": outcome(pair, str(match.status), right_pose=error is not None and error.success),
        "rotation_deg": error and error.rotation_deg,
        "translation_m": error and error.translation_m,
        "scale_error": error and error.scale,
        "log_odds": match.log_odds,
        "noise_m": match.noise_m,
        "true": score.true,
        "false": score.false,
        "missed": score.missed,
        "sure_true": sure_score.true,
        "sure_false": sure_score.false,
        "oracle_true": oracle.true,
        "oracle_false": oracle.false,
        "gated_true": gated.true,
        "gated_false": gated.false,
        "cpu_s": cpu_s,
    }
    counts = _by_probability(job, pair, match.pairs, match.probabilities) if found else []
    return row, counts


def outcome(pair: ScenePair, verdict: str, *, right_pose: bool) -> str:
    """`right`: a verdict the cell allows, and with `Found` the right pose; `wrong`: a false pose; else `none`."""
    if verdict == "Found":
        return "right" if right_pose and pair.cell.has_answer else "wrong"
    return "right" if verdict in pair.cell.right_answers else "none"


def _by_probability(job: Job, pair: ScenePair, pairs: np.ndarray, probabilities: np.ndarray) -> list[dict[str, object]]:
    query_ids, map_ids = np.array(pair.query.ids), np.array(pair.map.ids)
    right = query_ids[pairs[:, 0]] == map_ids[pairs[:, 1]]
    bins = np.clip(np.searchsorted(PROBABILITY_BINS, probabilities, side="right") - 1, 0, len(PROBABILITY_BINS) - 2)
    return [
        {
            "cell": job.cell,
            "noise": job.noise,
            "from": PROBABILITY_BINS[number],
            "to": PROBABILITY_BINS[number + 1],
            "pairs": int((bins == number).sum()),
            "right": int(right[bins == number].sum()),
            "probability_sum": float(probabilities[bins == number].sum()),
        }
        for number in np.unique(bins)
    ]


def _summed(counts: list[dict[str, object]]) -> list[dict[str, object]]:
    total: dict[tuple[object, ...], dict[str, object]] = {}
    for row in counts:
        key = (row["cell"], row["noise"], row["from"])
        if key in total:
            for column in ("pairs", "right", "probability_sum"):
                total[key][column] += row[column]  # type: ignore[operator]
        else:
            total[key] = dict(row)
    return list(total.values())


def _keep_others(name: str, rows: list[dict[str, object]], key: tuple[str, ...]) -> None:
    """Replace the stored rows of the same cells and noise settings."""
    fresh = {tuple(str(row[column]) for column in key) for row in rows}
    kept = [row for row in read_rows(name) if tuple(row[column] for column in key) not in fresh]
    order = {cell: number for number, cell in enumerate(CELLS)}
    merged = sorted([*kept, *rows], key=lambda row: (order.get(str(row["cell"]), len(order)), str(row["noise"])))
    if merged:
        write_rows(name, merged)
