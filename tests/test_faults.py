"""A full disk, a read-only one, Ctrl-C: one line, the exit code, nothing half-written, whatever the verb."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from command_line import POMONA
from pomona.cloud import FruitCloud
from test_orchard_safety import on_a_small_disk

FAULTY = (
    "match query.csv map.csv -o disk/pairs.csv",
    "match query.csv map.csv --plot disk/match.png",
    "export map.csv --to csv -o disk/fruits.csv",
    "export map.csv --to ply -o disk/fruits.ply",
    "export map.csv --to geojson -o disk/fruits.json",
    "scan R --date 2024-08-09 -o disk/session.gpkg",
    "scan R --date 2024-08-09 -o disk/fruits.csv",
    "scan R --date 2024-08-09 -o fruits.csv --keep disk/kept",
    "scan R --date 2024-08-09 -o fruits.csv --preview disk/seen.mp4",
    "synth clouds base -o disk/drawn",
    "demo -o disk/demo",
)


@pytest.mark.parametrize("command", FAULTY)
@pytest.mark.parametrize("fault", ["full", "read-only"])
def test_a_disk_that_takes_nothing_is_one_line(here: Path, command: str, fault: str) -> None:
    disk = here / "disk"
    disk.mkdir()
    before = {
        "full": f"head -c 1M /dev/zero > '{disk}/zeros' 2>/dev/null || true",
        "read-only": f"mount -o remount,ro '{disk}'",
    }
    done = on_a_small_disk(
        disk,
        64 * 1024,
        before[fault],
        f"cd '{here}'",
        f"{{ '{POMONA}' {command}; code=$?; find disk -type f; }}",
        "exit $code",
    )
    assert done.returncode == 2, done.stderr
    told = [line for line in done.stderr.splitlines() if not line.startswith("demo: ")]
    assert len(told) == 1, told
    assert told[0].startswith("pomona: disk")
    left = [name for name in done.stdout.splitlines() if name != "disk/zeros"]
    assert [name for name in left if ".partial" in name] == []
    if "--keep" not in command:  # what was kept before is whole
        assert left == []


@pytest.mark.parametrize(
    "command",
    [
        "match query.csv map.csv -o out/pairs.csv --plot out/match.png",
        "export map.csv --to geojson -o out/fruits.json",
        "synth clouds base --seeds 0:100000 -o out",
        "demo -o out",
    ],
)
def test_ctrl_c_is_one_line_and_130(here: Path, command: str) -> None:
    (here / "out").mkdir()
    # Ctrl-C comes at the first write: the writer asks the system to write it out, and is told to end instead.
    program = (
        "import os, signal, sys; from pomona.cli import main; "
        "os.fsync = lambda _: signal.raise_signal(signal.SIGINT); sys.argv[0] = 'pomona'; main()"
    )
    done = subprocess.run([sys.executable, "-c", program, *command.split()], cwd=here, capture_output=True, text=True)
    assert done.returncode == 130, done.stderr
    assert [line for line in done.stderr.splitlines() if not line.startswith("demo: ")] == ["pomona: interrupted"]
    assert done.stdout == ""
    assert list((here / "out").iterdir()) == []


def test_ctrl_c_from_outside_is_the_same(here: Path) -> None:
    writer = subprocess.Popen(
        [POMONA, "synth", "clouds", "base", "--seeds", "0:100000", "-o", "out"],
        cwd=here,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while writer.poll() is None and not (here / "out" / "truth_0.json").exists():
        time.sleep(0.01)
    writer.send_signal(signal.SIGINT)
    printed, told = writer.communicate(timeout=60)
    assert (writer.returncode, printed, told) == (130, "", "pomona: interrupted\n")
    assert list((here / "out").glob(".*")) == []
    for cloud in (here / "out").glob("*.csv"):
        assert len(FruitCloud.read(cloud)) > 100
