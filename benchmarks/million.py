"""Where in a thousand fruits, and in a million: time to make an index, to open and to ask it; memory, answers.

Orchards as drawn_orchard.py draws them; every visit misses 30 % of the fruits, has 5 % false ones, and lies 2 cm off
the other. Asked are compact indices: visits of five trees and frames of 40 fruits with no idea where they are, as many
from rows that are not in the map; half of all with the vertical known to 2 degrees. Right is a pose within 5 degrees
and 0.3 m. Every size is a process of its own with two threads; CPU time is of both together. Resident is what the
process holds after the answers, less what it held before it opened the index and with it the caller's cloud. Writes
million.csv, million.md and million.png; a run replaces the sizes that it ran and keeps the others.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.drawn_orchard import FRUITS_OF_A_TREE, SHOWN, Query, drawn_rows, five_trees, frame, visited
from benchmarks.million_picture import write_picture
from benchmarks.pose import pose_error
from benchmarks.results import markdown, read_rows, write_rows, write_text
from pomona import FruitCloud, Index, Match

PLACES = {1_000: 200, 10_000: 200, 100_000: 1_000, 1_000_000: 200}
"""Of each kind, inside and outside, by the fruits of the map."""
KINDS: dict[str, Callable[[np.random.Generator, NDArray[np.float64]], Query]] = {"visit": five_trees, "frame": frame}
THREADS = 2
FIRST_ROW_OUTSIDE = 1000
TREES_OUTSIDE = 3 * 228


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks million", description=__doc__)
    parser.add_argument("--fruits", type=int, nargs="+", default=list(PLACES))
    parser.add_argument("--places", type=int, help="of each kind, inside and outside")
    parser.add_argument("--child", action="store_true", help="one size, in this process; prints JSON")
    options = parser.parse_args(arguments)
    if options.child:
        json.dump(figures(options.fruits[0], options.places), sys.stdout)
        return
    for n_fruits in options.fruits:
        row = in_process(n_fruits, options.places or PLACES.get(n_fruits, 200))
        sys.stderr.write(f"million: {row}\n")
        kept = {old["fruits"]: old for old in map(numbers, read_rows("million.csv"))} | {row["fruits"]: row}
        rows = [kept[n] for n in sorted(kept)]
        write_rows("million.csv", rows)
        write_text("million.md", report(rows))
        write_picture(rows)
    sys.stdout.write(report(rows))


def numbers(row: dict[str, str]) -> dict[str, Any]:
    """Read a row that was written before; an older one has fewer figures."""
    return {key: int(value) if value.isdigit() else float(value) for key, value in row.items() if value}


def in_process(n_fruits: int, n_places: int) -> dict[str, Any]:
    command = ["-m", "benchmarks", "million", "--child", "--fruits", str(n_fruits), "--places", str(n_places)]
    done = subprocess.run([sys.executable, *command], stdout=subprocess.PIPE, text=True, check=True)
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def figures(n_fruits: int, n_places: int) -> dict[str, object]:
    rng = np.random.default_rng([14, n_fruits])
    inside = drawn_rows(rng, 0, round(n_fruits / (FRUITS_OF_A_TREE * SHOWN)))
    outside = drawn_rows(rng, FIRST_ROW_OUTSIDE, TREES_OUTSIDE)
    cloud = FruitCloud(visited(rng, inside))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.index"
        found: dict[str, object] = {"fruits": len(cloud), **made(cloud, path)}
        before_mb = resident_mb()
        found |= timed("open", lambda: Index.open(path, cloud, threads=THREADS))
        index = Index.open(path, cloud, threads=THREADS)
        for kind, draw in KINDS.items():
            for up in (False, True):
                name = f"{kind}{' up' * up}"
                queries = (draw(np.random.default_rng([n_fruits, at]), inside) for at in range(n_places // 2))
                found |= {f"{name}, {key}": value for key, value in asked(index, queries, up=up).items()}
                queries = (draw(np.random.default_rng([n_fruits, at, 1]), outside) for at in range(n_places // 2))
                strangers = asked(index, queries, up=up)
                found[f"{name}, false"] = strangers["found"]
                found |= {f"{name}, refused {key}": strangers[key] for key in ("wall_s", "cpu_s", "slow_s")}
        found["resident_mb"] = resident_mb() - before_mb
    return found


def made(cloud: FruitCloud, path: Path) -> dict[str, object]:
    """Make and save the index in a process that ends: what it leaves in memory is not that of opening."""
    np.save(path.with_suffix(".npy"), cloud.positions)
    code = (
        "import json, re, sys, time; import numpy as np; from pomona import Index\n"
        "peak_kb = lambda: int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1])\n"
        "places = np.load(sys.argv[1]); before = peak_kb()\n"
        "wall, cpu = time.perf_counter(), time.process_time()\n"
        f"index = Index(places, compact=True, threads={THREADS})\n"
        "told = {'make wall_s': time.perf_counter() - wall, 'make cpu_s': time.process_time() - cpu}\n"
        "told['make peak_mb'] = (peak_kb() - before) / 1000\n"
        "index.save(sys.argv[2]); print(json.dumps(told))"
    )
    command = [sys.executable, "-c", code, str(path.with_suffix(".npy")), str(path)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    told: dict[str, object] = json.loads(done.stdout)
    return {**told, "file_mb": path.stat().st_size / 1e6}


def timed(name: str, call: Callable[[], object]) -> dict[str, object]:
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    call()
    return {f"{name} wall_s": time.perf_counter() - wall_s, f"{name} cpu_s": time.process_time() - cpu_s}


def asked(index: Index, queries: Iterator[Query], *, up: bool) -> dict[str, object]:
    """Ask; gives how many were found, rightly and wrongly, and how long the found ones, or all where none was, took."""
    answers = []
    for query in queries:
        cpu_s = time.process_time()
        match = index.match(query.seen, up=query.up if up else None)
        answers.append((match, time.process_time() - cpu_s, is_right(match, query)))
    times = [(match.elapsed_s, cpu_s) for match, cpu_s, _ in answers if match] or [
        (m.elapsed_s, c) for m, c, _ in answers
    ]
    walls = sorted(wall_s for wall_s, _ in times)
    return {
        "places": len(answers),
        "found": sum(bool(match) for match, _, _ in answers),
        "right": sum(right for _, _, right in answers),
        "ambiguous": sum(match.status == "Ambiguous" for match, _, _ in answers),
        "wall_s": statistics.median(walls),
        "cpu_s": statistics.median(cpu_s for _, cpu_s in times),
        "slow_s": walls[int(0.95 * (len(walls) - 1))],
    }


def is_right(match: Match, query: Query) -> bool:
    pose = match.map_from_query if match else None
    return pose is not None and pose_error(pose, query.map_from_query, query.seen).success


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * 4096 / 1e6


def report(rows: list[dict[str, Any]]) -> str:
    header = ["", *(f"{int(str(row['fruits'])):,}" for row in rows)]
    keys = [key for key in rows[0] if key != "fruits"]
    lines = [(key, *(shown(key, row.get(key, "-")) for row in rows)) for key in keys]
    return f"# A million fruits\n\n{' '.join((__doc__ or '').split())}\n\n{markdown(header, lines)}"


def shown(key: str, value: object) -> str:
    if isinstance(value, float):
        return f"{1000 * value:.0f} ms" if key.endswith("_s") and value < 1 else f"{value:.3g}"
    return str(value)
