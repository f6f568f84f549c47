"""Files that a killed writer left, maps that are being made, many writers at once. Real ones, in processes."""

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pyogrio
import pytest

from orchard_maker import scattered, write_two_sessions
from pomona import FruitCloud, PomonaError, atomic
from pomona.orchard import OrchardMap, add_session, load_session, problems, write_session
from pomona.synth.clouds import scene_pair

POMONA = [sys.executable, "-m", "pomona"]

# A writer that dies in the middle of its transaction: pages of the next map are in the file, the journal has the old.
DYING = """
import os, signal, sys
from pathlib import Path
from pomona import geopackage
connection = geopackage.connect(Path(sys.argv[1]))
connection.execute("PRAGMA cache_size = 1")
connection.execute("PRAGMA journal_mode = " + sys.argv[2])
connection.execute("BEGIN")
connection.execute("UPDATE fruits SET n_missed = 9, geom = geom")
connection.execute("UPDATE observations SET n_views = 9, geom = geom")
if sys.argv[2] == "WAL":
    connection.execute("COMMIT")
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Session files of two visits to one row."""
    return write_two_sessions(tmp_path_factory.mktemp("visits"))


@pytest.fixture
def orchard(visits: tuple[Path, Path], tmp_path: Path) -> Path:
    """A map with the first visit, in a folder of its own."""
    (tmp_path / "maps").mkdir()
    path = tmp_path / "maps" / "orchard.gpkg"
    add_session(path, load_session(visits[0]))
    return path


def kill_a_writer(path: Path, mode: str = "DELETE") -> None:
    done = subprocess.run([sys.executable, "-c", DYING, path, mode], capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr


def on_a_read_only_disk(folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    """Run a shell command with the folder read-only, in a namespace that ends with it."""
    mounts = f"mount --bind '{folder}' '{folder}' && mount -o remount,ro,bind '{folder}'"
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-rm", "sh", "-c", mounts]).returncode != 0:
        pytest.skip("no folder can be mounted read-only here")
    return subprocess.run(["unshare", "-rm", "sh", "-c", f"{mounts} && {command}"], capture_output=True, text=True)


def test_a_killed_writer_s_map_is_read_where_nothing_may_be_written(orchard: Path) -> None:
    before = FruitCloud.read(orchard)
    content = orchard.read_bytes()
    kill_a_writer(orchard)
    left = {path: path.read_bytes() for path in orchard.parent.iterdir()}
    assert len(left) == 2
    assert left[orchard] != content
    pomona, fruits = " ".join(POMONA), orchard.parent.parent / "fruits.csv"
    verbs = f"{pomona} map check '{orchard}' && {pomona} export '{orchard}' --to csv -o '{fruits}'"
    done = on_a_read_only_disk(orchard.parent, verbs)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("ok\n")
    assert {path: path.read_bytes() for path in orchard.parent.iterdir()} == left
    after = FruitCloud.read(fruits)
    np.testing.assert_array_equal(after.positions, before.positions)
    assert set(after.extras["n_missed"]) == {"0"}


def test_a_map_of_a_killed_qgis_is_read_where_nothing_may_be_written(orchard: Path) -> None:
    kill_a_writer(orchard, "WAL")
    assert Path(f"{orchard}-wal").stat().st_size > 0
    Path(f"{orchard}-shm").unlink()
    export = f"{' '.join(POMONA)} export '{orchard}' --to csv -o '{orchard.parent.parent}/fruits.csv'"
    done = on_a_read_only_disk(orchard.parent, export)
    assert (done.returncode, done.stderr) == (0, "")
    # What was committed counts, though it is only in the log.
    assert set(FruitCloud.read(orchard.parent.parent / "fruits.csv").extras["n_missed"]) == {"9"}


def test_what_other_programs_do_after_a_kill(orchard: Path) -> None:
    """As docs/formats.md says: to look is refused, to edit puts the map in order, and so does any verb of ours."""
    content = orchard.read_bytes()
    kill_a_writer(orchard)
    with pytest.raises(Exception, match="readonly database"):
        pyogrio.read_info(orchard, layer="fruits")
    assert problems(orchard) == []
    assert orchard.read_bytes() == content
    assert pyogrio.read_info(orchard, layer="fruits")["features"] > 0
    kill_a_writer(orchard)
    local = 'LOCAL_CS["Undefined Cartesian SRS"]'
    tree = np.array([b"\x01\xe9\x03\x00\x00" + bytes(24)], dtype=object)
    names = {"field_data": [np.array(["x"], dtype=object)], "fields": ["name"]}
    pyogrio.raw.write(orchard, tree, layer="trees", append=True, geometry_type="Point Z", crs=local, **names)
    assert problems(orchard) == []
    assert list(orchard.parent.iterdir()) == [orchard]


def test_a_reader_sees_no_map_or_all_of_it(tmp_path: Path, visits: tuple[Path, Path]) -> None:
    path = tmp_path / "orchard.gpkg"
    n = len(FruitCloud.read(visits[0]))
    seen, done = [], threading.Event()

    def look() -> None:
        while not done.is_set():
            if path.exists():
                seen.append(len(OrchardMap(path).fruits()))

    reader = threading.Thread(target=look)
    reader.start()
    add_session(path, load_session(visits[0]))
    done.set()
    reader.join()
    assert set(seen) <= {n}


@pytest.fixture
def no_links(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file system as on a memory card."""

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)


@pytest.mark.usefixtures("no_links")
def test_a_map_starts_where_there_are_no_links(tmp_path: Path, visits: tuple[Path, Path]) -> None:
    path = tmp_path / "orchard.gpkg"
    assert add_session(path, load_session(visits[0])).is_added
    assert add_session(path, load_session(visits[1])).is_added
    assert problems(path) == []
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.usefixtures("no_links")
def test_there_a_reader_is_told_that_the_map_is_being_made(
    tmp_path: Path, visits: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "orchard.gpkg"
    said = []

    def looked_at(*_: object) -> None:
        with pytest.raises(PomonaError) as caught:
            OrchardMap(path)
        said.append(str(caught.value))

    monkeypatch.setattr("pomona.orchard.joining.update_layers", looked_at)
    assert add_session(path, load_session(visits[0])).is_added
    # The first call was for the map beside, which could not be given its name.
    assert said[1:] == [
        f"{path}: is empty: a map that another program is making just now, or never finished; try again"
    ]


def test_a_new_file_takes_nobody_s_name(tmp_path: Path) -> None:
    path = tmp_path / "a"
    writing = atomic.new_file(path)
    writing.__enter__().write_text("late", encoding="utf-8")
    path.write_text("early", encoding="utf-8")
    with pytest.raises(FileExistsError):
        writing.__exit__(None, None, None)
    assert path.read_text(encoding="utf-8") == "early"
    assert list(tmp_path.iterdir()) == [path]


def test_eight_writers_at_once_all_get_in(tmp_path: Path) -> None:
    """None has made the map before: one starts it, the others wait their turn, all are in it."""
    path = tmp_path / "orchard.gpkg"
    cloud = scene_pair("base", seed=3).map
    rng = np.random.default_rng(5)
    names = [f"visit {number}" for number in range(8)]
    for name in names:
        seen = scattered(cloud.select(np.sort(rng.choice(len(cloud), len(cloud) - 20, replace=False))), rng)
        write_session(tmp_path / f"{name}.gpkg", seen, name=name, date="2024-08-01", recording="test")
    commands = [[*POMONA, "map", "add", path, tmp_path / f"{name}.gpkg"] for name in names]
    writers = [subprocess.Popen(one, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for one in commands]
    said = [writer.communicate()[0] for writer in writers]
    assert [writer.returncode for writer in writers] == [0] * 8
    assert sum("starts the map" in line for line in said) == 1
    assert sorted(one.name for one in OrchardMap(path).visits()) == names
    assert problems(path) == []


def test_maps_and_sessions_that_come_at_once_are_all_there(orchard: Path, tmp_path: Path) -> None:
    """Two maps are merged in and two sessions added by four programs; each waits its turn."""
    cloud, rng = scene_pair("base", seed=3).map, np.random.default_rng(6)
    files = []
    for number in range(4):
        seen = scattered(cloud.select(np.sort(rng.choice(len(cloud), len(cloud) - 20, replace=False))), rng)
        files.append(tmp_path / f"later {number}.gpkg")
        write_session(files[-1], seen, name=f"later {number}", date=f"2025-08-0{number + 1}", recording="test")
    others = [tmp_path / f"map {number}.gpkg" for number in range(2)]
    for other, file in zip(others, files[:2], strict=True):
        add_session(other, load_session(file))
    begun = [one.name for one in OrchardMap(orchard).visits()]
    commands = [[*POMONA, "map", "merge", orchard, other] for other in others]
    commands += [[*POMONA, "map", "add", orchard, file] for file in files[2:]]
    writers = [subprocess.Popen(one, stdout=subprocess.DEVNULL) for one in commands]
    assert [writer.wait() for writer in writers] == [0] * 4
    assert {one.name for one in OrchardMap(orchard).visits()} == {*begun, *(file.stem for file in files)}
    assert problems(orchard) == []


def test_a_writer_that_waits_says_so(orchard: Path, visits: tuple[Path, Path]) -> None:
    """Whether others write, read or keep all out, before it begins or when it ends."""
    assert "recognised" in waits_and_says_so(orchard, "BEGIN IMMEDIATE", "map", "add", orchard, visits[1])
    # One who only reads holds up the end.
    assert "takes away 380 observations" in waits_and_says_so(
        orchard, "BEGIN; SELECT * FROM fruits", "map", "remove", orchard, "september", "--yes"
    )


def test_a_reader_that_waits_says_so(orchard: Path, visits: tuple[Path, Path]) -> None:
    assert "1 session" in waits_and_says_so(orchard, "BEGIN EXCLUSIVE", "map", "info", orchard)
    found = waits_and_says_so(orchard, "BEGIN EXCLUSIVE", "match", visits[1], orchard)
    assert found.startswith("Found")


def waits_and_says_so(path: Path, lock: str, *verb: object) -> str:
    """Run a verb while another program holds a file; give what it says once it has let go."""
    other = sqlite3.connect(path, isolation_level=None)
    for statement in lock.split("; "):
        other.execute(statement)
    waiting = subprocess.Popen([*POMONA, *map(str, verb)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert waiting.stderr is not None
    line = waiting.stderr.readline()
    assert line == f"pomona: {path}: another program is using it, waiting up to 60 s\n"
    other.execute("ROLLBACK")
    other.close()
    stdout, stderr = waiting.communicate()
    assert (waiting.returncode, stderr) == (0, "")
    return stdout


def test_a_path_that_no_database_has_is_told(orchard: Path, tmp_path: Path) -> None:
    folder = tmp_path.joinpath(*["f" * 200] * 3)
    folder.mkdir(parents=True)
    deep = folder / "orchard.gpkg"
    deep.write_bytes(orchard.read_bytes())
    line = f"cannot be opened: its whole path has {len(str(deep))} bytes, expected at most 504 of a database"
    with pytest.raises(PomonaError, match=line):
        OrchardMap(deep)
