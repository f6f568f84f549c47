"""Names come from strangers: what would command the terminal, or break a line, is written out."""

import ast
import csv
import json
import os
import subprocess
from pathlib import Path

import pytest

import pomona.cli
from command_line import POMONA, Pomona
from pomona import FruitCloud, PomonaError
from pomona.cli.terminal import shown
from pomona.orchard import write_session

EVIL = "\x1b]0;owned\x07\x1b[2J\nrow\x9b31m \u202egnp.tac\u2069\u2028\x7f"
"""Sets the title, clears the screen, begins a line, turns the direction of writing."""


def assert_harmless(text: str) -> None:
    assert "\\x1b" in text  # the name is there
    assert [character for character in text if shown(character) != character] in ([], ["\n"] * text.count("\n"))


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ('Fuji, 3 µm, 林檎, "a"', 'Fuji, 3 µm, 林檎, "a"'),
        ("a\nb\r\tc", r"a\nb\r\tc"),
        ("\x1b[31m\x7f\x85\x9b", r"\x1b[31m\x7f\x85\x9b"),
        ("\u202e\u2066\u200f\u061c\u2028\u2029", r"\u202e\u2066\u200f\u061c\u2028\u2029"),
        ("\udcff", r"\udcff"),
    ],
)
def test_what_commands_a_terminal_is_written_out(text: str, seen: str) -> None:
    assert shown(text) == seen


@pytest.fixture
def evil(tmp_path: Path) -> Path:
    """A session with such names: its own, of its fruits, of its file."""
    cloud = FruitCloud(
        [[0.1 * row, 0.3 * row**2, 1.0] for row in range(8)], ids=tuple(f"{EVIL}{row}" for row in range(8))
    )
    path = tmp_path / f"{EVIL.replace('/', '')}.gpkg"
    write_session(path, cloud, name=EVIL, date="2024-08-09", recording=EVIL)
    return path


def test_the_names_of_a_session_are_shown_harmlessly(pomona: Pomona, evil: Path) -> None:
    code, printed, told = pomona("map", "info", evil)
    assert (code, told) == (0, "")
    assert_harmless(printed)
    plain = evil.with_name("plain.gpkg")
    cloud = FruitCloud([[0.1 * row, 0.3 * row**2, 1.0] for row in range(8)])
    write_session(plain, cloud, name="plain", date="2024-08-09", recording="plain")
    assert len(printed.splitlines()) == len(pomona("map", "info", plain)[1].splitlines())  # the name begins no lines
    code, printed, _ = pomona("map", "add", evil.with_name("orchard.gpkg"), evil)
    assert code == 0
    assert_harmless(printed)


def test_programs_get_the_names_as_they_are(pomona: Pomona, evil: Path, tmp_path: Path) -> None:
    _, printed, _ = pomona("map", "info", evil, "--json")
    assert printed.isascii()
    assert json.loads(printed)["sessions"][0]["name"] == EVIL
    assert pomona("export", evil, "--to", "csv", "-o", tmp_path / "fruits.csv")[0] == 0
    with (tmp_path / "fruits.csv").open(newline="") as file:
        assert next(csv.DictReader(file))["id"] == f"{EVIL}0"


def test_files_and_columns_are_named_harmlessly(pomona: Pomona, tmp_path: Path) -> None:
    for name, text in ((f"{EVIL}.csv", "x,y\n0,0\n"), ("columns.csv", f'x,y,"{EVIL}"\n0,0,0\n'), (f"{EVIL}.ply", "no")):
        (tmp_path / name).write_text(text)
        code, printed, told = pomona("match", tmp_path / name, tmp_path / name)
        assert (code, printed, told.count("\n")) == (2, "", 1)
        if name != "columns.csv":
            assert_harmless(told)
    code, _, told = pomona("match", f"--{EVIL}")
    assert (code, told.count("\n")) == (2, 1)
    assert_harmless(told)


def test_warnings_are_one_harmless_line(pomona: Pomona, tmp_path: Path) -> None:
    path = tmp_path / f"{EVIL}.csv"
    FruitCloud([[1000.0 * row, 0.0, 0.0] for row in range(9)]).write(path)
    code, printed, told = pomona("export", path, "--to", "csv", "-o", f"{path}.csv")
    assert (code, told.count("\n")) == (0, 1)
    assert told.startswith("pomona: warning: ")
    assert_harmless(told)
    assert_harmless(printed)


def test_a_name_that_is_no_text_is_shown_too(tmp_path: Path) -> None:
    name = b"\xff\x1b.csv"
    done = subprocess.run([POMONA, "match", name, name], cwd=tmp_path, capture_output=True)
    assert (done.returncode, done.stdout, done.stderr.count(b"\n")) == (2, b"", 1)
    assert rb"\udcff\x1b.csv" in done.stderr


def test_a_terminal_that_knows_ascii_only_gets_ascii(tmp_path: Path) -> None:
    write_session(tmp_path / "a.gpkg", FruitCloud([[0.0, 0.0, 1.0]]), name="Äpfel", date="2024-08-09", recording="")
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([POMONA, "map", "info", "a.gpkg"], cwd=tmp_path, capture_output=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert rb"\xc4pfel" in done.stdout


def test_no_verb_prints_but_by_the_one_way() -> None:
    ways = {"terminal.py": {"stdout", "stderr"}}
    # Rich's consoles are for progress alone: bars, and text that went through `shown`.
    ways |= {name: {"Console"} for name in ("localize_output.py", "progress.py", "scan_output.py", "synth.py")}
    found = {}
    for file in Path(pomona.cli.__file__).parent.glob("*.py"):
        nodes = list(ast.walk(ast.parse(file.read_text())))
        names = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
        names |= {node.id for node in nodes if isinstance(node, ast.Name)}
        found[file.name] = names & {"echo", "secho", "print", "stdout", "stderr", "Console"}
    assert {name: printing for name, printing in found.items() if printing} == ways


def test_an_error_of_many_lines_is_one(monkeypatch: pytest.MonkeyPatch, pomona: Pomona) -> None:
    def fail(*_about: object) -> None:
        raise PomonaError("a\nb\x1b[0m")

    monkeypatch.setattr("pomona.cli.app", lambda **_options: fail())
    assert pomona() == (2, "", "pomona: a\\nb\\x1b[0m\n")
