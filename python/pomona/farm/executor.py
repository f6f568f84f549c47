"""Where the work of a farm is done: the small interface behind which processes, or many machines, are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

__all__ = ["Executor", "Job", "Outcome"]


@dataclass(frozen=True)
class Job:
    """Commands to run, one after the other, in one process.

    Attributes
    ----------
    step : str
        The step that they are for.
    commands : list of list of str
        What follows ``pomona``.
    folder : Path
        Where they run.
    expected_bytes : int
        Memory that they may take.
    """

    step: str
    commands: list[list[str]]
    folder: Path
    expected_bytes: int


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    Attributes
    ----------
    step : str
        As the job's.
    exit_code : int or None
        Of the first command that failed, else the worst; None when the process, or the machine, was lost.
    out, err : str
        What was printed.
    seconds, peak_bytes : float, int
        What it took.
    """

    step: str
    exit_code: int | None
    out: str
    err: str
    seconds: float
    peak_bytes: int


class Executor(Protocol):
    """Runs jobs, several at once."""

    def has_room(self, job: Job) -> bool:
        """Tell whether a job can be started now."""

    def start(self, job: Job) -> None:
        """Start a job."""

    def wait(self) -> list[Outcome]:
        """Wait until a job that was started has ended, or a moment; give all that have ended since."""

    def stop(self) -> None:
        """End what still runs, and let everything go."""
