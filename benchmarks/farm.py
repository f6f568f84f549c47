"""What a farm's run costs: real rows on one and two workers, and the run itself over rows that are only simulated.

`python -m benchmarks farm` writes results/farm.md. `--rows 60 --visits 4` are sessions drawn for the purpose, none
with `--rows 0`;
`--scale 100,1000,10000` are rows of a season of eight visits whose steps take the time, and give the bytes, that were
measured, on an executor that lets time pass without work. The scheduler, the plan and the ledger are the real ones.
"""

from __future__ import annotations

import argparse
import heapq
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from benchmarks.results import markdown, write_text
from pomona.farm import FarmPlan, FarmRun, run_farm, steps_of
from pomona.farm.executor import Job, Outcome
from pomona.farm.ledger import Ledger
from pomona.farm.recorded_visits import RecordedVisit
from pomona.farm.step_keys import Keys
from pomona.synth.seasons import SEASONS, draw_season
from pomona.synth.seasons.season_files import write_season

PLAN = """results = "results"
[recordings]
folder = "rec"
pattern = "{row}/{date}.csv"
[map]
[export]
to = ["csv"]
"""

SECONDS = {"scan": 60.0, "map": 4.0, "growth": 6.0, "report": 3.0, "export": 1.0}
"""Of a step, one core: a scan of 90 s of video, and what follows from eight visits to five trees."""

MEGABYTES = {"scan": 2.0, "map": 6.0, "growth": 0.5, "report": 1.0, "export": 0.1}
"""That a step writes."""

VIDEO_MEGABYTES = 400.0
"""That a scan reads: 90 s of stereo video at 1280x720, compressed."""

DAYS = [f"2026-{month:02d}-{day:02d}" for month in (6, 7, 8, 9) for day in (1, 15)]


class VirtualWorkers:
    """An executor whose jobs take their time and nothing else."""

    def __init__(self, workers: int, kinds: dict[str, str]) -> None:
        self.workers, self.kinds, self.now_s = workers, kinds, 0.0
        self.running: list[tuple[float, str]] = []

    def has_room(self, job: Job) -> bool:
        """Tell whether a worker is free."""
        del job
        return len(self.running) < self.workers

    def start(self, job: Job) -> None:
        """Begin a job."""
        heapq.heappush(self.running, (self.now_s + SECONDS[self.kinds[job.step]], job.step))

    def wait(self) -> list[Outcome]:
        """Let time pass until the next job ends."""
        self.now_s, step = heapq.heappop(self.running)
        said = json.dumps({"output": []}) if self.kinds[step] == "scan" else ""
        return [Outcome(step, 0, said, "", SECONDS[self.kinds[step]], 500 << 20)]

    def stop(self) -> None:
        """Forget the rest."""
        self.running = []


def main(options: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks farm", description=__doc__)
    parser.add_argument("--rows", type=int, default=60)
    parser.add_argument("--visits", type=int, default=4)
    parser.add_argument("--scale", default="100,1000,10000")
    chosen = parser.parse_args(options)
    real_table = ""
    if chosen.rows:
        with tempfile.TemporaryDirectory() as folder:
            real_table = _real_table(_real(Path(folder), chosen.rows, chosen.visits), chosen.rows, chosen.visits) + "\n"
    scale = [_simulated(int(rows)) for rows in chosen.scale.split(",")]
    write_text("farm.md", f"# Farms\n\n{real_table}{_scale_table(scale)}")


def _real(folder: Path, rows: int, visits: int) -> dict[int, float]:
    """Run the same rows on one core and on two, and require the same results."""
    easy = SEASONS["easy"]
    plan = replace(easy, n_visits=visits, design=replace(easy.design, n_trees=3, fruits_per_tree=(40, 50)))
    for row in range(rows):
        write_season(draw_season(plan, row), folder / "drawn")
        (folder / "rec" / f"{row:02d}").mkdir(parents=True)
        for visit in (folder / "drawn").glob("2*.csv"):
            shutil.copy(visit, folder / "rec" / f"{row:02d}")
        shutil.rmtree(folder / "drawn")
    (folder / "farm.toml").write_text(PLAN, encoding="utf-8")
    seconds, made = {}, {}
    for workers in (1, 2):
        shutil.rmtree(folder / "results", ignore_errors=True)
        command = [sys.executable, "-m", "pomona", "farm", "run", "farm.toml", "--workers", str(workers)]
        begun = time.monotonic()
        usable = sorted(os.sched_getaffinity(0))[:workers]
        with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            os.sched_setaffinity(process.pid, usable)
        if process.returncode:
            raise SystemExit(f"the run ended with exit code {process.returncode}")
        seconds[workers] = time.monotonic() - begun
        made[workers] = {path.name: path.read_bytes() for path in (folder / "results" / "export").iterdir()}
    if made[1] != made[2]:
        raise SystemExit("one worker and two made different results")
    return seconds


def _simulated(rows: int) -> dict[str, float]:
    """Run a season of rows that are not there."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "rec").mkdir()
        visits = tuple(
            RecordedVisit(f"{row:05d}", day, root / "rec" / f"{row:05d}" / day) for row in range(rows) for day in DAYS
        )
        for row in range(rows):
            (root / "rec" / f"{row:05d}").mkdir()
        verbs = ("scan", "map", "growth", "report", "export")
        plan = FarmPlan(
            root / "farm.toml", root / "results", visits, dict.fromkeys(verbs, ()), dict.fromkeys(verbs, ()), ("csv",)
        )
        begun_s = _cpu_s()
        steps = [replace(step, inputs=(), outputs=()) for step in steps_of(plan)]
        keys = Keys({step.name: step.name for step in steps}, {step.name: "" for step in steps})
        keys.stamps = {step.name: {} for step in steps}
        ledger = Ledger(plan.results / ".farm")
        run = FarmRun.begin(steps, keys, ledger.read(), root)
        planned_s = _cpu_s() - begun_s
        kinds = {step.name: step.kind for step in steps}
        workers = max(1, rows // 10)
        executor, begun_s, wall_s = VirtualWorkers(workers, kinds), _cpu_s(), time.monotonic()
        run_farm(plan, run, keys, ledger, executor)
        size = sum(path.stat().st_size for path in (plan.results / ".farm").iterdir() if path.is_file())
        work_s = sum(SECONDS[kind] for kind in kinds.values())
        megabytes = sum(MEGABYTES[kind] + VIDEO_MEGABYTES * (kind == "scan") for kind in kinds.values())
        return {
            "rows": rows,
            "steps": len(steps),
            "workers": workers,
            "hours": executor.now_s / 3600,
            "busy": work_s / (workers * executor.now_s),
            "plan_s": planned_s,
            "step_ms": 1000 * (_cpu_s() - begun_s) / len(steps),
            "rate": len(steps) / (time.monotonic() - wall_s),
            "ledger_mb": size / 1e6,
            "network": megabytes / executor.now_s,
        }


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _real_table(seconds: dict[int, float], rows: int, visits: int) -> str:
    told = f"{rows} rows of {visits} visits: map and export of each, a process a step, a core a worker. "
    told += "Both runs made the same files, byte by byte.\n\n"
    lines = [
        (str(workers), f"{took:.0f}", f"{3600 * rows / took:.0f}", f"{seconds[1] / took:.2f}")
        for workers, took in seconds.items()
    ]
    return told + markdown(("workers", "seconds", "rows an hour", "ratio"), lines)


SCALE_HEADER = (
    "rows", "steps", "workers", "hours", "workers busy", "planning, CPU s", "scheduling, CPU ms a step",
    "steps a second", "ledger, MB", "network, MB/s",
)  # fmt: skip


def _scale_table(scale: list[dict[str, float]]) -> str:
    took = ", ".join(f"{kind} {seconds:g} s" for kind, seconds in SECONDS.items())
    told = (
        f"A season of {len(DAYS)} visits, simulated: plan, scheduler and ledger are real, steps only take their time "
    )
    told += f"({took}), on one worker for ten rows. Steps a second: what one run can schedule. Network: "
    told += f"{VIDEO_MEGABYTES:g} MB of video a scan, and what is written.\n\n"
    lines = [
        (
            f"{one['rows']:,.0f}",
            f"{one['steps']:,.0f}",
            f"{one['workers']:,.0f}",
            f"{one['hours']:.1f}",
            f"{one['busy']:.2f}",
            f"{one['plan_s']:.1f}",
            f"{one['step_ms']:.2f}",
            f"{one['rate']:,.0f}",
            f"{one['ledger_mb']:.0f}",
            f"{one['network']:,.0f}",
        )
        for one in scale
    ]
    return told + markdown(SCALE_HEADER, lines)
