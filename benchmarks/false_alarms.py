"""How often unrelated clouds are answered, beside the rate that was asked for.

For every planting without a common fruit, frames among them, and for some `verified.false_alarm_rate`: the pairs that
are `Found`. Writes false_alarms.csv and false_alarms.md. A run replaces the cells that it ran and keeps the others.
"""

import argparse
import sys

import pomona
from benchmarks.results import markdown, read_rows, write_rows, write_text
from pomona.synth.clouds import CELLS, scene_pair

UNRELATED = [name for name, cell in CELLS.items() if cell.shared == 0]
RATES = (3e-4, 0.01, 0.05, 0.2, 0.5)
SEEDS = 50
INTRODUCTION = """# False alarms

Pairs of clouds without a common fruit that were `Found`, of the pairs drawn (`pomona synth clouds CELL`), at each
`verified.false_alarm_rate`.

"""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks false_alarms", description=__doc__)
    parser.add_argument("--cells", nargs="+", choices=UNRELATED, default=UNRELATED, metavar="CELL")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="pairs a cell")
    options = parser.parse_args(arguments)
    rows = []
    for cell in options.cells:
        rows.extend({"cell": cell, "rate": rate, "pairs": options.seeds, "found": 0} for rate in RATES)
        for seed in range(options.seeds):
            for row in rows[-len(RATES) :]:
                row["found"] += found(cell, seed, row["rate"])
        sys.stderr.write(f"false_alarms: {cell} done\n")
    kept = [row for row in read_rows("false_alarms.csv") if row["cell"] not in options.cells]
    merged = sorted([*kept, *rows], key=lambda row: UNRELATED.index(str(row["cell"])))
    write_rows("false_alarms.csv", merged)
    write_text("false_alarms.md", report(read_rows("false_alarms.csv")))


def found(cell: str, seed: int, rate: float) -> bool:
    pair = scene_pair(cell, seed)
    config = {"verified": {"false_alarm_rate": rate}}
    match = pomona.match(pair.query, pair.map, scale=pair.cell.scale, up=pair.up, config=config, threads=1)
    return match.status == "Found"


def report(rows: list[dict[str, str]]) -> str:
    cells = dict.fromkeys(row["cell"] for row in rows)
    table = [
        (
            cell,
            next(row["pairs"] for row in rows if row["cell"] == cell),
            *(row["found"] for row in rows if row["cell"] == cell),
        )
        for cell in cells
    ]
    return INTRODUCTION + markdown(("cell", "pairs", *(f"{rate:g}" for rate in RATES)), table)
