"""What a match costs: CPU, peak memory over the bare import, and what a second thread brings.

Each measurement runs in a process of its own. Time: the fastest of some repetitions, CPU on one thread, wall time on
one and two. Two at once: wall time of each of two such processes on one thread, at the same time. Cores share caches
and clocks, so that even processes that have nothing in common slow each other; twice the wall time on one thread over
this is what a second thread can bring at best. Memory: growth of the peak resident set over that after `import pomona`
with the clouds made. Counts per second of the core's stages: crates/pomona/benches/throughput.rs on a base pair.
Writes speed.csv, throughput.csv and speed.md.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import pomona
from benchmarks.results import markdown, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.synth.clouds import scene_pair

METHODS = ("paper", "verified")
CELLS = ("base", "part1o45", "noov", "big5k")
WORKS = (*CELLS, "frame")
REPEATS = {"big5k": 3}
ROOT = Path(__file__).parents[1]


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks speed", description=__doc__)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--one", nargs=3, metavar=("WORK", "METHOD", "THREADS"), help="measure here, print JSON")
    options = parser.parse_args(arguments)
    if options.one:
        work, method, threads = options.one
        sys.stdout.write(json.dumps(measure(work, method, int(threads))) + "\n")
        return
    rows = []
    for work in WORKS:
        for method in options.methods:
            alone, both = (_in_new_process(work, method, threads) for threads in (1, 2))
            with ThreadPoolExecutor(2) as pool:
                at_once = list(pool.map(_in_new_process, (work, work), (method, method), (1, 1)))
            rows.append(
                {
                    "work": work,
                    "method": method,
                    **alone,
                    "wall_two_threads_s": both["wall_s"],
                    "wall_two_at_once_s": max(one["wall_s"] for one in at_once),
                }
            )
            sys.stderr.write(f"speed: {work}, {method} done\n")
    counts = throughput()
    write_rows("speed.csv", rows)
    write_rows("throughput.csv", [{"stage": stage, "per_second": count} for stage, count in counts.items()])
    write_text("speed.md", report(rows, counts))


def _in_new_process(work: str, method: str, threads: int) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks", "speed", "--one", work, method, str(threads)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    measured: dict[str, float] = json.loads(done.stdout)
    return measured


def measure(work: str, method: str, threads: int) -> dict[str, float]:
    """Fastest of some repetitions, and the peak memory of all of them."""
    task = _frame_in_map(method, threads) if work == "frame" else _cell(work, method, threads)
    before_mb = _peak_mb()
    cpu_s, wall_s = [], []
    for _ in range(REPEATS.get(work, 10)):
        start_cpu_s, start_s = time.process_time(), time.perf_counter()
        task()
        cpu_s.append(time.process_time() - start_cpu_s)
        wall_s.append(time.perf_counter() - start_s)
    return {"cpu_s": min(cpu_s), "wall_s": min(wall_s), "peak_mb": _peak_mb() - before_mb}


def _cell(name: str, method: str, threads: int) -> Callable[[], object]:
    pair = scene_pair(name, 0)
    return lambda: pomona.match(pair.query, pair.map, scale=pair.cell.scale, method=method, threads=threads)


def _frame_in_map(method: str, threads: int) -> Callable[[], object]:
    """Forty neighbouring fruits of a visit against the other visit's map, indexed once."""
    pair = scene_pair("base", 0)
    index = pomona.Index(pair.map, method=method, threads=threads)
    distance = np.linalg.norm(pair.query.positions - pair.query.positions.mean(axis=0), axis=1)
    frame = FruitCloud(pair.query.positions[np.argsort(distance)[:40]])
    return lambda: index.match(frame)


def throughput() -> dict[str, float]:
    """Count per second what the core's stages do with a base pair, one thread."""
    pair = scene_pair("base", 0)
    with tempfile.TemporaryDirectory() as scratch:
        paths = [Path(scratch) / name for name in ("query", "map")]
        for path, cloud in zip(paths, (pair.query, pair.map), strict=True):
            np.savetxt(path, cloud.positions)
        command = ["cargo", "bench", "--quiet", "--locked", "--package", "pomona", "--bench", "throughput", "--"]
        done = subprocess.run([*command, *paths], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    counts: dict[str, float] = json.loads(done.stdout)
    return counts


def _peak_mb() -> float:
    # Linux counts kibibytes, macOS bytes.
    unit = 1.0 if sys.platform == "darwin" else 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def report(rows: list[dict[str, object]], counts: dict[str, float]) -> str:
    times = ("cpu_s", "wall_s", "wall_two_threads_s", "wall_two_at_once_s")
    header = ("work", "method", "CPU ms", "wall ms, 1 thread", "2 threads", "two at once", "peak MB over import")
    lines = [
        (
            row["work"],
            row["method"],
            *(f"{1e3 * row[column]:.1f}" for column in times),
            f"{row['peak_mb']:.0f}",
        )
        for row in rows
    ]
    stages = [(stage.removesuffix("_per_s"), f"{count:,.0f}") for stage, count in counts.items()]
    return (
        f"# Speed\n\n{' '.join((__doc__ or '').split())}\n\n{markdown(header, lines)}\n"
        f"{markdown(('stage', 'per second'), stages)}"
    )
