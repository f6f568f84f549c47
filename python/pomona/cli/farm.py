"""`pomona farm ...`: all rows and dates of a farm, by a plan."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from pomona.cli.terminal import say, say_json, tell
from pomona.cli.verbs import Verbs, Writes
from pomona.likes import FARM_PLAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pomona.farm import FarmPlan, FarmRun, Fate, Step
    from pomona.farm.executor import Executor
    from pomona.farm.farm_plan import Flag
    from pomona.farm.ledger import Ledger
    from pomona.farm.step_keys import Keys

app = Verbs(help="Do all rows and dates of a farm, by a plan.", no_args_is_help=True)

GIVEN_BY_THE_FARM = {"output", "json", "name", "date", "keep", "preview", "force", "replace", "to", "unit"}
"""Flags of the verbs that a plan has no say in."""

plan_argument = typer.Argument(metavar="FARM.toml", help="The plan, as `pomona farm init` writes it.")

MARKS = {"done": "+", "kept": "+", "incomplete": "~", "failed": "x", "blocked": "-", "waiting": ".", "running": ">"}


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
    ray: str | None = typer.Option(None, metavar="ADDRESS", help="Run on a Ray cluster instead: its address, or local."),
    dry_run: bool = typer.Option(False, "--dry-run", help="Only print the commands that would be run."),
    json: bool = typer.Option(False, "--json", help="Print a line of JSON for each step that begins or ends."),
) -> None:
    """Do what the plan wants and is not done: scans, maps, growth, reports, exports.

    What is done is never done again; what was killed goes on; a changed setting, recording or version redoes what
    follows from it. A step that fails stops the later steps of its own row only. Exit code 0: all is done.
    1: something failed, the table says what. 2: wrong input.
    """
    from pomona.farm import run_farm

    season, ledger, keys, run = _looked_at(plan)
    if dry_run:
        _print_commands(season, run, json=json)
        return
    with ledger.locked():
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
    season, ledger, _, run = _looked_at(plan)
    running = _overlay(run, ledger)
    if json:
        say_json({"running": running, "fates": run.fates, "reasons": run.reasons})
    else:
        say("a run is working on it" if running else "no run is working on it")
        say(*_table(season, run), *_reasons(run))


def _looked_at(path: Path) -> tuple[FarmPlan, Ledger, Keys, FarmRun]:
    from pomona.cli.progress import working
    from pomona.farm import FarmRun, read_plan, steps_of
    from pomona.farm.file_hashes import FileHashes
    from pomona.farm.ledger import Ledger
    from pomona.farm.step_keys import keys_of

    plan = read_plan(path, _flags())
    ledger = Ledger(plan.results / ".farm")
    steps = steps_of(plan)
    hashes = FileHashes(ledger.folder / "hashes.json")
    with working(f"reading {len(plan.visits)} recordings"):
        keys = keys_of(steps, plan.folder, hashes)
    hashes.save()
    return plan, ledger, keys, FarmRun.begin(plan, steps, keys, ledger)


def _flags() -> Mapping[str, Mapping[str, Flag]]:
    """Say which flags of the verbs a plan may set, by what the verbs themselves take."""
    from pomona.cli.export import export
    from pomona.cli.growth import growth
    from pomona.cli.map import map_add
    from pomona.cli.scan import scan

    verbs = {"scan": scan, "map": map_add, "growth": growth, "export": export}
    return {name: _flags_of(verb) for name, verb in verbs.items()}


def _flags_of(verb: Any) -> dict[str, Flag]:
    found: dict[str, Flag] = {}
    for name, parameter in inspect.signature(verb, eval_str=True).parameters.items():
        if name in GIVEN_BY_THE_FARM or not isinstance(parameter.default, type(typer.Option())):
            continue
        kinds = get_args(parameter.annotation) or (parameter.annotation,)
        long = next((flag for flag in parameter.default.param_decls or () if flag.startswith("--")), f"--{name}")
        key = long.removeprefix("--").replace("-", "_")
        found[key] = "switch" if bool in kinds else "path" if Path in kinds else "value"
    return found


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

    def tell_of(step: Step, fate: Fate) -> None:
        reason = run.reasons.get(step.name, "")
        if json:
            seconds = run.seconds.get(step.name)
            say_json({"event": fate.value, "step": step.name, "seconds": seconds, "reason": reason or None})
        elif fate.value != "running":
            left = sum(one.value in ("waiting", "running") for one in run.fates.values())
            took = f" in {run.seconds[step.name]:.1f} s" if step.name in run.seconds else ""
            tell(f"{step.name}: {fate.value}{took}{f': {reason}' if reason else ''}; {left} left")

    return tell_of


def _print_commands(plan: FarmPlan, run: FarmRun, *, json: bool) -> None:
    main = {step.name: [str(step.outputs[0])] for step in run.steps}
    waiting = [step for step in run.steps if run.fates[step.name].value == "waiting"]
    if json:
        say_json([{"step": step.name, "commands": step.arguments(main)} for step in waiting])
        return
    import shlex

    say(f"cd {shlex.quote(str(plan.folder))}")
    say(*(f"pomona {shlex.join(command)}" for step in waiting for command in step.arguments(main)))
    kept = sum(fate.value in ("kept", "incomplete") for fate in run.fates.values())
    tell(f"{len(waiting)} steps to do, {kept} are done", *_reasons(run))


def _overlay(run: FarmRun, ledger: Ledger) -> bool:
    """Add what the run that is going, or the last one, says of itself."""
    import json

    from pomona.farm import Fate

    running = ledger.is_running()
    try:
        note = json.loads((ledger.folder / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return running
    for step in run.steps:
        if running and step.name in note["running"]:
            run.tell(step, Fate.running)
        elif step.name in note["failed"] and run.fates[step.name] is Fate.waiting:
            run.tell(step, Fate.failed, note["failed"][step.name])
    run.block()
    return running


def _table(plan: FarmPlan, run: FarmRun) -> list[str]:
    """Show a line a row: a mark for each recording and for what is made of the map."""
    rows = list(dict.fromkeys(step.row for step in run.steps))
    kinds = [kind for kind in ("scan", "map", "growth", "report", "export") if any(s.kind == kind for s in run.steps)]
    cells = {
        (row, kind): "".join(MARKS[run.fates[s.name].value] for s in run.steps if (s.row, s.kind) == (row, kind))
        for row in rows
        for kind in kinds
    }
    widths = {kind: max(len(kind), *(len(cells[row, kind]) for row in rows)) for kind in kinds}
    wide = max(3, *(len(row) for row in rows))
    counts = {fate: sum(one.value == fate for one in run.fates.values()) for fate in MARKS}
    told = ", ".join(f"{count} {fate}" for fate, count in counts.items() if count)
    return [
        "",
        f"{'row':<{wide}}  " + "  ".join(f"{kind:<{widths[kind]}}" for kind in kinds).rstrip(),
        *(
            f"{row:<{wide}}  " + "  ".join(f"{cells[row, kind]:<{widths[kind]}}" for kind in kinds).rstrip()
            for row in rows
        ),
        "",
        f"{plan.results}: {told}",
        "+ done   ~ some not found in the map   x failed   - needs what failed   > runs   . to do",
    ]


def _reasons(run: FarmRun) -> list[str]:
    return [
        f"{step.name}: {run.fates[step.name].value}: {run.reasons[step.name]}"
        for step in run.steps
        if step.name in run.reasons and run.fates[step.name].value in ("failed", "incomplete")
    ]
