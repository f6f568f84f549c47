"""The steps of a season: which commands there are to run, on what, and after which others."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Literal

from pomona.farm.farm_plan import PLACES, FarmPlan
from pomona.farm.recorded_visits import RecordedVisit

__all__ = ["FarmStep", "Kind", "MadeBy", "steps_of"]

Kind = Literal["scan", "map", "growth", "report", "export"]


@dataclass(frozen=True)
class MadeBy:
    """Stands in a command for the files that a step made: a scan may write a recording in several parts."""

    step: str


@dataclass(frozen=True)
class FarmStep:
    """One thing to do, once.

    Attributes
    ----------
    name : str
        What people see: ``scan row 3/2024-08-09``.
    kind : str
        What it does.
    row : str
        The row that it is for.
    commands : tuple of tuple
        What follows ``pomona``, one after the other; run in the folder of the plan.
    inputs : tuple of Path
        What it reads that no step made: files, or folders with all that is in them.
    needs : tuple of str
        Steps that come first.
    outputs : tuple of Path
        What is there afterwards.
    settings : tuple of str
        The flags that the plan gives its verb.
    settings_files : tuple of Path
        Those of the inputs that the flags name.
    recordings : tuple of (str, str)
        Those that its commands name, as they do, and what the plan calls them to leave them out.
    """

    name: str
    kind: Kind
    row: str
    commands: tuple[tuple[str | MadeBy, ...], ...]
    inputs: tuple[Path, ...]
    needs: tuple[str, ...]
    outputs: tuple[Path, ...]
    settings: tuple[str, ...] = ()
    settings_files: tuple[Path, ...] = ()
    recordings: tuple[tuple[str, str], ...] = ()

    def arguments(self, made: Mapping[str, Sequence[str]]) -> list[list[str]]:
        """Write the commands out, given what the steps before it made."""
        return [
            [part for word in command for part in (made[word.step] if isinstance(word, MadeBy) else (word,))]
            for command in self.commands
        ]


def steps_of(plan: FarmPlan) -> list[FarmStep]:
    """Give all steps of a plan, each behind those that it needs, row after row."""
    beside = _Beside(plan.visits)
    steps: list[FarmStep] = []
    for row, group in groupby(plan.visits, key=lambda visit: visit.row):
        steps += _of_row(plan, row, list(group), beside)
    return steps


def _of_row(plan: FarmPlan, row: str, visits: list[RecordedVisit], beside: _Beside) -> Iterator[FarmStep]:
    scans = {visit: _scan(plan, visit, beside) for visit in visits if visit.needs_scan}
    yield from scans.values()
    mapping = _map(plan, row, visits, scans)
    yield mapping
    orchard = _shown(plan, mapping.outputs[0])
    days = len(visits)
    for kind, output, least_days in (("growth", "", 2), ("report", ".html", 1)):
        if kind in plan.flags and days >= least_days:
            yield _from_map(plan, kind, row, orchard, mapping.name, plan.results / kind / f"{row}{output}")
    for to in plan.formats:
        yield _export(plan, row, orchard, mapping.name, to)


def _scan(plan: FarmPlan, visit: RecordedVisit, beside: _Beside) -> FarmStep:
    output = plan.results / "sessions" / visit.row / f"{visit.date.replace(':', '')}.gpkg"
    settings = tuple(_filled(flag, plan, visit) for flag in plan.flags["scan"])
    named = ("--name", f"{visit.row} {visit.date}", "--date", visit.date, "--json")
    return FarmStep(
        name=f"scan {visit.title}",
        kind="scan",
        row=visit.row,
        commands=(("scan", _shown(plan, visit.path), "-o", _shown(plan, output), *named, *settings),),
        inputs=(visit.path, *beside.of(visit), *plan.files["scan"]),
        needs=(),
        outputs=(output,),
        settings=settings,
        recordings=((_shown(plan, visit.path), visit.title),),
    )


def _filled(flag: str, plan: FarmPlan, visit: RecordedVisit) -> str:
    """Let a flag name what lies beside each recording: ``detections = "{beside}/boxes.csv"``."""
    meaning = dict(zip(PLACES, (visit.row, visit.date, _shown(plan, visit.path.parent)), strict=True))
    return re.sub("|".join(map(re.escape, PLACES)), lambda found: meaning[found[0]], flag)


def _map(plan: FarmPlan, row: str, visits: list[RecordedVisit], scans: Mapping[RecordedVisit, FarmStep]) -> FarmStep:
    orchard = plan.results / "maps" / f"{row}.gpkg"
    add = ("map", "add", _shown(plan, orchard))
    settings = plan.flags["map"]
    commands: list[tuple[str | MadeBy, ...]] = []
    if scans:
        # All at once: one that is not found is tried again after the others.
        commands.append((*add, *(MadeBy(step.name) for step in scans.values()), "--replace", *settings))
    for visit in visits:
        if visit not in scans:
            named = ("--name", f"{row} {visit.date}", "--date", visit.date, "--replace")
            commands.append((*add, _shown(plan, visit.path), *named, *settings))
    return FarmStep(
        name=f"map {row}",
        kind="map",
        row=row,
        commands=tuple(commands),
        inputs=(*(visit.path for visit in visits if visit not in scans), *plan.files["map"]),
        needs=tuple(step.name for step in scans.values()),
        outputs=(orchard,),
        settings=settings,
        settings_files=plan.files["map"],
        recordings=tuple((_shown(plan, visit.path), visit.title) for visit in visits if visit not in scans),
    )


def _export(plan: FarmPlan, row: str, orchard: str, after: str, to: str) -> FarmStep:
    if to != "parquet-by-date":
        return _from_map(plan, "export", row, orchard, after, plan.results / "export" / f"{row}.{to}", f" {to}")
    # All rows lie in one folder, as analysts open it.
    step = _from_map(plan, "export", row, orchard, after, plan.results / "export" / "observations", f" {to}")
    ((*words,),) = step.commands
    return replace(step, commands=((*words, f"--to={to}"),))


def _from_map(plan: FarmPlan, kind: str, row: str, orchard: str, after: str, output: Path, title: str = "") -> FarmStep:
    settings = plan.flags[kind]
    verb: Kind = kind  # type: ignore[assignment] # one of them, by the callers above
    return FarmStep(
        name=f"{kind} {row}{title}",
        kind=verb,
        row=row,
        commands=((kind, orchard, "-o", _shown(plan, output), *settings),),
        inputs=plan.files[kind],
        needs=(after,),
        outputs=(output,),
        settings=settings,
    )


def _shown(plan: FarmPlan, path: Path) -> str:
    """Name a path from the plan's folder, so that a farm may be moved as a whole and commands be run by hand there."""
    name = os.path.relpath(path, plan.folder) if path.is_relative_to(plan.folder) else str(path)
    return f"./{name}" if name.startswith("-") else name


class _Beside:
    """What lies beside recordings and is read with them: calibration, boxes, poses."""

    def __init__(self, visits: Sequence[RecordedVisit]) -> None:
        recordings: dict[Path, set[Path]] = {}
        for visit in visits:
            recordings.setdefault(visit.path.parent, set()).add(visit.path)
        self.own: dict[tuple[Path, str], list[Path]] = {}
        self.common: dict[Path, list[Path]] = {}
        for folder, there in recordings.items():
            stems = {path.stem for path in there}
            for path in sorted(folder.iterdir()):
                if path in there or path.name.startswith(".") or not path.is_file():
                    continue
                if path.name.split(".")[0] in stems:
                    self.own.setdefault((folder, path.name.split(".")[0]), []).append(path)
                else:
                    self.common.setdefault(folder, []).append(path)

    def of(self, visit: RecordedVisit) -> list[Path]:
        """Give the files beside a recording that are its own, as ``7.csv`` of ``7.mp4``, or of no other there.

        A folder has all in it.
        """
        if visit.path.is_dir():
            return []
        folder = visit.path.parent
        return [*self.own.get((folder, visit.path.stem), []), *self.common.get(folder, [])]
