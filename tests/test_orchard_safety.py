"""Nothing is lost: a killed writer, a full disk, a second writer leave the last good map. Real ones, in processes."""

import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from command_line import POMONA, assert_refused
from orchard_maker import write_two_sessions
from pomona import PomonaError
from pomona.orchard import OrchardMap, add_session, load_session, problems

# `map add` in a process that kills itself at statement N of its connection, for good: no handler runs, no file is
# closed. With a cache of ten pages SQLite writes into the map itself long before the commit.
DYING = """
import os, signal, sys
from pomona import geopackage
from pomona.orchard import add_session, load_session

connect = geopackage.connect
statements = 0

def watched(*arguments, **options):
    connection = connect(*arguments, **options)
    connection.execute("PRAGMA cache_size = 10")
    connection.set_trace_callback(count)
    return connection

def count(statement):
    global statements
    statements += 1
    if statements == int(sys.argv[3]) or statement == sys.argv[4]:
        os.kill(os.getpid(), signal.SIGKILL)

geopackage.connect = watched
add_session(sys.argv[1], load_session(sys.argv[2]))
print(statements)
"""


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Session files of two visits to one row."""
    return write_two_sessions(tmp_path_factory.mktemp("visits"))


@pytest.fixture(scope="module")
def started(visits: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map with the first visit; tests work on copies."""
    path = tmp_path_factory.mktemp("started") / "orchard.gpkg"
    add_session(path, load_session(visits[0]))
    return path


@pytest.fixture
def orchard(started: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(started, tmp_path))


def map_add(orchard: Path, session: Path, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([POMONA, "map", "add", orchard, session], capture_output=True, text=True, **options)  # type: ignore[call-overload, no-any-return]


def dying_add(orchard: Path, session: Path, at: int = 0, statement: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", DYING, orchard, session, str(at), statement], capture_output=True, text=True
    )


def assert_as_before(orchard: Path, started: Path, next_visit: Path) -> None:
    """The map is whole and holds what it held, byte for byte, and takes the next visit."""
    assert problems(orchard) == []
    assert orchard.read_bytes() == started.read_bytes()
    assert add_session(orchard, load_session(next_visit)).is_added
    assert problems(orchard) == []
    assert not Path(f"{orchard}-journal").exists()


@pytest.fixture(scope="module")
def n_statements(started: Path, visits: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> int:
    """Statements of a `map add` that nobody kills."""
    copy = Path(shutil.copy(started, tmp_path_factory.mktemp("counted")))
    done = dying_add(copy, visits[1])
    assert done.returncode == 0, done.stderr
    assert len(OrchardMap(copy).visits()) == 2
    return int(done.stdout)


@pytest.mark.parametrize("share", [0.05, 0.35, 0.65, 0.95])
def test_a_writer_killed_between_two_statements_leaves_the_map(
    orchard: Path, started: Path, visits: tuple[Path, Path], n_statements: int, share: float
) -> None:
    done = dying_add(orchard, visits[1], at=int(share * n_statements))
    assert done.returncode == -signal.SIGKILL, done.stderr
    if share > 0.5:
        # The kill was a real one: pages of the next map are in the file, the journal knows the old ones.
        assert orchard.read_bytes() != started.read_bytes()
        assert Path(f"{orchard}-journal").stat().st_size > 0
    assert_as_before(orchard, started, visits[1])


def test_a_writer_killed_at_the_commit_leaves_the_map(orchard: Path, started: Path, visits: tuple[Path, Path]) -> None:
    done = dying_add(orchard, visits[1], statement="COMMIT")
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert_as_before(orchard, started, visits[1])


def test_the_command_killed_while_it_writes_leaves_the_map(
    orchard: Path, started: Path, visits: tuple[Path, Path]
) -> None:
    writer = subprocess.Popen([POMONA, "map", "add", orchard, visits[1]], stdout=subprocess.DEVNULL)
    journal = Path(f"{orchard}-journal")
    while writer.poll() is None and not journal.exists():
        time.sleep(0.0005)
    writer.kill()
    if writer.wait() == 0:
        pytest.skip("the command was done before the kill came")
    assert_as_before(orchard, started, visits[1])


def test_a_killed_start_can_be_started_again(tmp_path: Path, visits: tuple[Path, Path]) -> None:
    path = tmp_path / "orchard.gpkg"
    done = dying_add(path, visits[0], statement="COMMIT")
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert add_session(path, load_session(visits[0])).is_added
    assert problems(path) == []
    # The killed one had not given its map a name yet.
    assert [left for left in tmp_path.iterdir() if left.suffix != ".partial"] == [path]


def test_a_file_that_may_not_grow_leaves_the_map(orchard: Path, started: Path, visits: tuple[Path, Path]) -> None:
    limit = orchard.stat().st_size + 8192
    done = map_add(orchard, visits[1], preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    assert_refused(done, f"pomona: {orchard}: ", "the file is as it was before")
    assert_as_before(orchard, started, visits[1])


def on_a_small_disk(folder: Path, size: int, *commands: str) -> subprocess.CompletedProcess[str]:
    """Run shell commands with a file system of `size` bytes on `folder`, in a namespace that ends with them."""
    mount = f"mount -t tmpfs -o size={size} none '{folder}'"
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-rm", "sh", "-c", mount]).returncode != 0:
        pytest.skip("no small file system can be mounted here")
    return subprocess.run(
        ["unshare", "-rm", "sh", "-c", " && ".join([mount, *commands])], capture_output=True, text=True
    )


def test_a_full_disk_leaves_the_map(tmp_path: Path, started: Path, visits: tuple[Path, Path]) -> None:
    disk, rescued = tmp_path / "disk", tmp_path / "rescued.gpkg"
    disk.mkdir()
    orchard = disk / "orchard.gpkg"
    done = on_a_small_disk(
        disk,
        started.stat().st_size + 64 * 1024,
        f"cp '{started}' '{orchard}'",
        f"{{ '{POMONA}' map add '{orchard}' '{visits[1]}'; code=$?; ls '{disk}' >&2; }}",
        f"cp '{orchard}' '{rescued}'",
        "exit $code",
    )
    refusal, left = done.stderr.splitlines()
    assert done.returncode == 2
    assert refusal == f"pomona: {orchard}: the disk is full; the file is as it was before"
    assert left == "orchard.gpkg"
    assert_as_before(rescued, started, visits[1])


def test_a_full_disk_leaves_nothing_of_a_new_file(tmp_path: Path, visits: tuple[Path, Path]) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    for verb in (
        f"map add '{disk}/orchard.gpkg' '{visits[0]}'",
        f"export '{visits[0]}' --to geojson -o '{disk}/a.json'",
    ):
        done = on_a_small_disk(disk, 16 * 1024, f"{{ '{POMONA}' {verb}; code=$?; ls -A '{disk}'; }}", "exit $code")
        assert done.returncode == 2, done.stderr
        assert done.stdout == ""
        assert done.stderr.count("\n") == 1
        assert str(disk) in done.stderr


def test_a_read_only_disk_is_read_and_not_written(tmp_path: Path, started: Path, visits: tuple[Path, Path]) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    orchard = disk / "orchard.gpkg"
    done = on_a_small_disk(
        disk,
        4 * started.stat().st_size,
        f"cp '{started}' '{orchard}'",
        f"mount -o remount,ro '{disk}'",
        f"'{POMONA}' map check '{orchard}'",
        f"'{POMONA}' map add '{orchard}' '{visits[1]}'",
    )
    assert done.returncode == 2
    assert done.stdout == "ok\n"
    assert done.stderr == f"pomona: {orchard}: cannot be written: the file or its folder is read-only\n"


def test_a_map_is_merged_from_a_read_only_disk_and_not_into_one(
    tmp_path: Path, started: Path, visits: tuple[Path, Path]
) -> None:
    disk, elsewhere, merged = tmp_path / "disk", tmp_path / "other.gpkg", tmp_path / "merged.gpkg"
    disk.mkdir()
    orchard = disk / "orchard.gpkg"
    add_session(elsewhere, load_session(visits[1]))
    before = elsewhere.read_bytes()
    done = on_a_small_disk(
        disk,
        4 * started.stat().st_size,
        f"cp '{started}' '{orchard}'",
        f"mount -o remount,ro '{disk}'",
        f"'{POMONA}' map merge '{orchard}' '{elsewhere}' -o '{merged}'",
        f"'{POMONA}' map merge '{orchard}' '{elsewhere}'",
    )
    assert done.returncode == 2
    assert done.stderr == f"pomona: {orchard}: cannot be written: the file or its folder is read-only\n"
    assert elsewhere.read_bytes() == before
    assert len(OrchardMap(merged).visits()) == 2
    assert problems(merged) == []


def test_a_second_writer_waits_and_is_told(orchard: Path, started: Path, visits: tuple[Path, Path]) -> None:
    other = sqlite3.connect(orchard, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(PomonaError) as caught:
        add_session(orchard, load_session(visits[1]), timeout_s=0.05)
    assert str(caught.value) == f"{orchard}: another program is using it, try again when it is done"
    # Readers are not kept waiting.
    assert len(OrchardMap(orchard).fruits()) == len(OrchardMap(started).fruits())
    other.execute("ROLLBACK")
    other.close()
    assert_as_before(orchard, started, visits[1])


def test_a_reader_that_does_not_go_is_told_of(orchard: Path, started: Path, visits: tuple[Path, Path]) -> None:
    """The commit has to wait for readers; when they stay, the map is as it was."""
    reader = sqlite3.connect(orchard, isolation_level=None)
    reader.execute("BEGIN")
    reader.execute("SELECT count(*) FROM fruits").fetchone()
    with pytest.raises(PomonaError, match="another program is using it"):
        add_session(orchard, load_session(visits[1]), timeout_s=0.05)
    reader.execute("COMMIT")
    reader.close()
    assert_as_before(orchard, started, visits[1])


def test_a_map_that_qgis_has_open_takes_a_visit(orchard: Path, visits: tuple[Path, Path]) -> None:
    """QGIS switches a file to a write-ahead log; what we write must be in the file when we are done."""
    qgis = sqlite3.connect(orchard)
    assert qgis.execute("PRAGMA journal_mode = WAL").fetchone() == ("wal",)
    assert add_session(orchard, load_session(visits[1])).is_added
    assert qgis.execute("SELECT count(*) FROM sessions").fetchone() == (2,)
    qgis.close()
    assert list(orchard.parent.iterdir()) == [orchard]
    assert problems(orchard) == []


def test_two_writers_at_once_both_get_in(tmp_path: Path, visits: tuple[Path, Path]) -> None:
    """Who is first starts the map, the other one waits and is recognised in it."""
    path = tmp_path / "orchard.gpkg"
    writers = [subprocess.Popen([POMONA, "map", "add", path, session], stdout=subprocess.PIPE) for session in visits]
    said = [writer.communicate()[0].decode() for writer in writers]
    assert [writer.returncode for writer in writers] == [0, 0]
    assert sum("starts the map" in line for line in said) == 1
    assert sum("recognised" in line for line in said) == 1
    assert problems(path) == []


def test_no_writer_leaves_anything_beside_the_map(orchard: Path, visits: tuple[Path, Path]) -> None:
    assert map_add(orchard, visits[1]).returncode == 0
    assert list(orchard.parent.iterdir()) == [orchard]
