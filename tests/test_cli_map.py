"""`pomona map` as a user meets it: exit code, stdout and stderr of a process of its own."""

import json
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pomona import FruitCloud
from pomona.cli import main
from pomona.synth.clouds import scene_pair

POMONA = Path(sys.executable).with_name("pomona")


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([POMONA, "map", *map(str, arguments)], capture_output=True, text=True)


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("visits")
    pair = scene_pair("base", seed=3)
    pair.map.write(folder / "august.csv")
    pair.query.write(folder / "september.csv")
    scene_pair("noov", seed=11).query.write(folder / "elsewhere.csv")
    return folder


@pytest.fixture(scope="module")
def orchard(visits: Path) -> Path:
    """A map with two visits, made by the command."""
    path = visits / "orchard.gpkg"
    first = run("add", path, visits / "august.csv", "--date", "2024-08-01")
    assert (first.returncode, first.stderr) == (0, "")
    n = len(FruitCloud.read(visits / "august.csv"))
    assert first.stdout == f"august: starts the map with {n} fruits\n"
    second = run("add", path, visits / "september.csv", "--date", "2024-09-01", "--json")
    assert (second.returncode, second.stderr) == (0, "")
    answer = json.loads(second.stdout)
    assert answer["added"] is True
    assert answer["status"] == "Found"
    assert answer["n_matched"] + answer["n_new"] == answer["n_fruits"] == len(answer["fruits"])
    assert np.shape(answer["map_from_session"]) == (4, 4)
    return path


def test_info_tells_people_and_programs(orchard: Path) -> None:
    info = json.loads(run("info", orchard, "--json").stdout)
    assert (info["kind"], info["format_version"]) == ("map", 1)
    assert [visit["name"] for visit in info["sessions"]] == ["august", "september"]
    assert info["n_observations"] == sum(visit["n_fruits"] for visit in info["sessions"])
    assert info["n_fruits"] == sum(visit["n_new"] for visit in info["sessions"]) == sum(info["states"].values())
    assert np.shape(info["extent_m"]) == (2, 3)
    text = run("info", orchard).stdout
    assert text.startswith(f"{orchard}: map, format 1\n{info['n_fruits']} fruits (")
    assert text.splitlines()[-1].split()[0] == "september"


def test_check_says_ok_or_what_is_wrong(orchard: Path, tmp_path: Path) -> None:
    done = run("check", orchard)
    assert (done.returncode, done.stdout, done.stderr) == (0, "ok\n", "")
    broken = tmp_path / "broken.gpkg"
    broken.write_bytes(orchard.read_bytes())
    connection = sqlite3.connect(broken)
    with connection:
        connection.execute("UPDATE sessions SET date = '2023-01-01' WHERE name = 'august'")
    connection.close()
    done = run("check", broken, "--json")
    assert done.returncode == 1
    assert all("is not where session august saw it last" in line for line in json.loads(done.stdout)["problems"])


def test_a_session_that_is_elsewhere_is_a_result(orchard: Path, visits: Path) -> None:
    before = orchard.read_bytes()
    done = run("add", orchard, visits / "elsewhere.csv", "--date", "2024-09-02")
    assert done.returncode == 1
    assert done.stdout.startswith("elsewhere: ")
    assert "not found in the map, which stays as it was" in done.stdout
    answer = json.loads(run("add", orchard, visits / "elsewhere.csv", "--date", "2024-09-02", "--json").stdout)
    assert answer["added"] is False
    assert answer["status"] != "Found"
    assert answer["fruits"] == {}
    assert orchard.read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("add", "orchard.gpkg", "august.csv", "--date", "2024-08-01"), "session august is in the map already"),
        (("add", "orchard.gpkg", "august.csv"), "--date YYYY-MM-DD"),
        (("add", "orchard.gpkg", "august.csv", "--date", "yesterday"), "found the date 'yesterday'"),
        (("add", "orchard.gpkg", "absent.csv", "--date", "2024-08-01"), "absent.csv: cannot be read: No such file"),
        (("add", "absent/orchard.gpkg", "august.csv", "--date", "2024-08-01"), "cannot be opened"),
        (("info", "august.csv"), "august.csv: is not a GeoPackage"),
        (("check", "absent.gpkg"), "absent.gpkg: is not there"),
    ],
)
def test_wrong_input_is_one_line(
    orchard: Path,
    arguments: tuple[str, ...],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """In this process, for speed: the words that the command line gives to its `main`."""
    before = {path: path.read_bytes() for path in orchard.parent.iterdir()}
    monkeypatch.chdir(orchard.parent)
    monkeypatch.setattr(sys, "argv", ["pomona", "map", *arguments])
    with pytest.raises(SystemExit) as caught:
        main()
    said = capsys.readouterr()
    assert caught.value.code == 2
    assert said.out == ""
    assert said.err.startswith("pomona: ")
    assert said.err.count("\n") == 1
    assert words in said.err
    assert {path: path.read_bytes() for path in orchard.parent.iterdir()} == before


def test_millimetres_are_warned_of_and_converted(visits: Path, tmp_path: Path) -> None:
    cloud = FruitCloud.read(visits / "august.csv")
    FruitCloud(1000.0 * cloud.positions, ids=cloud.ids).write(tmp_path / "mm.csv")
    done = run("add", tmp_path / "wrong.gpkg", tmp_path / "mm.csv", "--date", "2024-08-01")
    assert done.returncode == 0
    assert done.stderr.startswith("pomona: warning: ")
    assert "--unit mm" in done.stderr
    assert run("add", tmp_path / "right.gpkg", tmp_path / "mm.csv", "--date", "2024-08-01", "--unit", "mm").stderr == ""
    np.testing.assert_allclose(FruitCloud.read(tmp_path / "right.gpkg").positions, cloud.positions, atol=1e-12)
