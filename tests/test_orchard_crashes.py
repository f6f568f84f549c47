"""The command line on a disk that fails at its N-th change: the map is the one before or the one after; inputs stay."""

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from pomona.orchard import add_session, load_session, problems, write_session
from pomona.synth.clouds import scene_pair

SOURCE = Path(__file__).with_name("native") / "faulty_disk.c"

PLACES = int(os.environ.get("POMONA_CRASHES", "2"))
"""How many places in a run are tried for each way to fail; 0 for every one of them."""

WAYS = {"kill": "kill", "torn write": "tear", "disk full": "28", "disk broken": "5"}


@pytest.fixture(scope="session")
def faulty_disk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library that counts and fails, compiled here."""
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if sys.platform != "linux" or compiler is None:
        pytest.skip("the faulty disk needs Linux and a C compiler")
    library = tmp_path_factory.mktemp("native") / "faulty_disk.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, SOURCE, "-ldl"], check=True)
    return library


@dataclass
class Story:
    """A verb, the files that it finds, and what the map may hold afterwards."""

    files: dict[str, bytes]
    arguments: list[str]
    before: list[object] | None
    after: list[object]


def content(path: Path) -> list[object] | None:
    """Everything in the map's tables; None where there is no map."""
    if not path.exists():
        return None
    connection = sqlite3.connect(path)
    tables = ("sessions", "fruits", "observations", "sightings", "poses", "matches", "changes", "rtree_fruits_geom")
    rows = [
        connection.execute(f"SELECT * FROM {table} ORDER BY 1, 2").fetchall() for table in (*tables, "sqlite_sequence")
    ]
    connection.close()
    return rows


@pytest.fixture(scope="module", params=["start", "add", "remove", "merge"])
def story(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Story:
    """Small maps: a run makes some hundred changes, and each of them can be the last."""
    folder = tmp_path_factory.mktemp("story")
    cloud = scene_pair("base", seed=3).map.select(np.arange(150))
    moved = replace(cloud, positions=cloud.positions + np.random.default_rng(1).normal(0, 0.003, (150, 3)))
    write_session(folder / "a.gpkg", cloud, name="a", date="2024-08-01", recording="test")
    write_session(folder / "b.gpkg", moved.select(np.arange(140)), name="b", date="2024-09-01", recording="test")
    orchard = folder / "orchard.gpkg"
    if request.param != "start":
        add_session(orchard, load_session(folder / "a.gpkg"))
    if request.param == "merge":
        add_session(folder / "other.gpkg", load_session(folder / "b.gpkg"))
    if request.param == "remove":
        add_session(orchard, load_session(folder / "b.gpkg"))
    arguments = {
        "start": ["add", "orchard.gpkg", "a.gpkg"],
        "add": ["add", "orchard.gpkg", "b.gpkg"],
        "remove": ["remove", "orchard.gpkg", "b", "--yes"],
        "merge": ["merge", "orchard.gpkg", "other.gpkg"],
    }[request.param]
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    before = content(orchard)
    done = subprocess.run(
        [sys.executable, "-m", "pomona", "map", *arguments], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    after = content(orchard)
    assert after is not None
    assert after != before
    return Story(files, arguments, before, after)


def run(story: Story, folder: Path, library: Path, at: int, how: str) -> subprocess.CompletedProcess[str]:
    """Lay the files out anew and run the verb on the faulty disk."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, data in story.files.items():
        (folder / name).write_bytes(data)
    faults = {"FAULTY_FOLDER": str(folder), "FAULTY_AT": str(at), "FAULTY_HOW": how}
    environment = {**os.environ, **faults, "FAULTY_COUNT": f"{folder}.count", "LD_PRELOAD": str(library)}
    command = [sys.executable, "-m", "pomona", "map", *story.arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def places(n_changes: int, way: int) -> list[int]:
    """Changes at which to fail: the first, the last, some between; other ones for each way."""
    if not PLACES:
        return list(range(1, n_changes + 1))
    stride = max(1, n_changes // PLACES)
    return sorted({1 + (way * stride // len(WAYS)) % n_changes, n_changes, *range(1 + way, n_changes + 1, stride)})


@pytest.mark.parametrize("way", WAYS)
def test_the_map_is_the_one_before_or_the_one_after(story: Story, way: str, faulty_disk: Path, tmp_path: Path) -> None:
    folder = tmp_path / "disk"
    assert run(story, folder, faulty_disk, 0, "").returncode == 0
    n_changes = int(Path(f"{folder}.count").read_text(encoding="ascii"))
    assert n_changes > 10
    orchard = folder / "orchard.gpkg"
    for at in places(n_changes, list(WAYS).index(way)):
        done = run(story, folder, faulty_disk, at, WAYS[way])
        where = f"{way} at change {at} of {n_changes}: {done.stderr}"
        if WAYS[way] in ("kill", "tear"):
            assert done.returncode == -signal.SIGKILL, where
        else:
            # Not every failure matters: a journal that cannot be deleted is emptied, a folder need not be synced.
            assert done.returncode in (0, 2), where
            assert done.stderr.count("\n") == (done.returncode == 2), where
        assert orchard.exists() or story.before is None, where
        for name in story.files.keys() - {"orchard.gpkg"}:
            assert (folder / name).read_bytes() == story.files[name], where
        if orchard.exists():
            assert problems(orchard) == [], where
        now = content(orchard)
        assert now in (story.before, story.after), where
        if done.returncode == 0:
            assert now == story.after, where
        if done.returncode == 2:
            assert now == story.before, where
