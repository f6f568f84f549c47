"""The scale of reconstructions from the fruits of a map, and whether it knows how sure it is.

*Clouds*, many draws each, turned, moved and scaled by 0.1 to 10 at random:

- rendered row: the true fruits of one date, each hidden with 40 % on both sides, with 1 cm of noise per axis; *bent*:
  and a drift of 2 cm per axis besides that changes over 1.5 m of the row, which is 9 m long, as odometry has it.
- few fruits: 30 % of them are left in the query.
- copy: the fruits of the row, and the oranges, against themselves, 20 % hidden on both sides.
- oranges: odd against even frames of a structure from motion, of which each detection is real (as in `clouds`), 20 %
  hidden on both sides. The two halves are one pair of real clouds, so that their draws err alike.

*Reconstructions*: the true poses of one date of the rendered row as a COLMAP model, turned, moved and scaled at random,
with true boxes or the shipped detector's, in a map of the other date: scanned with stereo, driven the other way, fruits
grown by 16 %, branches sagged by 2 cm. The fruits of the model know no depth.

`within` is the share of scales within 0.5 %, `inside` the share of the true scales inside of the 90 % interval,
`sigmas` the root mean square of the errors in their own sigmas. Writes metric.csv and metric.md.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.clouds import oranges
from benchmarks.colmap_model import write_model
from benchmarks.disturb import hidden, moved
from benchmarks.results import markdown, shared_data, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.detect.opening import open_detector
from pomona.free_scale import Upgrade, metric
from pomona.reconstruction import open_reconstruction
from pomona.recording import Recording, open_recording
from pomona.survey import scan
from pomona.triangulation.model_recording import ModelRecording
from pomona.triangulation.seen_fruits import fruits_of_model

NEAR = 0.005
NOISE_M = 0.01
DRIFT_M, DRIFT_LENGTH_M, WAVES = 0.02, 1.5, 50

Pair = tuple[FruitCloud, FruitCloud]
Draw = Callable[[np.random.Generator], Pair]


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks metric", description=__doc__)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--parts", nargs="+", choices=("drawn", "models"))
    options = parser.parse_args(arguments)
    data = shared_data("metric")
    if data is None:
        return
    rows: list[dict[str, object]] = []
    for part, of in (("drawn", clouds_of), ("models", reconstructions_of)):
        if options.parts is None or part in options.parts:
            rows.extend(summary(name, found) for name, found in of(data, options.draws))
    text = f"# The scale of reconstructions\n\n{(__doc__ or '').partition(chr(10) * 2)[2]}\n{report(rows)}"
    sys.stdout.write(report(rows))
    if options.parts is None:
        write_rows("metric.csv", rows)
        write_text("metric.md", text)


NUMBERS = ("pairs", "within", "error %", "worst %", "sigma %", "inside", "sigmas")
"""Columns of the table that need scales."""

Found = list[tuple[Upgrade, float]]
"""Answers, and the true scale of each."""


def clouds_of(data: Path, draws: int) -> Iterator[tuple[str, Found]]:
    truth = FruitCloud.read(data / "rendered_row" / "2024-08-09" / "fruits.csv")
    halves = [(case.query, case.map) for case in oranges(data / "clouds", np.random.Generator(np.random.PCG64(0)))]
    kinds: dict[str, Draw] = {
        "rendered row": lambda rng: (_noisy(rng, hidden(rng, truth, 0.4)), hidden(rng, truth, 0.4)),
        "rendered row, bent": lambda rng: (_bent(rng, _noisy(rng, hidden(rng, truth, 0.4))), hidden(rng, truth, 0.4)),
        "rendered row, few fruits": lambda rng: (_noisy(rng, hidden(rng, truth, 0.7)), hidden(rng, truth, 0.4)),
        "rendered row, few, bent": lambda rng: (
            _bent(rng, _noisy(rng, hidden(rng, truth, 0.7))),
            hidden(rng, truth, 0.4),
        ),
    }
    kinds["rendered row, copy"] = _thinned(truth, truth)
    kinds["oranges, copy of run 1"] = _thinned(halves[0][1], halves[0][1])
    for run, (query, map_) in enumerate(halves):
        kinds[f"oranges, halves of run {run + 1}"] = _thinned(query, map_)
    for name, draw in kinds.items():
        yield name, [_answer(draw, seed) for seed in range(draws)]


def _thinned(query: FruitCloud, map_: FruitCloud) -> Draw:
    return lambda rng: (hidden(rng, query, 0.2), hidden(rng, map_, 0.2))


def _answer(draw: Draw, seed: int) -> tuple[Upgrade, float]:
    rng = np.random.Generator(np.random.PCG64(seed))
    query, map_ = draw(rng)
    asked, old_from_new = moved(rng, query, scale=float(np.exp(rng.uniform(np.log(0.1), np.log(10)))))
    return metric(asked, map_, threads=1), _scale(old_from_new)


def _scale(transform: NDArray[np.float64]) -> float:
    return float(np.cbrt(np.linalg.det(transform[:3, :3])))


def _noisy(rng: np.random.Generator, cloud: FruitCloud) -> FruitCloud:
    positions = cloud.positions + rng.normal(0.0, NOISE_M, (len(cloud), 3))
    return FruitCloud(positions, diameters_m=cloud.diameters_m)


def _bent(rng: np.random.Generator, cloud: FruitCloud) -> FruitCloud:
    """Move each axis by a Gaussian process along the row, out of random waves (Rahimi and Recht, 2007)."""
    along_m = cloud.positions[:, 0]
    waves = rng.normal(0.0, 1 / DRIFT_LENGTH_M, (3, WAVES)), rng.uniform(0, 2 * np.pi, (3, WAVES))
    heights = np.cos(along_m[:, None, None] * waves[0] + waves[1]).sum(axis=2)
    return replace(cloud, positions=cloud.positions + DRIFT_M * np.sqrt(2 / WAVES) * heights)


def reconstructions_of(data: Path, _draws: int) -> Iterator[tuple[str, Found]]:
    dates = ("2024-08-09", "2024-08-28")
    for boxes in ("true", "shipped"):
        found = [
            _reconstructed(data / "rendered_row", dates[seed % 2], dates[1 - seed % 2], boxes, seed) for seed in (0, 1)
        ]
        for date, one in zip(dates, found, strict=True):
            yield f"model of {date}, {boxes} boxes", [one]


def _reconstructed(row: Path, query: str, map_: str, boxes: str, seed: int) -> tuple[Upgrade, float]:
    """Upgrade a model of one date by the map of another."""
    known = scan(open_recording(row / map_), _detector(open_recording(row / map_), boxes), depth="stereo").cloud
    recorded = open_recording(row / query)
    with tempfile.TemporaryDirectory() as folder:
        rng = np.random.Generator(np.random.PCG64(seed))
        scale = write_model(Path(folder), recorded, rng, form="binary" if seed % 2 else "text")
        recording = ModelRecording.open(open_reconstruction(folder), row / query)
        seen = fruits_of_model(recording, _detector(recorded, boxes))
    sys.stderr.write(f"{query}, {boxes} boxes: {len(seen.cloud)} fruits, {len(known)} in the map\n")
    return metric(seen.cloud, known, threads=1), scale


def _detector(recording: Recording, boxes: str) -> Callable[..., object]:
    return open_detector(None, Path("shipped") if boxes == "shipped" else None, recording)


def summary(name: str, found: Found) -> dict[str, object]:
    """Put the draws of one kind into a row."""
    scalings = [(one.scaling, scale) for one, scale in found if one.scaling is not None]
    if not scalings:
        return {"clouds": name, "draws": len(found), "found": 0, **dict.fromkeys(NUMBERS, "-")}
    errors = np.array([scaling.scale / scale - 1 for scaling, scale in scalings])
    sigmas = np.array([scaling.sigma / scaling.scale for scaling, _ in scalings])
    return {
        "clouds": name,
        "draws": len(found),
        "found": len(scalings),
        "pairs": round(float(np.median([scaling.n_pairs for scaling, _ in scalings]))),
        "within": f"{(np.abs(errors) <= NEAR).mean():.3f}",
        "error %": f"{100 * np.median(np.abs(errors)):.3f}",
        "worst %": f"{100 * np.abs(errors).max():.3f}",
        "sigma %": f"{100 * np.median(sigmas):.3f}",
        "inside": f"{np.mean([scaling.low <= scale <= scaling.high for scaling, scale in scalings]):.3f}",
        "sigmas": f"{np.sqrt(np.mean((errors / sigmas) ** 2)):.2f}",
    }


def report(rows: list[dict[str, object]]) -> str:
    """Give the table."""
    return markdown(tuple(rows[0]), [tuple(map(str, row.values())) for row in rows])
