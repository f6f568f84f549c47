"""What must not matter to a match: units, origins, rows far from everything, copies of a fruit.

Each case changes the clouds of base pairs of `pomona synth clouds`; the answer must have the pairs of the unchanged
clouds, in at most 1.5 times the CPU. CPU: one thread, the fastest of some repetitions, the median over the pairs.
Writes units.csv and units.md.
"""

import argparse
import sys
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import pomona
from benchmarks.results import markdown, write_rows, write_text
from pomona.synth.clouds import scene_pair

Points = NDArray[np.float64]
Change = Callable[[Points, Points], tuple[Points, Points]]

REPEATS = 3
EASTING_NORTHING = np.array([5e5, 5.2e6, 100.0])
STRAYS = np.array([[1e3, 0.0, 0.0], [0.0, -1e5, 1.0], [1e7, 1e7, 0.0], [0.0, 0.0, 1e15], [-1e30, 1.0, 1.0]])
ZERO = np.zeros((1, 3))


def _scaled(query_power: int, map_power: int) -> Change:
    return lambda query, map: (query * 10.0**query_power, map * 10.0**map_power)


ANY_SCALE: dict[str, Change] = {
    "both georeferenced": lambda query, map: (query + EASTING_NORTHING, map + EASTING_NORTHING),
    "georeferenced, a row 0, 0, 0 in the map": lambda query, map: (
        query + EASTING_NORTHING,
        np.concatenate([map + EASTING_NORTHING, ZERO]),
    ),
    "georeferenced, a row 0, 0, 0 in the query": lambda query, map: (
        np.concatenate([query + EASTING_NORTHING, ZERO]),
        map + EASTING_NORTHING,
    ),
    "origins 10,000 km apart": lambda query, map: (query + 1e7, map - 1e7),
    "five strays each, 1 km to 10^30 m": lambda query, map: (
        np.concatenate([query, STRAYS]),
        np.concatenate([map, -STRAYS]),
    ),
    "a fruit a hundred times more in the query": lambda query, map: (np.concatenate([query, [query[7]] * 100]), map),
    "a fruit a hundred times more in the map": lambda query, map: (query, np.concatenate([map, [map[7]] * 100])),
    "every fruit three times": lambda query, map: (np.tile(query, (3, 1)), np.tile(map, (3, 1))),
}

FREE_SCALE: dict[str, Change] = {
    **{f"query times {10.0**power:g}": _scaled(power, 0) for power in (-3, -2, -1, 1, 2, 3)},
    **{f"map times {10.0**power:g}": _scaled(0, power) for power in (-3, -1, 1, 3)},
    "query times 1,000, georeferenced": lambda query, map: (query * 1e3 + EASTING_NORTHING, map),
}


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks units", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args(arguments)
    rows = []
    for method in ("paper", "verified"):
        for scale in ("metric", "free"):
            cases = ANY_SCALE if scale == "metric" else {**ANY_SCALE, **FREE_SCALE}
            for name, change in cases.items():
                tried = [_tried(seed, method, scale, change) for seed in range(options.seeds)]
                same, ratios = zip(*tried, strict=True)
                ratio = float(np.median(ratios))
                rows.append(
                    {
                        "case": name,
                        "method": method,
                        "scale": scale,
                        "pairs": len(tried),
                        "same": sum(same),
                        "cpu": ratio,
                    }
                )
            sys.stderr.write(f"units: {method}, {scale} done\n")
    write_rows("units.csv", rows)
    write_text("units.md", _report(rows))


def _tried(seed: int, method: str, scale: str, change: Change) -> tuple[bool, float]:
    """Whether the pairs are those of the unchanged clouds, and the CPU over theirs; changes only append rows."""
    scene = scene_pair("base", seed)
    query, map = scene.query.positions, scene.map.positions
    plain, plain_s = _matched(query, map, method, scale)
    found, found_s = _matched(*change(query, map), method, scale)
    return found == plain, found_s / plain_s


def _matched(query: Points, map: Points, method: str, scale: str) -> tuple[set[tuple[int, int]], float]:
    """Pairs of rows, and the CPU in seconds."""
    times_s = []
    for _ in range(REPEATS):
        start = time.process_time()
        found = pomona.match(query, map, method=method, scale=scale, threads=1)
        times_s.append(time.process_time() - start)
    return {(q, m) for q, m in found.pairs.tolist()}, min(times_s)


def _report(rows: list[dict[str, object]]) -> str:
    header = ("case", "method", "scale", "same pairs", "CPU ratio")
    table = [
        (row["case"], row["method"], row["scale"], f"{row['same']}/{row['pairs']}", f"{row['cpu']:.2f}") for row in rows
    ]
    return f"Beside the unchanged clouds of base pairs (python -m benchmarks units):\n\n{markdown(header, table)}"
