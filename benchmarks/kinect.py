"""Four real RGB-D captures of three apple trees, the camera put down anew each time.

All six pairs, one side turned and moved at random: undisturbed, and with 30 % of that side's fruits dropped and 10 %
false points added, over 20 seeds. Then all four captures in one map: identities, splits, merges. Fruits come from depth
and boxes through `pomona import` and `pomona scan`. Writes kinect.csv and kinect.md.
"""

import argparse
import sqlite3
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable
from contextlib import closing
from itertools import combinations
from pathlib import Path

import numpy as np

import pomona
from benchmarks.disturb import dropped, moved, with_false_points
from benchmarks.results import markdown, share, shared_data, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.evaluate import PairScore, score_pairs

CAPTURES = ("114012", "115932", "121804", "123505")
DATE = "2021-09-27"
SEEDS = 20
METHODS = ("paper", "verified")
CONDITIONS = ("undisturbed", "30 % dropped, 10 % false")


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks kinect", description=__doc__)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--shipped", action="store_true", help="take the *_fruits.csv that came with the captures")
    options = parser.parse_args(arguments)
    data = shared_data("kinect")
    if data is None:
        return
    with tempfile.TemporaryDirectory() as scratch:
        clouds = shipped(data) if options.shipped else scanned(data, Path(scratch))
        rows = [
            row
            for method in options.methods
            for first, second in combinations(CAPTURES, 2)
            for row in match_pair(clouds[first], clouds[second], f"{first} {second}", method)
        ]
        identities = {method: map_all(clouds, Path(scratch), method) for method in options.methods}
    write_rows("kinect.csv", rows)
    write_text("kinect.md", report(rows, identities))


def shipped(data: Path) -> dict[str, FruitCloud]:
    return {name: FruitCloud.read(data / "kinect_apples" / f"{name}_fruits.csv") for name in CAPTURES}


def scanned(data: Path, scratch: Path) -> dict[str, FruitCloud]:
    """Depth pictures and boxes to fruits, by the command line."""
    _pomona("import", "kinect-apples", data / "kinect_apples", scratch / "recordings")
    clouds = {}
    for name in CAPTURES:
        session = scratch / f"{name}.gpkg"
        _pomona("scan", scratch / "recordings" / name, "-o", session)
        clouds[name] = FruitCloud.read(session)
    return clouds


def _pomona(*arguments: object) -> None:
    done = subprocess.run(
        [Path(sys.executable).with_name("pomona"), *map(str, arguments)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"pomona {' '.join(map(str, arguments))}: {done.stderr.strip()}")


def match_pair(query: FruitCloud, map_: FruitCloud, name: str, method: str) -> list[dict[str, object]]:
    """Match one pair of captures under both conditions."""

    def untouched(_rng: np.random.Generator) -> FruitCloud:
        return query

    def disturbed(rng: np.random.Generator) -> FruitCloud:
        return with_false_points(rng, dropped(rng, query, 0.30), round(0.10 * len(query)), "false")

    changes: tuple[Callable[[np.random.Generator], FruitCloud], ...] = (untouched, disturbed)
    rows = []
    for condition, change in zip(CONDITIONS, changes, strict=True):
        scores, verdicts = [], []
        for seed in range(SEEDS):
            rng = np.random.Generator(np.random.PCG64([seed, *map(int, name.split())]))
            seen, _ = moved(rng, change(rng))
            match = pomona.match(seen, map_, method=method, threads=1)
            scores.append(score_pairs(match.pairs.tolist(), seen.ids or (), map_.ids or ()))
            verdicts.append(str(match.status))
        rows.append({"method": method, "condition": condition, "pair": name, **_summary(scores, verdicts)})
    return rows


def _summary(scores: list[PairScore], verdicts: list[str]) -> dict[str, object]:
    """Mean over the seeds; a match without an answer has recall 0 and no precision."""
    precisions = [score.precision for score in scores if score.precision is not None]
    recalls = [score.recall for score in scores if score.recall is not None]
    return {
        "runs": len(scores),
        "found": verdicts.count("Found"),
        "precision": float(np.mean(precisions)) if precisions else None,
        "recall": float(np.mean(recalls)),
        "worst_precision": min(precisions, default=None),
        "worst_recall": min(recalls),
    }


def map_all(clouds: dict[str, FruitCloud], scratch: Path, method: str) -> dict[str, int]:
    """Add all captures to one map, each turned and moved at random; count what became of the identities."""
    orchard = scratch / f"orchard_{method}.gpkg"
    for number, name in enumerate(CAPTURES):
        cloud = clouds[name] if number == 0 else moved(np.random.Generator(np.random.PCG64(number)), clouds[name])[0]
        path = scratch / f"{method}_{name}.csv"
        cloud.write(path)
        _pomona("map", "add", orchard, path, "--date", f"{DATE}T{name[:2]}:{name[2:4]}", "--method", method)
    with closing(sqlite3.connect(orchard)) as connection:
        observations = connection.execute("SELECT label, fruit_id FROM observations").fetchall()
    return identity_counts(observations)


def identity_counts(observations: list[tuple[str, object]]) -> dict[str, int]:
    """Compare identities with the truth.

    A split is an identity too many for one fruit, a merge a fruit too many in one identity.
    """
    identities, fruits = defaultdict(set), defaultdict(set)
    for fruit, identity in observations:
        identities[fruit].add(identity)
        fruits[identity].add(fruit)
    return {
        "observations": len(observations),
        "fruits": len(identities),
        "identities": len(fruits),
        "splits": sum(len(given) - 1 for given in identities.values()),
        "merges": sum(len(named) - 1 for named in fruits.values()),
    }


def report(rows: list[dict[str, object]], identities: dict[str, dict[str, int]]) -> str:
    header = ("pair", "method", "condition", "found", "P", "R", "worst P", "worst R")
    lines = [
        (
            row["pair"],
            row["method"],
            row["condition"],
            f"{row['found']}/{row['runs']}",
            *(share(row[column]) for column in ("precision", "recall", "worst_precision", "worst_recall")),
        )
        for row in rows
    ]
    counts = [(method, *map(str, count.values())) for method, count in identities.items()]
    names = ("method", *next(iter(identities.values())))
    return (
        f"# Real captures, one day\n\n{' '.join((__doc__ or '').split())}\n\n{markdown(header, lines)}\n"
        f"## All four in one map\n\n{markdown(names, counts)}"
    )
