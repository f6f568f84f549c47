"""What several tests need."""

import os
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from command_line import Pomona, Run
from growth_maker import HARVEST, GrownRow, grow_row
from page_maker import chromium
from pomona import FruitCloud, Views
from pomona.cli import main
from pomona.growth.season_growth import SeasonGrowth, grow_season
from pomona.orchard import add_session, load_session, write_session
from pomona.synth.clouds import scene_pair
from recording_maker import make_recording


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings; tests that need it are skipped where it is absent."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("POMONA_DATA", beside))
    if not (folder / "kinect_apples").is_dir():
        pytest.skip(f"no real recordings: {folder} has no kinect_apples; set POMONA_DATA to the folder that has")
    return folder


@pytest.fixture(scope="session")
def full_cloud() -> FruitCloud:
    """Six fruits with everything that a cloud can have."""
    rng = np.random.default_rng(5)
    spread_m = 0.02 * rng.normal(size=(6, 3, 3))
    return FruitCloud(
        positions=rng.normal(size=(6, 3)),
        ids=tuple(f"apple {row}" for row in range(6)),
        diameters_m=np.array([0.07, np.nan, 0.071, 0.08, 0.0655, 0.069]),
        covariances=spread_m @ spread_m.transpose(0, 2, 1),
        n_views=np.arange(6),
        views=Views(frames=np.array([4, 4, 9]), fruits=np.array([0, 2, 2])),
        extras={"note": tuple("abcdef")},
    )


@pytest.fixture
def run_here(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """The command line, in this process: what a process of its own would give, faster."""

    def run_main(*arguments: object) -> subprocess.CompletedProcess[str]:
        monkeypatch.setattr(sys, "argv", ["pomona", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capsys.readouterr()
        assert isinstance(ended.value.code, int)
        return subprocess.CompletedProcess(arguments, ended.value.code, printed.out, printed.err)

    return run_main


@pytest.fixture
def pomona(run_here: Run) -> Pomona:
    """The command line, in this process, in short."""

    def ran(*arguments: object) -> tuple[int, str, str]:
        done = run_here(*arguments)
        return done.returncode, done.stdout, done.stderr

    return ran


@pytest.fixture(scope="session")
def season(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two visits as CSV, a session, a map, another database, and a recording with boxes."""
    folder = tmp_path_factory.mktemp("season")
    pair = scene_pair("base", seed=3)
    pair.query.write(folder / "query.csv")
    pair.map.write(folder / "map.csv")
    write_session(folder / "session.gpkg", pair.map, name="august", date="2024-08-01", recording="test")
    add_session(folder / "orchard.gpkg", load_session(folder / "session.gpkg"))
    with sqlite3.connect(folder / "other.sqlite") as connection:
        connection.execute("CREATE TABLE years_of_work (day TEXT)")
    connection.close()
    recording = make_recording(folder / "R", (0.0, 0.1, 0.2))
    (recording / "left").mkdir()
    for depth in (recording / "depth").iterdir():
        cv2.imwrite(str(recording / "left" / depth.name), np.full((480, 640, 3), 99, np.uint8))
    return folder


@pytest.fixture
def here(season: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it to work in, which is the working directory."""
    folder = Path(shutil.copytree(season, tmp_path / "season"))
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="session")
def grown_row(tmp_path_factory: pytest.TempPathFactory) -> GrownRow:
    """Four visits to three trees; nobody writes to the map."""
    return grow_row(tmp_path_factory.mktemp("grown_row") / "orchard.gpkg")


@pytest.fixture(scope="session")
def row_growth(grown_row: GrownRow) -> SeasonGrowth:
    """How its fruits grow, foretold for the harvest."""
    return grow_season(grown_row.path, harvest=HARVEST)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """One for all tests of a file."""
    with chromium() as running:
        yield running
