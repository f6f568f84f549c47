"""How often unrelated clouds are answered, beside the rate that was asked for.

Pairs without a common fruit of every planting, and frames among them, at some `verified.false_alarm_rate`: how many
are `Found`, how many `Ambiguous`. Writes false_alarms.csv and false_alarms.md after every few pairs. A run goes on
where the last one stopped; `--anew` forgets what earlier builds did in the cells that it runs.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor

import pomona
from benchmarks.results import markdown, read_rows, write_rows, write_text
from pomona.synth.clouds import CELLS, scene_pair

UNRELATED = [name for name, cell in CELLS.items() if cell.shared == 0]
NOMINAL = 3e-4
PAIRS = 300
MORE = {"noov": 1000}
"""Pairs of a cell by default, where they are not `PAIRS`."""
AT_ONCE = 25
"""Pairs after which the tables are written."""
INTRODUCTION = """# False alarms

Pairs of clouds without a common fruit (`pomona synth clouds CELL`) at a `verified.false_alarm_rate`: how many were
drawn, how many were `Found`, and how many were `Ambiguous`.

"""

Key = tuple[str, float]
Each = Callable[..., Iterable[str]]
"""`map`, or that of a pool."""


def main(arguments: list[str]) -> None:
    options = _options(arguments)
    asked = [(cell, rate) for rate in options.rates for cell in options.cells]
    counts = read_counts()
    for key in asked if options.anew else ():
        counts.pop(key, None)
    if options.processes == 1:
        _count_all(asked, counts, options, map)
        return
    with ProcessPoolExecutor(options.processes) as pool:
        _count_all(asked, counts, options, pool.map)


def _count_all(asked: list[Key], counts: dict[Key, dict[str, int]], options: argparse.Namespace, each: Each) -> None:
    start_s = time.monotonic()
    for cell, rate in asked:
        pairs = options.pairs or MORE.get(cell, PAIRS)
        while (first := counts.get((cell, rate), {}).get("pairs", 0)) < pairs:
            if time.monotonic() - start_s > options.most_s:
                sys.stderr.write(f"false_alarms: {options.most_s:g} s are spent, the next run goes on from here\n")
                return
            seeds = range(first, min(first + AT_ONCE, pairs))
            counts[cell, rate] = counted(cell, rate, seeds, counts.get((cell, rate)), each)
            write(counts)
        sys.stderr.write(f"false_alarms: {cell} at {rate:g} done\n")


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks false_alarms", description=__doc__)
    parser.add_argument("--cells", nargs="+", choices=UNRELATED, default=UNRELATED, metavar="CELL")
    parser.add_argument("--rates", nargs="+", type=float, default=[NOMINAL], metavar="RATE")
    parser.add_argument("--pairs", type=int, help=f"of a cell; default {PAIRS}, of noov {MORE['noov']}")
    parser.add_argument("--most-s", type=float, default=float("inf"), help="seconds after which it stops")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--anew", action="store_true", help="count from the first pair")
    return parser.parse_args(arguments)


def counted(cell: str, rate: float, seeds: range, before: dict[str, int] | None, each: Each) -> dict[str, int]:
    """Add the verdicts of more pairs to those counted before."""
    counts = dict(before or {"pairs": 0, "found": 0, "ambiguous": 0})
    for verdict in each(status, [cell] * len(seeds), seeds, [rate] * len(seeds)):
        counts["pairs"] += 1
        counts["found"] += verdict == "Found"
        counts["ambiguous"] += verdict == "Ambiguous"
    return counts


def status(cell: str, seed: int, rate: float) -> str:
    pair = scene_pair(cell, seed)
    config = {"verified": {"false_alarm_rate": rate}}
    return str(pomona.match(pair.query, pair.map, scale=pair.cell.scale, up=pair.up, config=config, threads=1).status)


def read_counts() -> dict[Key, dict[str, int]]:
    return {
        (row["cell"], float(row["rate"])): {name: int(row[name]) for name in ("pairs", "found", "ambiguous")}
        for row in read_rows("false_alarms.csv")
    }


def write(counts: dict[Key, dict[str, int]]) -> None:
    order = sorted(counts, key=lambda key: (key[1], UNRELATED.index(key[0])))
    write_rows("false_alarms.csv", [{"cell": key[0], "rate": key[1], **counts[key]} for key in order])
    table = [(cell, f"{rate:g}", *map(str, counts[cell, rate].values())) for cell, rate in order]
    write_text("false_alarms.md", INTRODUCTION + markdown(("cell", "rate", "pairs", "found", "ambiguous"), table))
