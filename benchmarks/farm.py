"""What a farm's run costs, and that nothing is lost: on workers, on a cluster, with kills, and simulated at scale.

`python -m benchmarks farm` writes results/farm.md; `--parts rows,recordings,killed,cluster,scale` only these parts of
it, and the others stay. `rows` are drawn sessions, `--rows 60 --visits 4`; `recordings` the shipped ones as those of
four rows; `killed` the drawn ones while 20 workers and 5 runs are killed; `cluster` the drawn ones on Ray, if it is
installed; `scale` rows of a season of eight visits whose steps take the time, and give the bytes, that were measured,
on an executor that lets time pass without work: the scheduler, the plan and the ledger are the real ones.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from benchmarks.farm_cluster import cluster_of
from benchmarks.farm_runs import Run, copy_recordings, draw_rows, run_afresh, run_and_kill, run_with_killed_workers
from benchmarks.farm_scale import scale_table, simulated_season
from benchmarks.results import FOLDER, markdown, write_text

TITLES = {
    "rows": "## Drawn rows",
    "recordings": "## Recordings",
    "killed": "## Kills",
    "cluster": "## A cluster",
    "scale": "## Ten thousand rows",
}
RECORDED_ROWS = 4
KILLED_WORKERS, KILLED_RUNS = 20, 5


def main(options: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks farm", description=__doc__)
    parser.add_argument("--parts", default=",".join(TITLES))
    parser.add_argument("--rows", type=int, default=60)
    parser.add_argument("--visits", type=int, default=4)
    parser.add_argument("--scale", default="100,1000,10000")
    chosen = parser.parse_args(options)
    parts = chosen.parts.split(",")
    with tempfile.TemporaryDirectory() as folder:
        drawn = Path(folder) / "drawn"
        if {"rows", "killed", "cluster"} & set(parts):
            draw_rows(drawn, chosen.rows, chosen.visits)
            alone = run_afresh(drawn, "--workers", "1", cores=1)
        what = f"{chosen.rows} rows of {chosen.visits} visits: map and export of each, a process a step. "
        if "rows" in parts:
            _write("rows", what + _speeds({"1 worker": alone, "2 workers": _two(drawn)}))
        if "killed" in parts:
            _write("killed", what + _kills(drawn, alone))
        if "cluster" in parts:
            _write("cluster", what + _on_cluster(drawn, alone))
        if "recordings" in parts:
            _write("recordings", _recordings(Path(folder) / "recorded"))
    if "scale" in parts:
        _write("scale", scale_table([simulated_season(int(rows)) for rows in chosen.scale.split(",")]))


def _write(part: str, text: str) -> None:
    """Put a part into the results, where the others stay as they are."""
    told = _told_before() | {part: text}
    sections = [f"{TITLES[name]}\n\n{told[name].strip()}\n" for name in TITLES if name in told]
    write_text("farm.md", "\n".join(["# Farms\n", *sections]))


def _told_before() -> dict[str, str]:
    """Read what the last run told of each part."""
    path = FOLDER / "farm.md"
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    told = {}
    for part, title in TITLES.items():
        _, found, rest = text.partition(f"{title}\n")
        if found:
            told[part] = rest.partition("\n## ")[0]
    return told


def _two(folder: Path) -> Run:
    return run_afresh(folder, "--workers", "2", cores=2)


def _recordings(folder: Path) -> str:
    copy_recordings(folder, RECORDED_ROWS)
    runs = {"1 worker": run_afresh(folder, "--workers", "1", cores=1), "2 workers": _two(folder)}
    return f"The three shipped recordings as those of {RECORDED_ROWS} rows: scan, map and export. " + _speeds(runs)


def _on_cluster(folder: Path, alone: Run) -> str:
    runs = {"1 worker": alone}
    for nodes, name in ((1, "Ray, 1 node"), (2, "Ray, 2 nodes")):
        with cluster_of(nodes) as address:
            runs[name] = run_afresh(folder, "--ray", address, cores=nodes)
    return _speeds(runs)


def _speeds(runs: dict[str, Run]) -> str:
    """Compare runs that must have made the same with the first of them."""
    first = next(iter(runs.values()))
    for name, run in runs.items():
        _require_same(name, first, run)
    lines = [
        (name, f"{run.seconds:.0f}", f"{3600 * run.n_steps / run.seconds:.0f}", f"{first.seconds / run.seconds:.2f}")
        for name, run in runs.items()
    ]
    same = "All made the same: exports byte by byte, maps row by row.\n\n"
    return same + markdown(("on", "seconds", "steps an hour", "ratio"), lines)


def _kills(folder: Path, alone: Run) -> str:
    by_worker = run_with_killed_workers(folder, 1, KILLED_WORKERS)
    by_run = run_and_kill(folder, 2, KILLED_RUNS)
    lines = []
    for name, run in (("workers", by_worker), ("runs", by_run)):
        _require_same(name, alone, run)
        lines.append((name, str(KILLED_WORKERS if run is by_worker else KILLED_RUNS), str(run.begun - run.n_steps)))
    told = "On two workers. All made the same as one worker whom nobody disturbed: exports byte by byte, maps row by "
    told += "row. Nothing that was done was done again.\n\n"
    return told + markdown(("killed", "times", "steps begun again"), lines)


def _require_same(name: str, first: Run, run: Run) -> None:
    if run.made != first.made:
        different = sorted(key for key in first.made | run.made if first.made.get(key) != run.made.get(key))
        raise SystemExit(f"{name}: made other results: {', '.join(different)}")
