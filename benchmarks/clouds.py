"""Large clouds that nobody made for us: oranges, kiwifruit, stars.

- oranges: one row by structure-from-motion, no scale, each orange found many times. Detections within 0.05 units are
  merged (average linkage), places with fewer than 3 detections dropped. *halves*: odd against even frames of one run;
  a pair is right when the fruits lie within 0.1 units of each other under the true pose. *runs*: the odd and the even
  frames of run 1, each in run 2, which comes from the same video in other units and with a warp. The true pose is not
  known (the runs number their frames differently), but the two registrations must agree.
- kiwifruit: nine digitised vines, all fruits of one place but one left out, side by side 6 m apart. *copy*: one vine
  with 1 cm of noise against all nine, 20 % of the fruits hidden on both sides. *halves*: two parts of one vine that
  share a fifth of it.
- stars: 9,096 stars, parsecs, free scale. *copy*: 0.1 pc of noise, 20 % hidden on both sides. *halves*: two parts that
  share a fifth.

One side is always turned and moved at random, and scaled by 0.5-2 where the scale is free. Writes clouds.csv and
clouds.md.
"""

import argparse
import csv
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

import pomona
from benchmarks.disturb import hidden, moved
from benchmarks.pose import pose_error
from benchmarks.results import markdown, share, shared_data, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.evaluate import score_pairs

METHODS = ("paper", "verified")
MERGE_UNITS = 0.05
LEAST_DETECTIONS = 3
RIGHT_WITHIN_UNITS = 0.1


@dataclass(frozen=True, eq=False)
class Case:
    """Two clouds of one scene in one frame, before the query is moved.

    `translation_limit` is the error of the query's centre that still counts as success, in units of the map.
    """

    name: str
    query: FruitCloud
    map: FruitCloud
    scale: str
    translation_limit: float = 0.3


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks clouds", description=__doc__)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args(arguments)
    data = shared_data("clouds")
    if data is None:
        return
    folder = data / "clouds"
    rows = []
    for make in (oranges, kiwifruit, stars):
        for method in options.methods:
            runs: dict[str, list[dict[str, object]]] = {}
            for seed in range(options.seeds):
                rng = np.random.Generator(np.random.PCG64(seed))
                for case in make(folder, rng):
                    runs.setdefault(case.name, []).append(answer(case, rng, method))
                if make is oranges:
                    both = oranges_in_other_run(folder, rng, method)
                    runs.setdefault("oranges, run 1 in run 2", []).append(both)
            rows.extend(summary(name, method, answers) for name, answers in runs.items())
            sys.stderr.write(f"clouds: {make.__name__}, {method} done\n")
    write_rows("clouds.csv", rows)
    write_text("clouds.md", report(rows))


def oranges(folder: Path, rng: np.random.Generator) -> Iterator[Case]:  # noqa: ARG001 - one signature for all
    detections = [_numbers(folder / f"kumar_oranges{run}_fruits.csv") for run in ("", "_run219")]
    for run, found in enumerate(detections):
        odd = found["frame"] % 2 == 1
        halves = (_landmarks(found[odd]), _landmarks(found[~odd]))
        yield Case(f"oranges, halves of run {run + 1}", *halves, "free")


def oranges_in_other_run(folder: Path, rng: np.random.Generator, method: str) -> dict[str, object]:
    """Register both halves of run 1 in run 2; a success is that the poses agree."""
    first, second = (_numbers(folder / f"kumar_oranges{run}_fruits.csv") for run in ("", "_run219"))
    map_ = _landmarks(second)
    odd = first["frame"] % 2 == 1
    halves = [Case("", _landmarks(first[rows]), map_, "free") for rows in (odd, ~odd)]
    tries = [attempt(half, rng, method) for half in halves]
    poses = [np.eye(4) if one.map_from_unmoved is None else one.map_from_unmoved for one in tries]
    found = all(one.map_from_unmoved is not None for one in tries)
    return {
        "fruits": (len(halves[0].query), len(map_)),
        "scale": "free",
        "found": found,
        "success": found and pose_error(*poses, halves[0].query.positions).success,
        "pairs": len(tries[0].pairs),
        "precision": None,
        "recall": None,
        "cpu_s": tries[0].cpu_s,
    }


def kiwifruit(folder: Path, rng: np.random.Generator) -> Iterator[Case]:
    vines = _vines(folder / "kiwifruit_9vines.csv")
    everything = _joined(vines)
    vine = vines[int(rng.integers(len(vines)))]
    yield Case(
        "kiwifruit, one vine in nine",
        _noisy(rng, hidden(rng, vine, 0.2), 0.01),
        hidden(rng, everything, 0.2),
        "metric",
    )
    yield Case("kiwifruit, halves of a vine", *_halves(rng, vine, axis=1, sigma=0.01), "metric")


def stars(folder: Path, rng: np.random.Generator) -> Iterator[Case]:
    with (folder / "bsc5p_stars_xyz_pc.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    positions = np.array([[float(line[column]) for column in ("x_pc", "y_pc", "z_pc")] for line in lines])
    sky = FruitCloud(positions, ids=tuple(line["i"] for line in lines))
    copies = _noisy(rng, hidden(rng, sky, 0.2), 0.1), hidden(rng, sky, 0.2)
    yield Case("stars, copy", *copies, "free", translation_limit=5.0)
    yield Case("stars, halves", *_halves(rng, sky, axis=0, sigma=0.1), "free", translation_limit=5.0)


@dataclass(frozen=True, eq=False)
class Attempt:
    """A match of a query that was moved and shuffled; `unmoved` are its fruits where they were before.

    The pose `map_from_unmoved` is the identity when the match is right.
    """

    query: FruitCloud
    unmoved: NDArray[np.float64]
    pairs: NDArray[np.int64]
    map_from_unmoved: NDArray[np.float64] | None
    cpu_s: float


def attempt(case: Case, rng: np.random.Generator, method: str) -> Attempt:
    """Move the query and match it; an answer other than `Found` has no pairs and no pose."""
    scale = float(np.exp(rng.uniform(np.log(0.5), np.log(2.0)))) if case.scale == "free" else 1.0
    query, unmoved_from_query = moved(rng, case.query, scale)
    start_s = time.process_time()
    match = pomona.match(query, case.map, scale=case.scale, method=method, threads=1)
    cpu_s = time.process_time() - start_s
    unmoved = query.transformed(unmoved_from_query).positions
    if match.status != "Found":
        return Attempt(query, unmoved, np.empty((0, 2), np.int64), None, cpu_s)
    return Attempt(query, unmoved, match.pairs, match.map_from_query @ np.linalg.inv(unmoved_from_query), cpu_s)


def answer(case: Case, rng: np.random.Generator, method: str) -> dict[str, object]:
    """Move the query, match, judge."""
    done = attempt(case, rng, method)
    pose = done.map_from_unmoved
    error = None if pose is None else pose_error(pose, np.eye(4), case.query.positions)
    right = _right(case, done)
    score = score_pairs(done.pairs.tolist(), done.query.ids or (), case.map.ids or ()) if case.query.ids else None
    return {
        "fruits": (len(case.query), len(case.map)),
        "scale": case.scale,
        "found": error is not None,
        "success": error is not None
        and error.rotation_deg < 5.0
        and abs(error.scale) < 0.05
        and error.translation_m < case.translation_limit,
        "pairs": len(right),
        "precision": float(right.mean()) if len(right) else None,
        "recall": score and score.recall,
        "cpu_s": done.cpu_s,
    }


def _right(case: Case, done: Attempt) -> NDArray[np.bool_]:
    """Whether each pair is right: by its ids, else by the distance of its fruits."""
    if case.query.ids:
        return np.array([done.query.label(q) == case.map.label(m) for q, m in done.pairs.tolist()], bool)
    apart = done.unmoved[done.pairs[:, 0]] - case.map.positions[done.pairs[:, 1]]
    return np.asarray(np.linalg.norm(apart, axis=1) < RIGHT_WITHIN_UNITS)


def _numbers(path: Path) -> np.ndarray:
    return np.genfromtxt(path, delimiter=",", names=True)


def _landmarks(detections: np.ndarray) -> FruitCloud:
    """One point per orange out of its many detections."""
    points = np.stack([detections[axis] for axis in "xyz"], axis=1)
    label = fcluster(linkage(points, "average"), MERGE_UNITS, "distance") - 1
    count = np.bincount(label)
    means = np.stack([np.bincount(label, points[:, axis]) / count for axis in range(3)], axis=1)
    return FruitCloud(means[count >= LEAST_DETECTIONS])


def _vines(path: Path) -> list[FruitCloud]:
    """One cloud per vine, metres, side by side; of fruits digitised at one place the first, none without a place."""
    places: dict[int, dict[tuple[float, ...], str]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        # Its fruit_id is not unique; the line is.
        for number, line in enumerate(csv.DictReader(file)):
            cells = [line[axis] for axis in ("shoot_x_mm", "shoot_y_mm", "dist_from_wire_mm")]
            if all(cells):
                place = tuple(float(cell) / 1e3 for cell in cells)
                places.setdefault(int(line["vine"]), {}).setdefault(place, f"k{number}")
    return [
        FruitCloud(np.array(list(fruits)) + np.array([6.0 * vine, 0.0, 0.0]), ids=tuple(fruits.values()))
        for vine, fruits in sorted(places.items())
    ]


def _joined(clouds: list[FruitCloud]) -> FruitCloud:
    ids = tuple(name for cloud in clouds for name in cloud.ids or ())
    return FruitCloud(np.concatenate([cloud.positions for cloud in clouds]), ids=ids)


def _noisy(rng: np.random.Generator, cloud: FruitCloud, sigma: float) -> FruitCloud:
    return FruitCloud(cloud.positions + rng.normal(0.0, sigma, cloud.positions.shape), ids=cloud.ids)


def _halves(rng: np.random.Generator, cloud: FruitCloud, *, axis: int, sigma: float) -> tuple[FruitCloud, FruitCloud]:
    """Split at the 40 % and 60 % quantiles of one axis; the fruits between are in both parts. The first is noisy."""
    along = cloud.positions[:, axis]
    low, high = np.quantile(along, [0.4, 0.6])
    return _noisy(rng, cloud.select(np.flatnonzero(along <= high)), sigma), cloud.select(np.flatnonzero(along >= low))


def summary(name: str, method: str, answers: list[dict[str, object]]) -> dict[str, object]:
    def mean(column: str) -> float | None:
        values = [row[column] for row in answers if row["success"] and row[column] is not None]
        return float(np.mean(values)) if values else None

    return {
        "clouds": name,
        "method": method,
        "scale": answers[0]["scale"],
        "n_query": answers[0]["fruits"][0],
        "n_map": answers[0]["fruits"][1],
        "runs": len(answers),
        "found": sum(row["found"] for row in answers),
        "success": sum(row["success"] for row in answers),
        "pairs": mean("pairs"),
        "precision": mean("precision"),
        "recall": mean("recall"),
        "cpu_s": float(np.median([row["cpu_s"] for row in answers])),
    }


def report(rows: list[dict[str, object]]) -> str:
    header = ("clouds", "method", "scale", "fruits", "success", "false", "pairs", "P", "R", "CPU s")
    lines = [
        (
            row["clouds"],
            row["method"],
            row["scale"],
            f"{row['n_query']} in {row['n_map']}",
            f"{row['success']}/{row['runs']}",
            str(row["found"] - row["success"]),
            "-" if row["pairs"] is None else f"{row['pairs']:.0f}",
            share(row["precision"]),
            share(row["recall"]),
            f"{row['cpu_s']:.2f}",
        )
        for row in rows
    ]
    return f"# Clouds of others\n\n{(__doc__ or '').split(chr(10), 2)[2].strip()}\n\n{markdown(header, lines)}"
