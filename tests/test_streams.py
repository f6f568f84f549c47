"""Outputs that are no files: the standard output, pipes and devices, each met in a process of its own."""

import os
import subprocess
from pathlib import Path

import pytest

from command_line import POMONA
from pomona.orchard import load_session


def run(folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    """Run a line of the shell; `pomona` is ours."""
    line = f'pomona() {{ "{POMONA}" "$@"; }}; {command}'
    return subprocess.run(["timeout", "60", "bash", "-c", line], cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("name", ["-", "/dev/stdout", ">(cat)"])
def test_the_standard_output_gets_the_pairs_and_nothing_else(here: Path, name: str) -> None:
    pairs = run(here, "pomona match query.csv map.csv -o pairs.csv >&2 && cat pairs.csv").stdout
    done = run(here, f"pomona match query.csv map.csv -o {name} {'>&2' if '(' in name else ''}")
    assert done.returncode == 0, done.stderr
    assert "Found: " in done.stderr
    assert done.stdout == pairs


def test_what_the_standard_output_goes_to_is_not_cut(here: Path) -> None:
    done = run(
        here, "echo before > all.csv; pomona export map.csv --to csv -o /dev/stdout >> all.csv; echo after >> all.csv"
    )
    assert done.stderr == "/dev/stdout: 385 fruits\n"
    first, *rows, last = (here / "all.csv").read_text().splitlines()
    assert (first, last, len(rows)) == ("before", "after", 386)


@pytest.mark.parametrize("command", ["match query.csv map.csv -o", "scan R -o", "export map.csv -o"])
def test_a_pipe_is_written_into(here: Path, command: str) -> None:
    done = run(here, f"mkfifo pipe; cat pipe & pomona {command} pipe >&2; code=$?; wait; exit $code")
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) > 3
    assert "," in done.stdout.splitlines()[0]
    assert (here / "pipe").is_fifo()


def test_a_scan_to_a_stream_is_a_table_or_what_the_name_says(here: Path) -> None:
    done = run(
        here,
        "pomona scan R -o - > a.csv && pomona scan R -o b.csv && mkfifo s.gpkg && "
        "{ cat s.gpkg > c.gpkg & pomona scan R -o s.gpkg; wait; }",
    )
    assert done.returncode == 0, done.stderr
    assert (here / "a.csv").read_bytes() == (here / "b.csv").read_bytes()
    assert len(load_session(here / "c.gpkg", date="2024-08-01").cloud) == 3


def test_an_export_to_a_stream_is_a_table_unless_a_format_is_said(here: Path) -> None:
    done = run(here, "pomona export map.csv -o - > a.csv; pomona export map.csv -o b.csv; pomona export map.csv -o c")
    assert (here / "a.csv").read_bytes() == (here / "b.csv").read_bytes()
    refusal = "pomona: c: found no suffix, expected --to FORMAT, or one of .csv, .ply, .geojson, .json, "
    assert done.stderr.splitlines()[-1].startswith(refusal)
    assert run(here, "pomona export map.csv --to ply -o - | head -1").stdout == "ply\n"


def test_a_device_is_written_into(here: Path) -> None:
    try:
        os.mknod(here / "null", 0o20666, os.makedev(1, 3))
    except PermissionError:
        pytest.skip("no device can be made here")
    for command in ("match query.csv map.csv -o null", "scan R -o null", "export map.csv --to geojson -o null"):
        assert run(here, f"pomona {command}").returncode == 0
        assert (here / "null").is_char_device()


def test_a_full_standard_output_is_told(here: Path) -> None:
    results = ("match query.csv map.csv --json", "export map.csv --to csv -o -", "match query.csv map.csv")
    for command in (*results, "--help", "match --help", "map", "--version"):
        done = run(here, f"pomona {command} > /dev/full")
        assert done.returncode == 2
        assert "cannot be written: No space left on device" in done.stderr
        assert done.stderr.count("\n") == 1


def test_a_closed_standard_output_is_told_where_it_matters(here: Path) -> None:
    done = run(here, "pomona export map.csv --to csv -o - >&-")
    assert (done.returncode, done.stderr) == (2, "pomona: -: cannot be written: Bad file descriptor\n")
    assert run(here, "pomona export map.csv --to csv -o fruits.csv >&-").returncode == 0


@pytest.mark.parametrize("command", ["match query.csv map.csv --json", "export map.csv --to ply -o -", "--help"])
def test_a_reader_that_has_enough_is_no_error(here: Path, command: str) -> None:
    done = run(here, f"set -o pipefail; {{ pomona {command}; echo $? >&2; }} | true")
    assert done.stderr == "141\n"
