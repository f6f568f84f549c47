"""A run over the steps of a farm: what is done is left alone, what fails stops its own row's later steps only."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from pomona.errors import PomonaError
from pomona.farm.executor import Executor, Job, Outcome
from pomona.farm.farm_plan import FarmPlan
from pomona.farm.farm_run import FarmRun, Fate
from pomona.farm.file_hashes import is_there, stamps
from pomona.farm.ledger import Ledger, Line
from pomona.farm.step_keys import Keys
from pomona.farm.steps import FarmStep

__all__ = ["run_farm"]

TRIES = 5
"""How often a step is begun whose process, or machine, is lost; one that says what is wrong is not tried again."""

EXPECTED_BYTES = {"scan": 1500 << 20}
OTHER_EXPECTED_BYTES = 500 << 20
"""Memory of a step as long as none of its kind was done."""

MOST_TOLD = 20
"""Lines of what a step said that are kept; its log has all."""

NOT_FOUND = 1
"""Exit code of a verb that found no match, which is a result."""


def run_farm(
    plan: FarmPlan,
    run: FarmRun,
    keys: Keys,
    ledger: Ledger,
    executor: Executor,
    changed: Callable[[FarmStep, Fate], None] = lambda _step, _fate: None,
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
        changed: Callable[[FarmStep, Fate], None],
    ) -> None:
        self.plan, self.run, self.keys, self.ledger = plan, run, keys, ledger
        self.executor, self.changed = executor, changed
        self.lines = ledger.read()
        self.tries: dict[str, int] = {}
        self.kept: dict[str, tuple[str, ...]] = {}
        self.peaks_bytes: dict[str, int] = {}
        for line in self.lines.values():
            self._note_peak(line.kind, line.peak_bytes)

    def drive(self) -> None:
        while True:
            self._start_what_can()
            if not self.run.counts[Fate.running]:
                return
            for outcome in self.executor.wait():
                self._end(self.run.steps[outcome.step], outcome)

    def _start_what_can(self) -> None:
        while (step := self.run.next_ready()) is not None:
            job = self._job(step)
            if not self.executor.has_room(job):
                return
            try:
                self._begin(step)
            except OSError as error:
                self._fail(step, f"{error.filename}: cannot be written: {error.strerror}")
                continue
            self.executor.start(job)
            self._tell(step, Fate.running)

    def _job(self, step: FarmStep) -> Job:
        made = {name: self.lines[name].outputs for name in step.needs}
        expected = self.peaks_bytes.get(step.kind) or EXPECTED_BYTES.get(step.kind, OTHER_EXPECTED_BYTES)
        return Job(step.name, step.arguments(made), self.plan.folder, expected)

    def _begin(self, step: FarmStep) -> None:
        """Note that the step is not done, before anything that it wrote is written anew."""
        before = self.lines.get(step.name)
        settings = self.keys.settings[step.name]
        for output in step.outputs:
            output.parent.mkdir(parents=True, exist_ok=True)
        if step.kind == "map" and before is not None and before.settings != settings:
            self.kept[step.name] = _set_aside(step.outputs[0], before.settings)
        outputs = () if before is None else before.outputs
        self._write(Line(step.name, step.kind, "", settings, outputs))

    def _end(self, step: FarmStep, outcome: Outcome) -> None:
        self.run.seconds[step.name] = outcome.seconds
        if outcome.exit_code is None and self.tries.setdefault(step.name, 1) < TRIES:
            self.tries[step.name] += 1
            self._tell(step, Fate.waiting)
            return
        try:
            outputs = self._outputs(step, outcome)
        except PomonaError as error:
            self._fail(step, str(error))
            return
        told = (*self.kept.pop(step.name, ()), *_told(step, outcome))
        is_incomplete = outcome.exit_code == NOT_FOUND
        self._remove_others(step, outputs)
        self._write(
            Line(
                step.name,
                step.kind,
                self.keys.of[step.name],
                self.keys.settings[step.name],
                outputs,
                told,
                is_incomplete,
                outcome.seconds,
                outcome.peak_bytes,
            )
        )
        self._note_peak(step.kind, outcome.peak_bytes)
        self._tell(step, Fate.incomplete if is_incomplete else Fate.done, "; ".join(told))

    def _outputs(self, step: FarmStep, outcome: Outcome) -> tuple[str, ...]:
        """Name what a step has written, from the plan's folder.

        Raises
        ------
        PomonaError
            It has failed: why.
        """
        if outcome.exit_code is None:
            raise PomonaError(f"its process was lost {TRIES} times")
        is_verdict = outcome.exit_code == NOT_FOUND and step.kind == "map" and "Traceback" not in outcome.err
        if outcome.exit_code and not is_verdict:
            raise PomonaError(f"{_last_line(outcome)}{self._way_out(step, _last_line(outcome))}")
        if stamps(step.inputs) != self.keys.stamps[step.name]:
            raise PomonaError("its input changed while it was read, expected a recording that has ended")
        for output in step.outputs:
            if not is_there(output):
                raise PomonaError(f"{output}: was not written; {_last_line(outcome)}")
        if step.kind == "scan":
            return tuple(json.loads(outcome.out.splitlines()[-1])["output"])
        return tuple(os.path.relpath(output, self.plan.folder) for output in step.outputs)

    def _way_out(self, step: FarmStep, why: str) -> str:
        """Say how the row goes on without the recording that a step failed of, where it is plain which that is."""
        named = dict(step.recordings)
        if step.kind == "map":
            for need in step.needs:
                named |= dict.fromkeys(self.lines[need].outputs, self.run.steps[need].recordings[0][1])
        blamed = [title for path, title in named.items() if step.kind == "scan" or why.startswith(f"{Path(path)}: ")]
        skip = json.dumps(blamed[:1], ensure_ascii=False)
        return f"; the row goes on without it by skip = {skip} in the plan's [recordings]" if blamed else ""

    def _remove_others(self, step: FarmStep, outputs: tuple[str, ...]) -> None:
        """Remove the parts that an earlier scan of the recording had and this one has not."""
        sessions = (self.plan.results / "sessions").resolve()
        for name in set(self.lines[step.name].outputs) - set(outputs):
            path = self.plan.folder / name
            if step.kind == "scan" and path.resolve().is_relative_to(sessions):
                path.unlink(missing_ok=True)

    def _fail(self, step: FarmStep, why: str) -> None:
        why = "; ".join((why, *self.kept.pop(step.name, ())))
        line = self.lines.get(step.name) or Line(step.name, step.kind, "", self.keys.settings[step.name])
        self._write(replace(line, key="", failure=why))
        self._tell(step, Fate.failed, why)

    def _write(self, line: Line) -> None:
        self.ledger.write(line)
        self.lines[line.name] = line

    def _note_peak(self, kind: str, peak_bytes: int) -> None:
        self.peaks_bytes[kind] = max(self.peaks_bytes.get(kind, 0), peak_bytes)

    def _tell(self, step: FarmStep, fate: Fate, reason: str = "") -> None:
        self.run.tell(step.name, fate, reason)
        self.changed(step, fate)


def _last_line(outcome: Outcome) -> str:
    lines = [line for line in outcome.err.splitlines() if line.strip()]
    return lines[-1].removeprefix("pomona: ") if lines else f"ended with exit code {outcome.exit_code}"


def _told(step: FarmStep, outcome: Outcome) -> tuple[str, ...]:
    """Give what a person should know: the verdicts of a map, and warnings."""
    verdicts = [line for line in outcome.out.splitlines() if "not found in the map" in line]
    warned = [line.removeprefix("pomona: ") for line in outcome.err.splitlines() if line.startswith("pomona: warning")]
    return tuple([*(verdicts if step.kind == "map" else ()), *warned][:MOST_TOLD])


def _set_aside(orchard: Path, settings: str) -> tuple[str, ...]:
    """Keep a map that was made with other settings under another name, and say so: none is thrown away."""
    if not orchard.exists():
        return ()
    kept = orchard.with_name(f"{orchard.stem}.before-{settings[:8]}.gpkg")
    orchard.rename(kept)
    return (f"other settings; the map made before is kept as {kept.name}",)
