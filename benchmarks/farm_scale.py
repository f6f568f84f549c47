"""A farm's run over rows that are only simulated: what the scheduler, the ledger and the network carry."""

from __future__ import annotations

import heapq
import json
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from benchmarks.results import markdown
from pomona.farm import FarmPlan, FarmRun, run_farm, steps_of
from pomona.farm.executor import Job, Outcome
from pomona.farm.ledger import Ledger
from pomona.farm.recorded_visits import RecordedVisit
from pomona.farm.step_keys import Keys

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


def simulated_season(rows: int) -> dict[str, float]:
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


SCALE_HEADER = (
    "rows", "steps", "workers", "hours", "workers busy", "planning, CPU s", "scheduling, CPU ms a step",
    "steps a second", "ledger, MB", "network, MB/s",
)  # fmt: skip


def scale_table(scale: list[dict[str, float]]) -> str:
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
