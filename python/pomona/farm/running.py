"""A run over all steps of a farm: what is done is left alone, what fails stops its own row's later steps only."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from pomona.errors import PomonaError
from pomona.farm.executor import Executor, Job, Outcome
from pomona.farm.farm_plan import FarmPlan
from pomona.farm.file_hashes import stamps
from pomona.farm.ledger import Done, Ledger
from pomona.farm.step_keys import Keys
from pomona.farm.steps import Step

__all__ = ["Fate", "FarmRun", "run_farm"]

TRIES = 3
"""How often a step is begun whose process, or machine, is lost; one that says what is wrong is not tried again."""

EXPECTED_BYTES = {"scan": 1500 << 20}
FIRST_EXPECTED_BYTES = 500 << 20
"""Memory of a step as long as none of its kind was done."""

MOST_TOLD = 20
"""Lines of what a step said that are kept; its log has all."""


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


GOOD = (Fate.done, Fate.kept, Fate.incomplete)


@dataclass
class FarmRun:
    """How far a run is.

    Attributes
    ----------
    steps : list of Step
        All, each behind those that it needs.
    fates : dict
        By the step's name.
    reasons : dict
        By the name of a step that failed, is blocked or incomplete: why, in a line.
    seconds : dict
        By name, what the steps of this run took.
    """

    steps: list[Step]
    fates: dict[str, Fate] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    @classmethod
    def begin(cls, plan: FarmPlan, steps: Sequence[Step], keys: Keys, ledger: Ledger) -> FarmRun:
        """Look at what is done."""
        run = cls(list(steps))
        for step in run.steps:
            done = ledger.read(step.name)
            if step.name in keys.wrong:
                run.tell(step, Fate.failed, keys.wrong[step.name])
            elif done is not None and done.key == keys.of.get(step.name) and _is_there(plan, done):
                run.tell(step, Fate.incomplete if done.incomplete else Fate.kept, "; ".join(done.told))
            else:
                run.fates[step.name] = Fate.waiting
        for step in run.steps:  # what is done needs what stands behind nothing anew
            if run.fates[step.name] in GOOD and any(run.fates[name] not in GOOD for name in step.needs):
                run.fates[step.name] = Fate.waiting
        run.block()
        return run

    def tell(self, step: Step, fate: Fate, reason: str = "") -> None:
        """Note what became of a step."""
        self.fates[step.name] = fate
        if reason and fate is not Fate.kept:
            self.reasons[step.name] = reason

    def block(self) -> None:
        """Let steps behind those that failed wait no longer."""
        for step in self.steps:
            stopped = [name for name in step.needs if self.fates[name] in (Fate.failed, Fate.blocked)]
            if stopped and self.fates[step.name] is not Fate.blocked:
                self.tell(step, Fate.blocked, f"needs {stopped[0]}")

    def ready(self) -> Iterator[Step]:
        """Give the steps that can begin; those behind others first, so that rows are finished one after the other."""
        waiting = [step for step in self.steps if self.fates[step.name] is Fate.waiting]
        able = [step for step in waiting if all(self.fates[name] in GOOD for name in step.needs)]
        yield from sorted(able, key=lambda step: not step.needs)

    @property
    def has_failed(self) -> bool:
        """Whether something could not be done."""
        return any(fate in (Fate.failed, Fate.blocked) for fate in self.fates.values())


def run_farm(
    plan: FarmPlan,
    run: FarmRun,
    keys: Keys,
    ledger: Ledger,
    executor: Executor,
    changed: Callable[[Step, Fate], None] = lambda _step, _fate: None,
) -> None:
    """Do all that waits in `run`, as much at once as the executor carries.

    Whatever is killed meanwhile, a step counts as done only when it has ended well, and its outputs appear whole: the
    next run does the rest. `changed` is called for each step that begins or ends.

    Raises
    ------
    PomonaError
        What is noted of the steps cannot be written.
    """
    try:
        _Driver(plan, run, keys, ledger, executor, changed).drive()
    finally:
        executor.stop()


class _Driver:
    def __init__(
        self,
        plan: FarmPlan,
        run: FarmRun,
        keys: Keys,
        ledger: Ledger,
        executor: Executor,
        changed: Callable[[Step, Fate], None],
    ) -> None:
        self.plan, self.run, self.keys, self.ledger = plan, run, keys, ledger
        self.executor, self.changed = executor, changed
        self.by_name = {step.name: step for step in run.steps}
        self.tries: dict[str, int] = {}
        self.peaks_bytes = ledger.peaks_bytes()

    def drive(self) -> None:
        self._note()
        while True:
            started = self._start_what_can()
            running = [name for name, fate in self.run.fates.items() if fate is Fate.running]
            if not running and not started:
                return
            for outcome in self.executor.wait():
                self._end(outcome)

    def _start_what_can(self) -> bool:
        started = False
        for step in self.run.ready():
            try:
                job = self._job(step)
            except PomonaError as error:
                self._tell(step, Fate.failed, str(error))
                continue
            if not self.executor.has_room(job):
                break
            self._begin(step)
            self.executor.start(job)
            self._tell(step, Fate.running)
            started = True
        return started

    def _job(self, step: Step) -> Job:
        made = {name: done.outputs for name in step.needs if (done := self.ledger.read(name)) is not None}
        expected = self.peaks_bytes.get(step.kind) or EXPECTED_BYTES.get(step.kind, FIRST_EXPECTED_BYTES)
        return Job(step.name, step.arguments(made), self.plan.folder, expected)

    def _begin(self, step: Step) -> None:
        """Note that the step is not done, before anything that it wrote is written anew."""
        before = self.ledger.read(step.name)
        settings = self.keys.settings[step.name]
        outputs = before.outputs if before is not None else []
        self.ledger.write(Done(step.name, step.kind, "", settings, outputs, [], False, 0.0, 0))
        for output in step.outputs:
            output.parent.mkdir(parents=True, exist_ok=True)
        if step.kind == "map" and before is not None and before.settings != settings:
            _set_aside(step.outputs[0], before.settings)

    def _end(self, outcome: Outcome) -> None:
        step = self.by_name[outcome.step]
        self.run.seconds[step.name] = outcome.seconds
        if outcome.exit_code is None and self.tries.setdefault(step.name, 1) < TRIES:
            self.tries[step.name] += 1
            self._tell(step, Fate.waiting)
            return
        wrong = self._wrong(step, outcome)
        if wrong is not None:
            self._tell(step, Fate.failed, wrong)
            return
        incomplete = outcome.exit_code == 1
        told = _told(step, outcome)
        outputs = _outputs(self.plan, step, outcome)
        before = self.ledger.read(step.name)
        key, settings = self.keys.of[step.name], self.keys.settings[step.name]
        done = Done(
            step.name, step.kind, key, settings, outputs, told, incomplete, outcome.seconds, outcome.peak_bytes
        )
        self.ledger.write(done)
        self._remove_others(step, before, outputs)
        self.peaks_bytes[step.kind] = max(self.peaks_bytes.get(step.kind, 0), outcome.peak_bytes)
        self._tell(step, Fate.incomplete if incomplete else Fate.done, "; ".join(told) if incomplete else "")

    def _wrong(self, step: Step, outcome: Outcome) -> str | None:
        """Say why a step has failed; None where it has not."""
        if outcome.exit_code is None:
            return f"its process was lost {TRIES} times"
        is_verdict = outcome.exit_code == 1 and step.kind == "map" and "Traceback" not in outcome.err
        if outcome.exit_code and not is_verdict:
            lines = [line for line in outcome.err.splitlines() if line.strip()]
            return lines[-1].removeprefix("pomona: ") if lines else f"ended with exit code {outcome.exit_code}"
        if stamps(step.inputs) != self.keys.stamps[step.name]:
            return "its input changed while it was read, expected a recording that has ended"
        missing = [output for output in step.outputs if not output.exists()]
        return f"{missing[0]}: was not written" if missing else None

    def _remove_others(self, step: Step, before: Done | None, outputs: list[str]) -> None:
        """Remove the parts that an earlier scan of the recording had and this one has not."""
        sessions = self.plan.results / "sessions"
        for name in set(before.outputs if before else ()) - set(outputs):
            path = self.plan.folder / name
            if step.kind == "scan" and path.resolve().is_relative_to(sessions.resolve()):
                path.unlink(missing_ok=True)

    def _tell(self, step: Step, fate: Fate, reason: str = "") -> None:
        self.run.tell(step, fate, reason)
        self.run.block()
        self._note()
        self.changed(step, fate)

    def _note(self) -> None:
        """Write down what runs and what has failed, for `pomona farm status`."""
        running = [name for name, fate in self.run.fates.items() if fate is Fate.running]
        failed = {name: self.run.reasons[name] for name, fate in self.run.fates.items() if fate is Fate.failed}
        note = self.ledger.folder / "run.json"
        partial = note.with_suffix(".partial")
        partial.write_text(json.dumps({"running": running, "failed": failed}), encoding="utf-8")
        partial.replace(note)


def _is_there(plan: FarmPlan, done: Done) -> bool:
    return all((plan.folder / output).exists() for output in done.outputs)


def _told(step: Step, outcome: Outcome) -> list[str]:
    """Give what a person should know: warnings, and the verdicts of a map."""
    warned = [line.removeprefix("pomona: ") for line in outcome.err.splitlines() if line.startswith("pomona: warning")]
    verdicts = [line for line in outcome.out.splitlines() if "not found in the map" in line] if step.kind == "map" else []
    return [*verdicts, *warned][:MOST_TOLD]


def _outputs(plan: FarmPlan, step: Step, outcome: Outcome) -> list[str]:
    """Name what was written from the plan's folder; a scan says which files it wrote."""
    if step.kind == "scan":
        said = json.loads(outcome.out.splitlines()[-1])
        return [str(name) for name in said["output"]]
    return [os.path.relpath(output, plan.folder) for output in step.outputs]


def _set_aside(orchard: Path, settings: str) -> None:
    """Keep a map that was made with other settings under another name: none is thrown away."""
    if orchard.exists():
        orchard.rename(orchard.with_name(f"{orchard.stem}.before-{settings[:8]}.gpkg"))
