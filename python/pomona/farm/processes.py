"""The executor of one machine: a process a job, no more of them than its cores and its memory carry."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from pomona.farm.executor import Job, Outcome
from pomona.threads import cores

__all__ = ["LocalProcesses", "worker_line"]

PAUSE_S = 0.02
"""Between two looks at the processes."""

LONGEST_WAIT_S = 1.0
"""After so long the caller may look at something else."""

MOST_OUTPUT_BYTES = 64 << 20
"""Of what a command prints; the rest is left in its log."""


@dataclass
class _Running:
    job: Job
    process: subprocess.Popen[bytes]
    slot: int
    started_s: float


class LocalProcesses:
    """Runs jobs as processes of this machine.

    Parameters
    ----------
    workers : int
        Processes at once; each has its share of the cores for itself.
    log : callable
        Gives, for a step, the path of its log without a suffix.
    """

    def __init__(self, workers: int, log: Callable[[str], Path]) -> None:
        self.workers = workers
        self.log = log
        self.memory_bytes = free_memory_bytes()
        self.running: list[_Running] = []
        usable = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
        share = max(1, cores() // workers)
        self.shares = [usable[slot * share : (slot + 1) * share] for slot in range(workers)]

    def has_room(self, job: Job) -> bool:
        """Tell whether there are a free worker and memory for a job; one alone always has room."""
        if not self.running:
            return True
        taken = sum(other.job.expected_bytes for other in self.running)
        return len(self.running) < self.workers and taken + job.expected_bytes <= self.memory_bytes

    def start(self, job: Job) -> None:
        """Start a process."""
        slot = min(set(range(self.workers)) - {other.slot for other in self.running})
        out, err = (self.log(job.step).with_name(self.log(job.step).name + suffix) for suffix in (".out", ".err"))
        with out.open("wb") as to, err.open("wb") as errors:
            process = subprocess.Popen(  # this program, with arguments that went through its plan
                [sys.executable, "-m", "pomona.farm.worker"], stdin=subprocess.PIPE, stdout=to, stderr=errors
            )
        assert process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it ended at once: its exit code tells
            process.stdin.write(worker_line(job, self.shares[slot]))
            process.stdin.flush()
        self.running.append(_Running(job, process, slot, time.monotonic()))

    def wait(self) -> list[Outcome]:
        """Wait until a process has ended."""
        until_s = time.monotonic() + LONGEST_WAIT_S
        while time.monotonic() < until_s:
            ended = [(one, end) for one in self.running if (end := _ended(one.process)) is not None]
            if ended:
                self.running = [one for one in self.running if all(one is not other for other, _ in ended)]
                return [self._outcome(one, *end) for one, end in ended]
            time.sleep(PAUSE_S)
        return []

    def stop(self) -> None:
        """End all processes, and wait for their ends."""
        for one in self.running:
            one.process.kill()
        for one in self.running:
            one.process.wait()
            _close(one.process.stdin)
        self.running = []

    def _outcome(self, one: _Running, exit_code: int, peak_bytes: int) -> Outcome:
        _close(one.process.stdin)
        out, err = (_text(self.log(one.job.step), suffix) for suffix in (".out", ".err"))
        lost = None if exit_code < 0 else exit_code
        return Outcome(one.job.step, lost, out, err, time.monotonic() - one.started_s, peak_bytes)


def worker_line(job: Job, shared_cores: list[int]) -> bytes:
    """Write a job as the line that the worker reads."""
    told = {"commands": job.commands, "folder": str(job.folder), "cores": shared_cores}
    return json.dumps(told).encode() + b"\n"


def free_memory_bytes() -> int:
    """Return the memory that new processes may take: what is free, and what the container allows."""
    free = 1 << 62
    with contextlib.suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = 1024 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    with contextlib.suppress(OSError, ValueError):
        free = min(free, int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    return free


def _ended(process: subprocess.Popen[bytes]) -> tuple[int, int] | None:
    """Give exit code and most memory of a process that has ended."""
    if not hasattr(os, "wait4"):
        code = process.poll()
        return None if code is None else (code, 0)
    try:
        pid, status, used = os.wait4(process.pid, os.WNOHANG)
    except ChildProcessError:
        return -1, 0
    if not pid:
        return None
    process.returncode = os.waitstatus_to_exitcode(status)
    per_unit = 1 if sys.platform == "darwin" else 1024
    return process.returncode, used.ru_maxrss * per_unit


def _text(log: Path, suffix: str) -> str:
    with log.with_name(log.name + suffix).open("rb") as file:
        return file.read(MOST_OUTPUT_BYTES).decode("utf-8", "replace")


def _close(stream: IO[bytes] | None) -> None:
    if stream is not None:
        with contextlib.suppress(OSError):
            stream.close()
