"""Run targets in turn, each in processes of its own, for a time; keep what fails in a folder.

The cases follow from the seed alone, so the same seed tries the same cases, as far as the time goes. What is found lies
in `out/fuzz/TARGET/DIGEST.bin`; fixed, it moves to `testdata/fuzz/TARGET/` under a name that says what it is.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from fuzz import ROOT, target_names

__all__ = ["Outcome", "main", "replay", "run_target"]

START_S = 60.0
"""Of a process, until its seeds are made, over and above the time that it was given."""


@dataclass
class Outcome:
    """What became of one target.

    Attributes
    ----------
    tried : int
        Cases.
    failures : list
        Lines that say what left the target, or how its process ended.
    """

    tried: int = 0
    failures: list[str] = field(default_factory=list)


def main() -> None:
    """Run the command line; the exit code is 1 when something was found."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="for all targets together, without their start")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--target", action="append", choices=target_names(), help="only this one; may be repeated")
    parser.add_argument("--found", type=Path, default=ROOT / "out" / "fuzz", help="folder for what fails")
    given = parser.parse_args()
    names = given.target or target_names()
    failed = False
    for name in names:
        outcome = run_target(name, given.seconds / len(names), given.seed, given.found / name)
        print(f"{name}: {outcome.tried} cases, {len(outcome.failures)} failures", flush=True)
        for line in outcome.failures:
            print(f"  {line}", flush=True)
        failed |= bool(outcome.failures)
    sys.exit(1 if failed else 0)


def run_target(name: str, seconds: float, seed: int, found: Path) -> Outcome:
    """Run one target; a process that dies is a failure, and the next one goes on behind its case."""
    outcome = Outcome()
    left, first = seconds, 0
    with tempfile.TemporaryDirectory() as place:
        case = Path(place) / "case"
        while left > 0:
            options = ["--seconds", f"{left:.1f}", "--seed", str(seed), "--first", str(first)]
            ended = _work(name, case, options, left + START_S, outcome, found)
            if ended is None:
                return outcome
            if not case.is_file():
                outcome.failures.append(f"the process ended with {ended} before the first case")
                return outcome
            last, _, content = case.read_bytes().partition(b"\n")
            path = _keep(found, f"died-{int(last)}", content)
            outcome.failures.append(f"the process ended with {ended}: {path}")
            outcome.tried += int(last) + 1 - first
            first, left = int(last) + 1, left / 2
    return outcome


def replay(name: str, files: list[Path]) -> Outcome:
    """Try kept cases again."""
    outcome = Outcome(tried=len(files))
    with tempfile.TemporaryDirectory() as place:
        case = Path(place) / "case"
        ended = _work(name, case, ["--replay", *map(str, files)], START_S, outcome, Path(place))
        if ended is not None:
            last = case.read_bytes().partition(b"\n")[0].decode() if case.is_file() else "none"
            outcome.failures.append(f"the process ended with {ended} at {last}")
    return outcome


def _work(name: str, case: Path, options: list[str], timeout_s: float, outcome: Outcome, found: Path) -> str | None:
    """Run a process to its end; None where it ended well, else how."""
    command = [sys.executable, "-m", "fuzz.worker", name, "--case", str(case), *options]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace", timeout=timeout_s)
        printed, ended = done.stdout, None if done.returncode == 0 else f"code {done.returncode}: {done.stderr[-1500:]}"
    except subprocess.TimeoutExpired as late:
        printed = late.stdout.decode() if isinstance(late.stdout, bytes) else ""
        ended = "no end in time"
    for line in filter(None, printed.splitlines()):
        told = json.loads(line)
        if "tried" in told:
            outcome.tried += told["tried"]
        else:
            path = _keep(found, told["digest"], bytes.fromhex(told["hex"]))
            outcome.failures.append(f"{told['what']}: {path}\n{told['trace']}")
    return ended


def _keep(found: Path, name: str, content: bytes) -> Path:
    found.mkdir(parents=True, exist_ok=True)
    path = found / f"{name}.bin"
    path.write_bytes(content)
    return path
