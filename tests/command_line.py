"""The command line as a user meets it, and two visits for it to match."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer.main

from pomona.cli import app
from pomona.cloud import FruitCloud
from pomona.synth.clouds import scene_pair

POMONA = Path(sys.executable).with_name("pomona")

Run = Callable[..., subprocess.CompletedProcess[str]]
Pomona = Callable[..., tuple[int, str, str]]
"""What a run gives in short: exit code, stdout, stderr."""


def run(*arguments: object, stdin: str = "", cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """In a process of its own."""
    return subprocess.run(
        [POMONA, *map(str, arguments)], input=stdin, cwd=cwd, capture_output=True, text=True, timeout=600
    )


def verbs(command: Any = None, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
    """Commands of typer by their words; groups too, and `pomona` itself by none."""
    command = typer.main.get_command(app) if command is None else command
    found = {path: command}
    for name, inner in getattr(command, "commands", {}).items():
        found |= verbs(inner, (*path, name))
    return found


def options_of(verb: Any) -> list[set[str]]:
    """The names of each of its options."""
    options = [option for option in verb.params if option.param_type_name == "option" and not option.hidden]
    return [{*option.opts, *option.secondary_opts} for option in options]


def assert_refused(done: subprocess.CompletedProcess[str], *named: str) -> None:
    """Wrong input: exit code 2, nothing on stdout, one line on stderr that names what is wrong."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert done.stderr.startswith("pomona: ")
    assert done.stderr.count("\n") == 1
    for words in named:
        assert words in done.stderr


def write_visits(folder: Path) -> Path:
    """Two visits to one row, query.csv and map.csv, in millimetres too; elsewhere.csv has nothing in common."""
    pair = scene_pair("base", seed=7)
    pair.query.write(folder / "query.csv")
    pair.map.write(folder / "map.csv")
    scene_pair("noov", seed=7).query.write(folder / "elsewhere.csv")
    millimetres = FruitCloud(pair.query.positions * 1000.0, ids=pair.query.ids)
    millimetres.write(folder / "query_mm.csv")
    FruitCloud(pair.map.positions * 1000.0, ids=pair.map.ids).write(folder / "map_mm.csv")
    return folder
