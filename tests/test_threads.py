"""How many threads: refused alike wherever it is asked for, and never more than there are cores."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pomona as package
from command_line import POMONA, Pomona
from onnx_maker import yolov8
from pomona import PomonaError
from pomona.detect.onnx.network import open_session
from pomona.matching import Index
from pomona.threads import capped_threads, cores

CLOUD = np.random.default_rng(1).uniform(0, 3, (20, 3))


@pytest.mark.parametrize("asked", ["0", "-1", "-99999999999"])
@pytest.mark.parametrize("command", ["match query.csv map.csv", "map add new.gpkg map.csv --date 2024-08-09", "config"])
def test_no_verb_takes_less_than_one(pomona: Pomona, here: Path, command: str, asked: str) -> None:
    code, printed, told = pomona(*command.split(), "--threads", asked)
    assert (code, printed) == (2, "")
    assert told == f"pomona: --threads: found {asked}, expected a whole number from 1\n"
    assert not (here / "new.gpkg").exists()


@pytest.mark.parametrize("asked", ["0", "-1", "1.5", "true", '"2"'])
def test_no_settings_file_does(pomona: Pomona, here: Path, asked: str) -> None:
    (here / "set.toml").write_text(f"[match]\nthreads = {asked}\n")
    for verb in ("config", "match query.csv map.csv"):
        code, printed, told = pomona(*verb.split(), "--config", "set.toml")
        assert (code, printed, told.count("\n")) == (2, "", 1)
        assert "set.toml: match.threads: found " in told
        assert "expected a whole number from 1" in told


@pytest.mark.parametrize("asked", [0, -1, 1.5, True, "2"])
def test_nor_does_python(asked: object, tmp_path: Path) -> None:
    expected = "^threads: found .*, expected a whole number from 1$"
    with pytest.raises(PomonaError, match=expected):
        package.match(CLOUD, CLOUD, threads=asked)  # type: ignore[arg-type]
    with pytest.raises(PomonaError, match=expected):
        Index(CLOUD, threads=asked)  # type: ignore[arg-type]
    path = yolov8(tmp_path / "model.onnx", 64, 64)
    with pytest.raises(PomonaError, match=expected):
        open_session(path, asked)  # type: ignore[arg-type]


def test_more_than_there_are_cores_are_as_many_as_cores() -> None:
    assert capped_threads(99_999_999) == cores() == capped_threads(cores())
    assert capped_threads(1) == 1
    assert capped_threads(None) is None


def test_a_thousand_threads_are_not_started() -> None:
    counted = (
        "import os, numpy, pomona.matching\n"
        "before = len(os.listdir('/proc/self/task'))\n"
        "index = pomona.matching.Index(numpy.random.default_rng(1).uniform(0, 3, (20, 3)), threads=1000)\n"
        "print(len(os.listdir('/proc/self/task')) - before)\n"
    )
    if not Path("/proc/self/task").is_dir():
        pytest.skip("threads cannot be counted here")
    done = subprocess.run([sys.executable, "-c", counted], capture_output=True, text=True, check=True)
    assert int(done.stdout) <= (os.cpu_count() or 1)


def test_far_too_many_give_the_same_answer(here: Path) -> None:
    commands = [[POMONA, "match", "query.csv", "map.csv", "-o", "-", "--threads", n] for n in ("1", "99999999")]
    one, many = (subprocess.run(command, capture_output=True, cwd=here, check=True).stdout for command in commands)
    assert one == many


def test_whole_numbers_of_numpy_are_whole_numbers() -> None:
    assert capped_threads(np.int64(1)) == 1
    assert len(package.match(CLOUD, CLOUD, threads=np.int32(1)).pairs) == len(CLOUD)
    with pytest.raises(PomonaError, match="expected a whole number from 1"):
        capped_threads(np.bool_(True))  # type: ignore[arg-type]
