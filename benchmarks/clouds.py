"""Large clouds that nobody made for us: oranges, kiwifruit, stars.

- oranges: one row by structure-from-motion, no scale, each orange found many times. Detections within 0.05 units are
  merged (average linkage), places with fewer than 3 detections dropped. *halves*: odd against even frames of one run.
  *runs*: two runs over the same video, the true similarity fitted to the camera centres of their common frames; they
  differ by a warp. There is no truth fruit by fruit: a pair is right when the fruits lie within 0.1 units (*halves*) or
  0.2 units (*runs*, the warp) of each other under the true pose.
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
from scipy.spatial.transform import Rotation

import pomona
from benchmarks.disturb import hidden, moved
from benchmarks.pose import pose_error
from benchmarks.results import markdown, share, shared_data, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.evaluate import score_pairs

METHODS = ("paper", "verified")
MERGE_UNITS = 0.05
LEAST_DETECTIONS = 3


@dataclass(frozen=True, eq=False)
class Case:
    """Two clouds of one scene in the same frame, or with `map_from_query` given, before one of them is moved.

    `right_within` judges pairs by distance where the ids do not name fruits; `extent` is the unit of the translation
    error that counts as success: 0.3 m on a row of trees, 5 parsecs among stars.
    """

    name: str
    query: FruitCloud
    map: FruitCloud
    scale: str
    map_from_query: NDArray[np.float64]
    right_within: float | None = None
    translation_limit: float = 0.3


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks clouds", description=__doc__)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args(arguments)
    data = shared_data()
    if data is None:
        sys.stderr.write("clouds: skipped, no folder of recordings (set POMONA_DATA)\n")
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
            rows.extend(summary(name, method, answers) for name, answers in runs.items())
            sys.stderr.write(f"clouds: {make.__name__}, {method} done\n")
    write_rows("clouds.csv", rows)
    write_text("clouds.md", report(rows))


def oranges(folder: Path, rng: np.random.Generator) -> Iterator[Case]:  # noqa: ARG001 - one signature for all
    detections = [_numbers(folder / f"kumar_oranges{run}_fruits.csv") for run in ("", "_run219")]
    for run, found in enumerate(detections):
        odd = found["frame"] % 2 == 1
        halves = (_landmarks(found[odd]), _landmarks(found[~odd]))
        yield Case(f"oranges, halves of run {run + 1}", *halves, "free", np.eye(4), right_within=0.1)
    cameras = [_camera_centres(folder / f"kumar_oranges{run}_poses.csv") for run in ("", "_run219")]
    common = sorted(cameras[0].keys() & cameras[1].keys())
    first, second = (np.array([run[frame] for frame in common]) for run in cameras)
    yield Case(
        "oranges, run 1 in run 2",
        _landmarks(detections[0]),
        _landmarks(detections[1]),
        "free",
        similarity_fit(first, second),
        right_within=0.2,
    )


def kiwifruit(folder: Path, rng: np.random.Generator) -> Iterator[Case]:
    vines = _vines(folder / "kiwifruit_9vines.csv")
    everything = _joined(vines)
    vine = vines[int(rng.integers(len(vines)))]
    yield Case(
        "kiwifruit, one vine in nine",
        _noisy(rng, hidden(rng, vine, 0.2), 0.01),
        hidden(rng, everything, 0.2),
        "metric",
        np.eye(4),
    )
    yield Case("kiwifruit, halves of a vine", *_halves(rng, vine, axis=1, sigma=0.01), "metric", np.eye(4))


def stars(folder: Path, rng: np.random.Generator) -> Iterator[Case]:
    with (folder / "bsc5p_stars_xyz_pc.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    positions = np.array([[float(line[column]) for column in ("x_pc", "y_pc", "z_pc")] for line in lines])
    sky = FruitCloud(positions, ids=tuple(line["i"] for line in lines))
    copies = _noisy(rng, hidden(rng, sky, 0.2), 0.1), hidden(rng, sky, 0.2)
    yield Case("stars, copy", *copies, "free", np.eye(4), translation_limit=5.0)
    yield Case("stars, halves", *_halves(rng, sky, axis=0, sigma=0.1), "free", np.eye(4), translation_limit=5.0)


def answer(case: Case, rng: np.random.Generator, method: str) -> dict[str, object]:
    """Move the query, match, judge."""
    scale = float(np.exp(rng.uniform(np.log(0.5), np.log(2.0)))) if case.scale == "free" else 1.0
    query, unmoved_from_query = moved(rng, case.query, scale)
    true = case.map_from_query @ unmoved_from_query
    start_s = time.process_time()
    match = pomona.match(query, case.map, scale=case.scale, method=method, threads=1)
    cpu_s = time.process_time() - start_s
    found = match.status == "Found"
    error = pose_error(match.map_from_query, true, query.positions) if found else None
    right = _right(case, query, match.pairs, true) if found else np.empty(0, bool)
    recall = None
    if case.right_within is None:
        recall = score_pairs(match.pairs.tolist() if found else [], query.ids or (), case.map.ids or ()).recall
    return {
        "fruits": (len(query), len(case.map)),
        "scale": case.scale,
        "found": found,
        "success": error is not None
        and error.rotation_deg < 5.0
        and abs(error.scale) < 0.05
        and error.translation_m < case.translation_limit,
        "pairs": len(right),
        "precision": float(right.mean()) if len(right) else None,
        "recall": recall,
        "cpu_s": cpu_s,
    }


def _right(case: Case, query: FruitCloud, pairs: NDArray[np.int64], true: NDArray[np.float64]) -> NDArray[np.bool_]:
    if case.right_within is None:
        return np.array([query.label(q) == case.map.label(m) for q, m in pairs.tolist()], bool)
    in_map = query.positions[pairs[:, 0]] @ true[:3, :3].T + true[:3, 3]
    return np.linalg.norm(in_map - case.map.positions[pairs[:, 1]], axis=1) < case.right_within


def _numbers(path: Path) -> np.ndarray:
    return np.genfromtxt(path, delimiter=",", names=True)


def _landmarks(detections: np.ndarray) -> FruitCloud:
    """One point per orange out of its many detections."""
    points = np.stack([detections[axis] for axis in "xyz"], axis=1)
    label = fcluster(linkage(points, "average"), MERGE_UNITS, "distance") - 1
    count = np.bincount(label)
    means = np.stack([np.bincount(label, points[:, axis]) / count for axis in range(3)], axis=1)
    return FruitCloud(means[count >= LEAST_DETECTIONS])


def _camera_centres(path: Path) -> dict[int, NDArray[np.float64]]:
    """Camera centres by frame: -R^T t of world-to-camera poses."""
    poses = _numbers(path)
    rotation = Rotation.from_quat(np.stack([poses[name] for name in ("qx", "qy", "qz", "qw")], axis=1))
    centres = -rotation.inv().apply(np.stack([poses[name] for name in ("tx", "ty", "tz")], axis=1))
    return dict(zip(poses["frame"].astype(int).tolist(), centres, strict=True))


def similarity_fit(query: NDArray[np.float64], map_: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit the (4, 4) similarity from (N, 3) to (N, 3) points in the least-squares sense (Horn 1987)."""
    query_centre, map_centre = query.mean(axis=0), map_.mean(axis=0)
    rotation, _ = Rotation.align_vectors(map_ - map_centre, query - query_centre)
    turned = rotation.apply(query - query_centre)
    scale = float(np.sum(turned * (map_ - map_centre)) / np.sum(turned**2))
    pose = np.eye(4)
    pose[:3, :3] = scale * rotation.as_matrix()
    pose[:3, 3] = map_centre - pose[:3, :3] @ query_centre
    return pose


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
