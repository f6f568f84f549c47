"""`pomona map` as a user meets it: exit code, stdout and stderr of a process of its own."""

import json
import shutil
import sqlite3
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import command_line
from command_line import Run, assert_refused
from pomona import FruitCloud
from pomona.orchard import FORMAT_VERSION, Session, add_session, write_session
from pomona.orchard.session import GUESSED
from pomona.synth.clouds import scene_pair

run = partial(command_line.run, "map")


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
    assert (info["kind"], info["format_version"]) == ("map", FORMAT_VERSION)
    assert [visit["name"] for visit in info["sessions"]] == ["august", "september"]
    assert info["n_observations"] == sum(visit["n_fruits"] for visit in info["sessions"])
    assert 0 < info["n_hanging"] <= info["n_fruits"]
    assert info["n_fruits"] == sum(visit["n_new"] for visit in info["sessions"]) == sum(info["states"].values())
    assert np.shape(info["extent_m"]) == (2, 3)
    text = run("info", orchard).stdout
    assert text.startswith(f"{orchard}: map, format {FORMAT_VERSION}\n{info['n_fruits']} fruits seen so far (")
    assert text.splitlines()[-1].split()[-1] == "september"


def test_info_keeps_its_columns_whatever_a_session_is_called(tmp_path: Path) -> None:
    path = tmp_path / "orchard.gpkg"
    few, many = (FruitCloud(np.random.default_rng(n).uniform(0, 1, (n, 3))) for n in (9, 12))
    long = "row 4, from the road to the shed, " * 20
    add_session(path, Session(long, "2024-08-01", "drawn", few))
    add_session(path, Session("b", "2024-09-01", "drawn", many), new_part=True)
    header, *rows = run("info", path).stdout.splitlines()[4:]
    assert [header.split(), *(row.split()[:7] for row in rows)] == [
        ["part", "date", "fruits", "matched", "new", "method", "noise", "session"],
        ["1", "2024-08-01", "9", "0", "9", "-", "-"],
        ["2", "2024-09-01", "12", "0", "12", "-", "-"],
    ]
    names = header.index("session")
    assert [row[names:] for row in rows] == [long.rstrip(), "b"]
    assert names < 60


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


def test_two_columns_that_were_exchanged_are_told(visits: Path, tmp_path: Path) -> None:
    run("add", tmp_path / "orchard.gpkg", visits / "august.csv", "--date", "2024-08-01")
    cloud = FruitCloud.read(visits / "september.csv")
    FruitCloud(cloud.positions[:, [1, 0, 2]], ids=cloud.ids).write(tmp_path / "exchanged.csv")
    done = run("add", tmp_path / "orchard.gpkg", tmp_path / "exchanged.csv", "--date", "2024-09-01")
    assert done.returncode == 1
    assert "the mirror image of exchanged fits the map, with " in done.stderr
    assert "two columns are exchanged" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("add", "orchard.gpkg", "august.csv", "--date", "2024-08-01"), "session august is in the map already"),
        (("add", "orchard.gpkg", "august.csv"), "--date YYYY-MM-DD"),
        (("add", "orchard.gpkg", "august.csv", "--date", "yesterday"), "found the date 'yesterday'"),
        (
            ("add", "orchard.gpkg", "absent.csv", "--date", "2024-08-01"),
            "absent.csv: not found, expected a fruit cloud",
        ),
        (("add", "absent/orchard.gpkg", "august.csv", "--date", "2024-08-01"), "cannot be written: No such file"),
        (("info", "august.csv"), "august.csv: is not a GeoPackage"),
        (("check", "absent.gpkg"), "absent.gpkg: is not there"),
    ],
)
def test_wrong_input_is_one_line(
    orchard: Path,
    arguments: tuple[str, ...],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    run_here: Run,
) -> None:
    before = {path: path.read_bytes() for path in orchard.parent.iterdir()}
    monkeypatch.chdir(orchard.parent)
    assert_refused(run_here("map", *arguments), words)
    assert {path: path.read_bytes() for path in orchard.parent.iterdir()} == before


def test_millimetres_go_into_a_map_only_where_that_is_said(visits: Path, tmp_path: Path) -> None:
    cloud = FruitCloud.read(visits / "august.csv")
    FruitCloud(1000.0 * cloud.positions, ids=cloud.ids).write(tmp_path / "mm.csv")
    doubtful = ("add", tmp_path / "wrong.gpkg", tmp_path / "mm.csv", "--date", "2024-08-01")
    done = run(*doubtful)
    assert (done.returncode, done.stdout) == (2, "")
    assert "--unit mm" in done.stderr
    assert done.stderr.endswith("; a map takes it as it is with --unit m, in Python unit='m'\n")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "wrong.gpkg").exists()
    assert run(*doubtful, "--unit", "m").returncode == 0
    assert run("add", tmp_path / "right.gpkg", tmp_path / "mm.csv", "--date", "2024-08-01", "--unit", "mm").stderr == ""
    np.testing.assert_allclose(FruitCloud.read(tmp_path / "right.gpkg").positions, cloud.positions, atol=1e-12)


def test_doubtful_sessions_go_into_a_map_only_where_that_is_said(visits: Path, tmp_path: Path) -> None:
    cloud = FruitCloud.read(visits / "august.csv")
    wide = replace(cloud, diameters_m=np.full(len(cloud), 70.0))
    melons = FruitCloud(0.3 * cloud.positions, diameters_m=np.full(len(cloud), 0.3))
    strayed = cloud.positions.copy()
    strayed[5, 2] = 1e6
    doubts = {
        "far": (FruitCloud(1000.0 * cloud.positions), {}, ("--unit", "m"), "neighbouring fruits are"),
        "strayed": (FruitCloud(strayed), {}, ("--unit", "m"), "row 5: found a fruit 1e+06 m from the middle of all"),
        "wide": (wide, {}, ("--unit", "m"), "the median diameter is 70 m"),
        "melons": (melons, {}, ("--unit", "m"), "the median diameter is 0.3 m and neighbouring fruits are 0.0"),
        "undated": (cloud, {"scan": {"date": GUESSED}}, ("--date", "2024-08-02"), "was guessed from the age of files"),
    }
    for name, (doubtful, configuration, flags, words) in doubts.items():
        session, orchard = tmp_path / f"{name}.gpkg", tmp_path / f"{name}-map.gpkg"
        about = {"name": name, "date": "2024-08-01", "recording": "test", "configuration": configuration}
        write_session(session, doubtful, **about)  # type: ignore[arg-type]
        done = run("add", orchard, session)
        assert (done.returncode, done.stdout) == (2, "")
        assert words in done.stderr
        assert flags[0] in done.stderr
        assert not orchard.exists()
        assert run("add", orchard, session, *flags).returncode == 0
    done = run("add", tmp_path / "x.gpkg", tmp_path / "far.gpkg", "--unit", "mm")
    assert done.returncode == 2
    assert "a session is in metres" in done.stderr


def test_remove_undoes_add(orchard: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(orchard, tmp_path))
    before = path.read_bytes()
    told = run("remove", path, "september")
    assert (told.returncode, told.stderr) == (1, f"pomona: {path}: nothing is removed without --yes\n")
    assert told.stdout.startswith("september: ")
    assert told.stdout.endswith("; left: 1 session\n")
    told = run("remove", path, "september", "--json")
    assert (told.returncode, json.loads(told.stdout)["removed"], json.loads(told.stdout)["n_left"]) == (1, False, 1)
    assert path.read_bytes() == before
    done = run("remove", path, "october", "--yes", "--json")
    assert (done.returncode, json.loads(done.stdout)) == (1, {"session": "october", "removed": False})
    assert path.read_bytes() == before
    done = run("remove", path, "september", "--yes", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    answer = json.loads(done.stdout)
    assert (answer["removed"], answer["n_left"]) == (True, 1)
    assert [visit["name"] for visit in json.loads(run("info", path, "--json").stdout)["sessions"]] == ["august"]
    assert run("check", path).stdout == "ok\n"
    done = run("remove", path, "august", "--yes")
    assert done.returncode == 2
    assert "august is its only session, and a map has at least one: delete the file instead" in done.stderr
