"""How far a run over the steps of a farm is, and what can begin next."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable, Mapping
from enum import StrEnum
from pathlib import Path

from pomona.farm.file_hashes import is_there
from pomona.farm.ledger import Line
from pomona.farm.step_keys import Keys
from pomona.farm.steps import FarmStep

__all__ = ["GOOD", "FarmRun", "Fate"]


class Fate(StrEnum):
    """What became of a step."""

    waiting = "waiting"
    running = "running"
    done = "done"
    kept = "kept"
    """It was done before, and nothing that it follows from has changed."""
    incomplete = "incomplete"
    """Done; but for some of what it was given there is no match."""
    failed = "failed"
    blocked = "blocked"
    """A step that it needs has failed."""


GOOD = frozenset((Fate.done, Fate.kept, Fate.incomplete))
STOPPED = frozenset((Fate.failed, Fate.blocked))


class FarmRun:
    """The steps of a farm with their fates; each change costs what it touches, however many steps there are.

    Parameters
    ----------
    steps : iterable of FarmStep
        All, each behind those that it needs.

    Attributes
    ----------
    steps : dict of str to FarmStep
        By name, in their order.
    fates : dict of str to Fate
        By name.
    counts : Counter
        How many steps have each fate.
    reasons : dict of str to str
        By the name of a step that failed, is blocked or incomplete: why, in a line.
    seconds : dict of str to float
        By name, what the steps of this run took.
    """

    def __init__(self, steps: Iterable[FarmStep]) -> None:
        self.steps = {step.name: step for step in steps}
        self.fates = dict.fromkeys(self.steps, Fate.waiting)
        self.counts = Counter(self.fates.values())
        self.reasons: dict[str, str] = {}
        self.seconds: dict[str, float] = {}
        self._order = {name: number for number, name in enumerate(self.steps)}
        self._missing = {name: len(step.needs) for name, step in self.steps.items()}
        self._followers: dict[str, list[str]] = {name: [] for name in self.steps}
        for step in self.steps.values():
            for name in step.needs:
                self._followers[name].append(step.name)
        self._ready: list[tuple[bool, int, str]] = []
        for name in self.steps:
            self._offer(name)

    @classmethod
    def begin(cls, steps: Iterable[FarmStep], keys: Keys, lines: Mapping[str, Line], folder: Path) -> FarmRun:
        """Look at what is done, and still there; `folder` is the plan's."""
        run = cls(steps)
        for name, step in run.steps.items():
            line = lines.get(name)
            if name in keys.wrong:
                run.tell(name, Fate.failed, keys.wrong[name])
            elif run.fates[name] is Fate.blocked or any(run.fates[need] not in GOOD for need in step.needs):
                continue  # what it follows from is made anew first
            elif line is not None and line.key and line.key == keys.of.get(name) and _are_there(line, folder):
                run.tell(name, Fate.incomplete if line.is_incomplete else Fate.kept, "; ".join(line.told))
        return run

    def tell(self, name: str, fate: Fate, reason: str = "") -> None:
        """Note what became of a step, and what that means for those behind it."""
        before = self.fates[name]
        self.counts[before] -= 1
        self.counts[fate] += 1
        self.fates[name] = fate
        self.reasons.pop(name, None)
        if reason and fate is not Fate.kept:
            self.reasons[name] = reason
        if fate in GOOD and before not in GOOD:
            for follower in self._followers[name]:
                self._missing[follower] -= 1
                self._offer(follower)
        elif fate in STOPPED:
            for follower in self._followers[name]:
                if self.fates[follower] is Fate.waiting:
                    self.tell(follower, Fate.blocked, f"needs {name}")
        elif fate is Fate.waiting:
            self._offer(name)

    def next_ready(self) -> FarmStep | None:
        """Look at the step that can begin next; those behind others come first, so that rows are finished."""
        while self._ready:
            name = self._ready[0][2]
            if self.fates[name] is Fate.waiting:
                return self.steps[name]
            heapq.heappop(self._ready)
        return None

    @property
    def n_left(self) -> int:
        """How many steps are not yet done, of those that can be."""
        return self.counts[Fate.waiting] + self.counts[Fate.running]

    @property
    def has_failed(self) -> bool:
        """Whether something could not be done."""
        return bool(self.counts[Fate.failed] + self.counts[Fate.blocked])

    def _offer(self, name: str) -> None:
        if not self._missing[name] and self.fates[name] is Fate.waiting:
            heapq.heappush(self._ready, (not self.steps[name].needs, self._order[name], name))


def _are_there(line: Line, folder: Path) -> bool:
    return all(is_there(folder / output) for output in line.outputs)
