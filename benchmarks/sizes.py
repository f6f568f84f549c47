"""What diameters bring to the pairs, beside what the true likelihood of sizes brings.

Cells whose fruits have diameters and have grown between the visits, matched with the diameters and without. Beside it
the gated assignment of `oracle.py` under the true pose and noise, without sizes and with their true likelihood: the
growth and the scatter of `ln(map / query)` are those of the true pairs. Gain: of F1, the harmonic mean of precision
and recall. Writes sizes.csv and sizes.md.
"""

import argparse
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import pomona
from benchmarks.oracle import gated_pairs
from benchmarks.results import markdown, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.evaluate import score_pairs
from pomona.synth.clouds import ScenePair, scene_pair

CELLS = ("o45s4size", "grown175", "grownmixed")
PAIRS = 100
HEADER = ("cell", "pairing", "P", "R", "P with sizes", "R with sizes", "gain of F1")


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks sizes", description=__doc__)
    parser.add_argument("--pairs", type=int, default=PAIRS, help=f"of visits of a cell; default {PAIRS}")
    options = parser.parse_args(arguments)
    rows = [row for cell in CELLS for row in of_cell(cell, options.pairs)]
    write_rows("sizes.csv", rows)
    lines = [(str(row["cell"]), str(row["pairing"]), *(f"{row[name]:.3f}" for name in HEADER[2:])) for row in rows]
    write_text("sizes.md", f"# Sizes\n\n{__doc__.partition(chr(10))[2].strip()}\n\n{markdown(HEADER, lines)}")


def of_cell(cell: str, pairs: int) -> list[dict[str, object]]:
    drawn = [scene_pair(cell, seed) for seed in range(pairs)]
    bare = [replace(pair, query=_bare(pair.query), map=_bare(pair.map)) for pair in drawn]
    matched = (_scores(bare, map(_matched, bare)), _scores(drawn, map(_matched, drawn)))
    assigned = (_scores(drawn, map(gated_pairs, drawn)), _scores(drawn, map(_sized, drawn)))
    return [_row(cell, "verified", *matched), _row(cell, "true likelihood", *assigned)]


def _bare(cloud: FruitCloud) -> FruitCloud:
    return replace(cloud, diameters_m=None)


def _matched(pair: ScenePair) -> NDArray[np.int64]:
    match = pomona.match(pair.query, pair.map, scale=pair.cell.scale, threads=1)
    return match.pairs if match.status == "Found" else np.empty((0, 2), np.int64)


def _sized(pair: ScenePair) -> NDArray[np.int64]:
    """Return the gated assignment whose distances have a fourth part, how far the sizes are from the true growth."""
    rows = {name: row for row, name in enumerate(pair.map.ids or ())}
    common = [(row, rows[name]) for row, name in enumerate(pair.query.ids or ()) if name in rows]
    query, map_ = np.array(common).T
    sizes = [np.log(np.asarray(cloud.diameters_m)) for cloud in (pair.query, pair.map)]
    grown = sizes[1][map_] - sizes[0][query]
    return gated_pairs(pair, ((sizes[0] + grown.mean()) / grown.std(), sizes[1] / grown.std()))


def _scores(pairs: list[ScenePair], answers: Iterable[NDArray[np.int64]]) -> tuple[float, float]:
    """Precision and recall over all pairs of visits."""
    scores = [
        score_pairs(answer.tolist(), pair.query.ids or (), pair.map.ids or ())
        for pair, answer in zip(pairs, answers, strict=True)
    ]
    true, false, missed = (sum(getattr(score, name) for score in scores) for name in ("true", "false", "missed"))
    return true / max(true + false, 1), true / max(true + missed, 1)


def _row(cell: str, pairing: str, without: tuple[float, float], sized: tuple[float, float]) -> dict[str, object]:
    gain = _f1(*sized) - _f1(*without)
    return dict(zip(HEADER, (cell, pairing, *without, *sized, gain), strict=True))


def _f1(precision: float, recall: float) -> float:
    return 2.0 * precision * recall / max(precision + recall, 1e-12)
