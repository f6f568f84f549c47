"""Farms that are really run: drawn rows or the shipped recordings, on workers, on a cluster, and with kills."""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from pomona.store.schema import LAYERS
from pomona.synth.seasons import SEASONS, draw_season
from pomona.synth.seasons.season_files import write_season

SHIPPED = Path(__file__).parents[1] / "examples" / "row"

PLAN = """results = "results"
[recordings]
folder = "rec"
pattern = "{row}/{date}%s"
[map]
[export]
to = ["csv"]
"""


@dataclass(frozen=True)
class Run:
    """What a run took and made.

    Attributes
    ----------
    seconds : float
        From start to end.
    begun, n_steps : int
        How often a step was begun; how many there are.
    made : dict
        Exports by their bytes, maps by their rows.
    """

    seconds: float
    begun: int
    n_steps: int
    made: dict[str, object]


def draw_rows(folder: Path, rows: int, visits: int) -> None:
    """Draw rows of three trees as clouds, and write the plan of their season."""
    easy = SEASONS["easy"]
    plan = replace(easy, n_visits=visits, design=replace(easy.design, n_trees=3, fruits_per_tree=(40, 50)))
    for row in range(rows):
        write_season(draw_season(plan, row), folder / "drawn")
        (folder / "rec" / f"{row:02d}").mkdir(parents=True)
        for visit in (folder / "drawn").glob("2*.csv"):
            shutil.copy(visit, folder / "rec" / f"{row:02d}")
        shutil.rmtree(folder / "drawn")
    (folder / "farm.toml").write_text(PLAN % ".csv", encoding="utf-8")


def copy_recordings(folder: Path, rows: int) -> None:
    """Take the shipped recordings as those of several rows, and write the plan of their season."""
    for row in range(rows):
        for day in sorted(SHIPPED.glob("2*")):
            shutil.copytree(day, folder / "rec" / f"{row:02d}" / day.name)
    (folder / "farm.toml").write_text(PLAN % "", encoding="utf-8")


def run_afresh(folder: Path, *flags: str, cores: int | None = None) -> Run:
    """Run a farm from nothing, on so many cores."""
    shutil.rmtree(folder / "results", ignore_errors=True)
    begun_s = time.monotonic()
    with _started(folder, *flags) as process:
        if cores:
            os.sched_setaffinity(process.pid, sorted(os.sched_getaffinity(0))[:cores])
        told = _told(process)
    if process.returncode:
        raise SystemExit(f"the run ended with exit code {process.returncode}")
    return Run(time.monotonic() - begun_s, *_counts(told), made_by(folder))


def run_with_killed_workers(folder: Path, seed: int, kills: int) -> Run:
    """Run a farm from nothing while workers are killed at random moments, again until so many were."""
    dice, begun_s, killed, told = random.Random(seed), time.monotonic(), list[int](), list[tuple[str, str]]()
    made: list[dict[str, object]] = []
    while len(killed) < kills:
        shutil.rmtree(folder / "results", ignore_errors=True)
        with _started(folder, "--workers", "2") as process:
            killer = threading.Thread(target=_kill_workers, args=(process.pid, dice, kills, killed))
            killer.start()
            told += [(event, f"{step} of run {len(made)}") for event, step in _told(process)]
        killer.join()
        if process.returncode:
            raise SystemExit(f"the run ended with exit code {process.returncode}, {len(killed)} workers killed")
        made.append(made_by(folder))
    if any(one != made[0] for one in made):
        raise SystemExit("killed workers made different results")
    return Run(time.monotonic() - begun_s, *_counts(told), made[0])


def run_and_kill(folder: Path, seed: int, kills: int) -> Run:
    """Run a farm from nothing, kill the run at a random moment, and go on with another, so many times."""
    shutil.rmtree(folder / "results", ignore_errors=True)
    dice, begun_s, told = random.Random(seed), time.monotonic(), list[tuple[str, str]]()
    for number in range(kills + 1):
        with _started(folder, "--workers", "2") as process:
            if number < kills:
                threading.Timer(dice.uniform(4, 20), process.kill).start()
            told += _told(process)
        if (process.returncode == -signal.SIGKILL) != (number < kills):
            raise SystemExit(f"run {number + 1} ended with exit code {process.returncode}")
    return Run(time.monotonic() - begun_s, *_counts(told), made_by(folder))


def made_by(folder: Path) -> dict[str, object]:
    """Give all that a farm has made: exports by their bytes, maps by their rows."""
    made: dict[str, object] = {path.name: path.read_bytes() for path in (folder / "results" / "export").iterdir()}
    for path in sorted((folder / "results" / "maps").glob("*.gpkg")):
        with contextlib.closing(sqlite3.connect(path)) as opened:
            made[path.name] = [opened.execute(f"SELECT * FROM {name} ORDER BY id").fetchall() for name, *_ in LAYERS]
    return made


@contextlib.contextmanager
def _started(folder: Path, *flags: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "pomona", "farm", "run", "farm.toml", "--json", *flags]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        yield process


def _told(process: subprocess.Popen[str]) -> list[tuple[str, str]]:
    """Read which step began or ended until the run ends; a killed one leaves its last line unfinished."""
    lines = [json.loads(line) for line in process.stdout or () if line.endswith("\n")]
    return [(line["event"], line["step"]) for line in lines if "step" in line]


def _counts(told: list[tuple[str, str]]) -> tuple[int, int]:
    """Count how often a step was begun and how many there are; none may begin again once it was done."""
    done: set[str] = set()
    for event, step in told:
        if event == "running" and step in done:
            raise SystemExit(f"{step} was done, and done again")
        if event == "done":
            done.add(step)
    return sum(event == "running" for event, _ in told), len(done)


def _kill_workers(run: int, dice: random.Random, kills: int, killed: list[int]) -> None:
    """Kill a worker now and then, as often as asked or until the run ends."""
    with contextlib.suppress(FileNotFoundError):
        while len(killed) < kills:
            time.sleep(dice.uniform(4, 12))
            children = Path(f"/proc/{run}/task/{run}/children").read_text(encoding="ascii").split()
            for child in dice.sample(children, min(1, len(children))):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(int(child), signal.SIGKILL)
                    killed.append(int(child))
