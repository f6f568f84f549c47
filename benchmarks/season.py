"""Twelve tagged apples of one tree over ten dates, 20 July to 12 October: all 45 pairs of dates.

There is no depth: a fruit lies at f * diameter / box, its diameter from the calipers, interpolated to the date, its box
the mean of width and height. The same without depth, the
fruits in the plane of the tennis balls; and unrelated clouds of twelve fruits in the same box. A registration is wrong
when fewer than half of its pairs are right. R counts no answer as nothing found. Writes season.csv and season.md.
"""

import argparse
import csv
import sys
from collections import defaultdict
from dataclasses import dataclass
from datetime import date
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import pomona
from benchmarks.disturb import hidden, moved, with_false_points
from benchmarks.results import markdown, share, shared_data, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.evaluate import score_pairs

FOCAL_PX = 1380.0
CENTRE_PX = np.array([959.5, 539.5])
BALL_MM = 65.46
METHODS = ("paper", "verified")
UNRELATED = 1000


@dataclass(frozen=True)
class Condition:
    """How much of the twelve is hidden on each side, how many false points each side gets, how often it is drawn."""

    hidden: float
    false_points: int
    seeds: int


CONDITIONS = (Condition(0.0, 0, 1), Condition(0.20, 1, 10), Condition(0.35, 2, 10))


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks season", description=__doc__)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--tree", default="tree1", help="prefix of the files in season_apples")
    options = parser.parse_args(arguments)
    data = shared_data("season")
    if data is None:
        return
    folder = data / "season_apples"
    views = {
        "lifted": read_dates(folder, options.tree, flat=False),
        "in the plane of the balls": read_dates(folder, options.tree, flat=True),
    }
    rows = []
    for method in options.methods:
        for view, clouds in views.items():
            rows.extend(all_pairs(clouds, condition, method, view) for condition in CONDITIONS)
            sys.stderr.write(f"season: {method}, {view} done\n")
        rows.append(unrelated(views["lifted"], method))
    write_rows("season.csv", rows)
    write_text("season.md", report(rows))


def read_dates(folder: Path, tree: str, *, flat: bool) -> dict[str, FruitCloud]:
    """Read the tagged apples of each date, camera frame, metres."""
    calipers = read_calipers(folder / f"{tree}_calipers_mm.csv")
    boxes: dict[str, dict[str, NDArray[np.float64]]] = defaultdict(dict)
    balls_px: dict[str, list[float]] = defaultdict(list)
    with (folder / f"{tree}_boxes.csv").open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            box = np.array([float(line[column]) for column in ("xmin", "ymin", "xmax", "ymax")])
            # A star marks an id that the source left empty and that was filled in from the place.
            name = line["id"].rstrip("*")
            if name == "TB":
                balls_px[line["date"]].append(_size_px(box))
            else:
                boxes[line["date"]][name] = box
    clouds = {}
    for day, named in boxes.items():
        ball_depth_m = FOCAL_PX * BALL_MM / 1e3 / float(np.median(balls_px[day]))
        positions = [
            lift(box, ball_depth_m if flat else FOCAL_PX * diameter_mm(calipers[name], day) / 1e3 / _size_px(box))
            for name, box in named.items()
        ]
        clouds[day] = FruitCloud(np.array(positions), ids=tuple(named))
    return clouds


def lift(box: NDArray[np.float64], depth_m: float) -> NDArray[np.float64]:
    """Return the (3,) point on the ray through the box's middle."""
    middle = (box[:2] + box[2:]) / 2
    return np.append((middle - CENTRE_PX) / FOCAL_PX, 1.0) * depth_m


def _size_px(box: NDArray[np.float64]) -> float:
    return float(np.mean(box[2:] - box[:2]))


def read_calipers(path: Path) -> dict[str, dict[int, float]]:
    """Diameters in mm by apple and day."""
    with path.open(encoding="utf-8", newline="") as file:
        return {
            line.pop("id"): {_ordinal(day): float(cell) for day, cell in line.items() if cell}
            for line in csv.DictReader(file)
        }


def diameter_mm(series: dict[int, float], day: str) -> float:
    """Linear between the days that were measured."""
    days = sorted(series)
    return float(np.interp(_ordinal(day), days, [series[at] for at in days]))


def _ordinal(day: str) -> int:
    return date.fromisoformat(day).toordinal()


def all_pairs(clouds: dict[str, FruitCloud], condition: Condition, method: str, view: str) -> dict[str, object]:
    """Match every pair of dates under one condition."""
    precisions, recalls = [], []
    runs = found = wrong = 0
    for first, second in combinations(sorted(clouds), 2):
        for seed in range(condition.seeds):
            rng = np.random.Generator(np.random.PCG64([seed, _ordinal(first), _ordinal(second)]))
            query, map_ = (
                with_false_points(rng, hidden(rng, clouds[day], condition.hidden), condition.false_points, side)
                for side, day in (("q", first), ("m", second))
            )
            query, _ = moved(rng, query)
            match = pomona.match(query, map_, method=method, threads=1)
            score = score_pairs(
                match.pairs.tolist() if match.status == "Found" else [], query.ids or (), map_.ids or ()
            )
            runs += 1
            recalls.append(score.recall or 0.0)
            if match.status == "Found":
                found += 1
                precisions.append(score.precision or 0.0)
                wrong += 2 * score.true < score.true + score.false
    return {
        "method": method,
        "view": view,
        "hidden": condition.hidden,
        "false_points": condition.false_points,
        "runs": runs,
        "found": found,
        "wrong": wrong,
        "precision": float(np.mean(precisions)) if precisions else None,
        "recall": float(np.mean(recalls)),
    }


def unrelated(clouds: dict[str, FruitCloud], method: str) -> dict[str, object]:
    """Match uniform clouds of twelve in the apples' box with the dates in turn: every answer is false."""
    days = sorted(clouds)
    everything = np.concatenate([cloud.positions for cloud in clouds.values()])
    found = 0
    for seed in range(UNRELATED):
        rng = np.random.Generator(np.random.PCG64(seed))
        cloud = FruitCloud(rng.uniform(everything.min(axis=0), everything.max(axis=0), (12, 3)))
        found += pomona.match(cloud, clouds[days[seed % len(days)]], method=method, threads=1).status == "Found"
    return {
        "method": method,
        "view": "unrelated",
        "hidden": None,
        "false_points": None,
        "runs": UNRELATED,
        "found": found,
        "wrong": found,
        "precision": None,
        "recall": None,
    }


def report(rows: list[dict[str, object]]) -> str:
    header = ("fruits", "method", "hidden per side", "false per side", "answered", "wrong", "P", "R")
    lines = [
        (
            row["view"],
            row["method"],
            "-" if row["hidden"] is None else f"{100 * row['hidden']:.0f} %",
            "-" if row["false_points"] is None else str(row["false_points"]),
            f"{row['found']}/{row['runs']}",
            str(row["wrong"]),
            share(row["precision"]),
            share(row["recall"]),
        )
        for row in rows
    ]
    return f"# One tree, twelve weeks\n\n{' '.join((__doc__ or '').split())}\n\n{markdown(header, lines)}"
