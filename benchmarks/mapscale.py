"""A map of 100,000 fruits and 500 sessions: a session more, opening it, and the series of one fruit.

50 rows of 24 trees, each visited on 10 dates (big_map.py says how they are drawn and put together). The last visits of
some rows are added by `add_session`, each as it is: 2,000 fruits in a frame of their own, looked for in the whole map.
Wall time and CPU time of the call, which on a shared machine tell different things. Opening and series are medians.
Writes mapscale.md.
"""

import argparse
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.big_map import DrawnRow, build, drawn_rows
from benchmarks.results import markdown, write_text
from pomona.orchard import OrchardMap, add_session

BARS = {"add a session": "2 s", "open": "0.2 s", "series of one fruit": "1 ms"}
N_OPENED = 20
N_SERIES = 500


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks mapscale", description=__doc__)
    parser.add_argument("--rows", type=int, default=50)
    parser.add_argument("--trees", type=int, default=24, help="trees of a row, some 100 fruits each")
    parser.add_argument("--visits", type=int, default=10)
    parser.add_argument("--added", type=int, default=3, help="rows whose last visit is added")
    parser.add_argument("--map", type=Path, help="file that keeps the map; making it takes minutes")
    options = parser.parse_args(arguments)
    rows = list(drawn_rows(options.rows, options.trees))
    later = {rows[(1 + 2 * place) * len(rows) // (2 * options.added)].number for place in range(options.added)}
    with tempfile.TemporaryDirectory() as scratch:
        kept = options.map or Path(scratch) / "kept.gpkg"
        if not kept.exists():
            made(kept, rows, dict.fromkeys(later, options.visits - 1), options.visits)
        path = Path(scratch) / "map.gpkg"
        shutil.copyfile(kept, path)
        before = path.stat().st_size
        figures = {
            "add a session": [timed(lambda row=row: add(path, rows[row], options.visits - 1)) for row in sorted(later)],
            "open": [timed(lambda: OrchardMap(path)) for _ in range(N_OPENED)],
            "series of one fruit": series(path),
        }
        with OrchardMap(path) as orchard:
            size = (len(orchard.fruits()), len(orchard.visits()), sum(visit.n_fruits for visit in orchard.visits()))
    if options == parser.parse_args(["--map", str(options.map)] if options.map else []):
        write_text("mapscale.md", report(figures, size, before))
    sys.stdout.write(report(figures, size, before))


def made(path: Path, rows: list[DrawnRow], n_visits: dict[int, int], most_visits: int) -> None:
    begin = time.perf_counter()
    for number in build(path, iter(rows), n_visits, most_visits):
        sys.stderr.write(f"row {number + 1} of {len(rows)}: {time.perf_counter() - begin:.0f} s\n")


def add(path: Path, row: DrawnRow, visit: int) -> None:
    session, _ = row.session(visit)
    added = add_session(path, session)
    sys.stderr.write(f"{session.name}: {added.n_matched} of {len(session.cloud)} recognised, {added.n_new} new\n")
    assert added.is_added


def series(path: Path) -> list[tuple[float, float]]:
    """Ask for the series of fruits all over an open map."""
    with OrchardMap(path) as orchard:
        ids = [int(name) for name in orchard.fruits().ids or ()]
        chosen = ids[:: max(1, len(ids) // N_SERIES)]
        return [timed(lambda fruit=fruit: orchard.series(fruit)) for fruit in chosen]


def timed(call: Callable[[], object]) -> tuple[float, float]:
    """Return wall and CPU seconds."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall_s, time.process_time() - cpu_s


def report(figures: dict[str, list[tuple[float, float]]], size: tuple[int, int, int], n_bytes: int) -> str:
    lines = []
    for name, times in figures.items():
        wall_s, cpu_s = (statistics.median(column) for column in zip(*times, strict=True))
        lines.append((name, BARS[name], *(f"{1000 * s:.3g} ms" if s < 1 else f"{s:.2f} s" for s in (wall_s, cpu_s))))
    n_fruits, n_sessions, n_observations = size
    held = f"{n_fruits:,} fruits, {n_sessions} sessions, {n_observations:,} observations, {n_bytes / 1e6:.0f} MB"
    table = markdown(("work", "asked for", "wall", "CPU"), lines)
    return f"# A large map\n\n{' '.join((__doc__ or '').split())}\n\nThe map: {held}.\n\n{table}"
