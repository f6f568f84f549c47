"""`pomona farm ...`: all rows and dates of a farm, by a plan."""

from __future__ import annotations

import inspect
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args, get_origin

import typer
from typer.models import OptionInfo

from pomona.cli.terminal import libraries_on_stderr, say, say_json, tell
from pomona.cli.verbs import Verbs, Writes
from pomona.likes import FARM_PLAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pomona.farm import FarmPlan, FarmRun, FarmStep, Fate
    from pomona.farm.executor import Executor
    from pomona.farm.farm_plan import Flag, Takes
    from pomona.farm.ledger import Ledger, Line
    from pomona.farm.step_keys import Keys

app = Verbs(help="Do all rows and dates of a farm, by a plan.", no_args_is_help=True)

GIVEN_BY_THE_FARM = {"output", "json", "name", "date", "keep", "preview", "force", "replace", "to"}
"""Flags of the verbs that a plan has no say in."""

plan_argument = typer.Argument(metavar="FARM.toml", help="The plan, as `pomona farm init` writes it.")

VERBS = ("scan", "map", "growth", "report", "export")
MARKS = {"done": "+", "kept": "+", "incomplete": "~", "failed": "x", "blocked": "-", "waiting": ".", "running": ">"}

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""What Typer raises for words that a verb does not take; it does not export it."""

LEGEND = "+ done, ~ some not found in the map, x failed, - needs what failed, > runs, . to do"


@app.callback()
def _farm() -> None:
    """Do all rows and dates of a farm, by a plan."""


@app.command("init")
def farm_init(
    recordings: Path = typer.Argument(metavar="DIR", help="Folder of the recordings."),
    output: Annotated[Path, Writes(FARM_PLAN)] = typer.Option(
        Path("farm.toml"), "-o", "--output", metavar="FARM.toml", help="The plan to write."
    ),
    pattern: str | None = typer.Option(
        None, metavar="PATTERN", help="How they are called, as {row}/{date}.mp4; else guessed from their names."
    ),
    results: str = typer.Option("results", metavar="DIR", help="Folder for all that is made, from the plan's."),
) -> None:
    """Write a plan for the recordings in DIR, to be looked at and changed."""
    from pomona.atomic import whole_file
    from pomona.farm.first_plan import first_plan

    text, count = first_plan(output, recordings, pattern, results)
    with whole_file(output) as partial:
        partial.write_text(text, encoding="utf-8")
    say(f"{output}: {count} {'recording' if count == 1 else 'recordings'}; look at it, then `pomona farm run {output}`")


@app.command("run")
def farm_run(
    plan: Path = plan_argument,
    workers: int | None = typer.Option(None, min=1, help="Steps at once on this machine; as many as it has cores."),
    ray: str | None = typer.Option(
        None, metavar="ADDRESS", help="Run on a Ray cluster instead: its address, or local."
    ),
    dry_run: bool = typer.Option(False, "--dry-run", help="Only print the commands that would be run."),
    json: bool = typer.Option(False, "--json", help="Print a line of JSON for each step that begins or ends."),
) -> None:
    """Do what the plan wants and is not done: scans, maps, growth, reports, exports.

    What is done is never done again; what was killed goes on; a changed setting, recording or version redoes what
    follows from it. A step that fails stops the later steps of its own row only. Exit code 0: all is done.
    1: something failed, the table says what. 2: wrong input.
    """
    from pomona.farm import run_farm

    season, ledger, keys, run = _looked_at(plan, read_only=dry_run)
    if dry_run:
        _print_commands(season, run, json=json)
        return
    # Ray prints what happens to its machines on the standard output, from a thread of its own.
    with ledger.locked(), libraries_on_stderr():
        executor = _executor(season, ledger, workers, ray)
        run_farm(season, run, keys, ledger, executor, _teller(run, json=json))
    if json:
        say_json({"event": "end", "fates": run.fates, "reasons": run.reasons})
    else:
        say(*_table(season, run), *_reasons(run))
    if run.has_failed:
        raise typer.Exit(1)


@app.command("status")
def farm_status(plan: Path = plan_argument, json: bool = typer.Option(False, "--json", help="Print JSON.")) -> None:
    """Say what of the plan is done, what runs, what failed and what is left to do."""
    season, ledger, _, run = _looked_at(plan, read_only=True)
    running = ledger.is_running()
    _overlay(run, ledger.read(), running=running)
    if json:
        say_json({"running": running, "fates": run.fates, "reasons": run.reasons})
    else:
        say("a run is working on it" if running else "no run is working on it")
        say(*_table(season, run), *_reasons(run))


def _looked_at(path: Path, *, read_only: bool) -> tuple[FarmPlan, Ledger, Keys, FarmRun]:
    from pomona.cli.progress import counting
    from pomona.farm import FarmRun, read_plan, steps_of
    from pomona.farm.file_hashes import FileHashes
    from pomona.farm.ledger import Ledger
    from pomona.farm.step_keys import keys_of

    plan = read_plan(path, _flags())
    steps = steps_of(plan)
    _require_flags(path, steps)
    ledger = Ledger(plan.results / ".farm", read_only=read_only)
    hashes = FileHashes(ledger.hashes())
    with counting("reading recordings", len(steps)) as progress:
        keys = keys_of(steps, plan.folder, hashes, lambda number: progress(number, len(steps)))
    ledger.write_hashes(hashes.found)
    return plan, ledger, keys, FarmRun.begin(steps, keys, ledger.read(), plan.folder)


def _require_flags(path: Path, steps: list[FarmStep]) -> None:
    """Let each verb look at the flags of the plan before hours of other work are begun.

    Raises
    ------
    PomonaError
        One is none that the verb takes.
    """
    from pomona.errors import PomonaError

    verbs = _verbs()
    main = {step.name: [step.outputs[0].name] for step in steps}
    first = {step.kind: step for step in reversed(steps)}
    for kind, step in first.items():
        for command in step.arguments(main):
            alone = typer.Typer(add_completion=False)
            alone.command()(verbs[kind])
            words = command[2 if kind == "map" else 1 :]
            try:
                typer.main.get_command(alone).make_context(kind, words)
            except (UsageError, PomonaError) as error:
                said = cast("Any", error).format_message() if isinstance(error, UsageError) else str(error)
                raise PomonaError(f"{path}: [{kind}]: {' '.join(said.split())}") from None


def _flags() -> Mapping[str, Mapping[str, Flag]]:
    """Say which flags of the verbs a plan may set, by what the verbs themselves take."""
    return {name: _flags_of(verb) for name, verb in _verbs().items()}


def _verbs() -> dict[str, Any]:
    from pomona.cli.export import export
    from pomona.cli.growth import growth
    from pomona.cli.map_add import map_add
    from pomona.cli.report import report
    from pomona.cli.scan import scan

    return {"scan": scan, "map": map_add, "growth": growth, "report": report, "export": export}


def _flags_of(verb: Any) -> dict[str, Flag]:
    from pomona.farm.farm_plan import Flag

    found: dict[str, Flag] = {}
    for name, parameter in inspect.signature(verb, eval_str=True).parameters.items():
        # An option stands as the default, or beside the type in Annotated.
        kind, *marks = get_args(parameter.annotation) if _is_marked(parameter.annotation) else (parameter.annotation,)
        option = next((mark for mark in (parameter.default, *marks) if isinstance(mark, OptionInfo)), None)
        if option is not None and name not in GIVEN_BY_THE_FARM:
            long = next((flag for flag in option.param_decls or () if flag.startswith("--")), f"--{name}")
            on, _, off = long.replace("_", "-").partition("/")
            kinds = get_args(kind) or (kind,)
            is_repeated = any(get_origin(one) is list for one in kinds)
            takes: Takes = "switch" if bool in kinds else "path" if Path in kinds else "value"
            found[on.removeprefix("--").replace("-", "_")] = Flag(takes, on, off or None, is_repeated)
    return found


def _is_marked(annotation: Any) -> bool:
    return get_origin(annotation) is Annotated


def _executor(plan: FarmPlan, ledger: Ledger, workers: int | None, ray: str | None) -> Executor:
    from pomona.errors import PomonaError
    from pomona.farm.processes import LocalProcesses
    from pomona.threads import cores

    if ray is None:
        return LocalProcesses(workers or cores(), ledger.log)
    if workers is not None:
        raise PomonaError("--workers: found it with --ray, expected one of them; the cluster has its own")
    from pomona.farm.ray_cluster import RayCluster

    return RayCluster(ray, plan.results, ledger.log)


def _teller(run: FarmRun, *, json: bool) -> Any:
    """Tell of each step that begins or ends: lines of JSON on the standard output, else lines on the standard error."""

    def tell_of(step: FarmStep, fate: Fate) -> None:
        reason = run.reasons.get(step.name, "")
        seconds = run.seconds.get(step.name)
        if json:
            say_json({"event": fate.value, "step": step.name, "seconds": seconds, "reason": reason or None})
        elif fate.value != "running":
            what = "lost, begun again" if fate.value == "waiting" else fate.value
            took = "" if seconds is None else f" in {seconds:.1f} s"
            tell(f"{step.name}: {what}{took}{f': {reason}' if reason else ''}; {run.n_left} left")

    return tell_of


def _print_commands(plan: FarmPlan, run: FarmRun, *, json: bool) -> None:
    main = {name: [os.path.relpath(step.outputs[0], plan.folder)] for name, step in run.steps.items()}
    waiting = [step for step in run.steps.values() if run.fates[step.name].value == "waiting"]
    if json:
        say_json([{"step": step.name, "commands": step.arguments(main)} for step in waiting])
        return
    import shlex

    say(f"cd {shlex.quote(str(plan.folder))}")
    say(*(f"pomona {shlex.join(command)}" for step in waiting for command in step.arguments(main)))
    tell(f"{len(waiting)} steps to do, {sum(run.counts.values()) - len(waiting)} not", *_reasons(run))


def _overlay(run: FarmRun, lines: Mapping[str, Line], *, running: bool) -> None:
    """Add what the run that is going, or the last one, noted of steps that are not done."""
    from pomona.farm import Fate

    for name, line in lines.items():
        if name in run.steps and run.fates[name] is Fate.waiting and not line.key:
            if line.failure is not None:
                run.tell(name, Fate.failed, line.failure)
            elif running:
                run.tell(name, Fate.running)


def _table(plan: FarmPlan, run: FarmRun) -> list[str]:
    """Show a line a row: a mark for each recording and for what is made of the map."""
    marks: dict[tuple[str, str], str] = {}
    for name, step in run.steps.items():
        cell = step.row, step.kind
        marks[cell] = marks.get(cell, "") + MARKS[run.fates[name].value]
    rows = list(dict.fromkeys(row for row, _ in marks))
    kinds = [kind for kind in VERBS if any(kind == other for _, other in marks)]
    table = [["row", *kinds], *([row, *(marks.get((row, kind), "") for kind in kinds)] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in table]
    counts = ", ".join(f"{count} {fate}" for fate, count in run.counts.items() if count)
    return ["", *lines, "", f"{plan.results}: {counts}", f"({LEGEND})"]


def _reasons(run: FarmRun) -> list[str]:
    return [
        f"{name}: {run.fates[name].value}: {reason}"
        for name, reason in run.reasons.items()
        if run.fates[name].value in ("failed", "incomplete")
    ]
