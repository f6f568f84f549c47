"""Files appear whole or not at all: what killed runs left goes, what others write stays, streams are written into."""

import os
import signal
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from pomona import FruitCloud, PomonaError
from pomona.atomic import filled_folder, whole_file, whole_folder
from pomona.orchard import add_session, load_session, write_session
from pomona.synth.clouds import scene_pair

# Writes half of a file, a journal beside it, says so, and waits for its end.
WRITING = """
import sys
from pomona.atomic import whole_file

with whole_file(sys.argv[1]) as partial:
    partial.write_text("half")
    partial.with_name(f"{partial.name}-journal").write_text("half")
    print("begun", flush=True)
    sys.stdin.read()
"""


def begin(target: Path) -> subprocess.Popen[str]:
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITING, target], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert writer.stdout is not None
    assert writer.stdout.readline() == "begun\n"
    return writer


def end(writer: subprocess.Popen[str], how: signal.Signals | None) -> None:
    """End a writer: by a signal, or well."""
    if how is not None:
        writer.send_signal(how)
    writer.communicate()


def write(target: Path, text: str, then: Callable[[], object] = lambda: None) -> None:
    """Write a file; `then` happens in between."""
    with whole_file(target) as partial:
        partial.write_text(text)
        then()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_what_a_killed_run_left_goes_with_the_next(tmp_path: Path, how: signal.Signals) -> None:
    target = tmp_path / "fruits.csv"
    end(begin(target), how)
    assert names(tmp_path) != []  # the kill was a real one
    write(target, "whole")
    assert names(tmp_path) == ["fruits.csv"]
    assert target.read_text() == "whole"


def test_all_that_several_killed_runs_left_goes(tmp_path: Path) -> None:
    target = tmp_path / "fruits.csv"
    writers = [begin(target) for _ in range(3)]
    assert len(names(tmp_path)) == 3
    for writer in writers:
        end(writer, signal.SIGKILL)
    write(target, "whole")
    assert names(tmp_path) == ["fruits.csv"]


def test_a_run_that_still_writes_is_left_alone(tmp_path: Path) -> None:
    target = tmp_path / "fruits.csv"
    other = begin(target)
    write(target, "ours")
    assert target.read_text() == "ours"
    end(other, None)
    assert other.returncode == 0
    assert target.read_text() == "half"  # all that the other had to say: the last one counts
    assert names(tmp_path) == ["fruits.csv"]


def test_more_runs_at_a_time_than_are_told_apart_all_write(tmp_path: Path) -> None:
    target = tmp_path / "fruits.csv"
    writers = [begin(target) for _ in range(9)]
    assert len(names(tmp_path)) == 9
    for writer in writers:
        end(writer, None)
    assert [writer.returncode for writer in writers] == [0] * 9
    assert names(tmp_path) == ["fruits.csv"]


def test_a_link_where_the_partial_folder_would_be_is_not_followed(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "precious").write_text("")
    (tmp_path / ".fruits.csv.0.partial").symlink_to(elsewhere)
    write(tmp_path / "fruits.csv", "whole")
    assert names(elsewhere) == ["precious"]


def test_what_raises_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "fruits.csv"
    target.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        write(target, "half", then=lambda: signal.raise_signal(signal.SIGINT))
    assert target.read_text() == "old"
    assert names(tmp_path) == ["fruits.csv"]


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link.csv").symlink_to("there/fruits.csv")
    write(tmp_path / "link.csv", "whole")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "there" / "fruits.csv").read_text() == "whole"


def test_a_new_file_may_be_read_by_whom_the_umask_says(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write(tmp_path / "fruits.csv", "whole")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "fruits.csv").stat().st_mode) == 0o640


def test_a_folder_appears_whole_where_nothing_is(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "row") as partial:
        partial.mkdir()
        (partial / "a").write_text("")
        assert not (tmp_path / "row").exists()
    assert names(tmp_path) == ["row"]
    with pytest.raises(PomonaError, match="already there"), whole_folder(tmp_path / "row") as partial:
        partial.mkdir()
    assert names(tmp_path / "row") == ["a"]
    assert names(tmp_path) == ["row"]


def test_a_pipe_gets_the_bytes_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    write(pipe, "whole")
    reader.join()
    assert read == ["whole"]
    assert pipe.is_fifo()
    assert names(tmp_path) == ["pipe"]


def test_a_device_stays_a_device(tmp_path: Path) -> None:
    device = tmp_path / "null"
    try:
        os.mknod(device, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    except PermissionError:
        pytest.skip("no device can be made here")
    write(device, "whole")
    assert device.is_char_device()
    assert names(tmp_path) == ["null"]


def test_a_device_that_is_full_is_told() -> None:
    with pytest.raises(PomonaError, match=r"^/dev/full: cannot be written: No space left on device$"):
        write(Path("/dev/full"), "whole")


@pytest.fixture(scope="module")
def orchard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map with one visit, and beside it session.gpkg."""
    folder = tmp_path_factory.mktemp("orchard")
    cloud = scene_pair("base", seed=3).map
    write_session(folder / "session.gpkg", cloud, name="august", date="2024-08-01", recording="test")
    add_session(folder / "orchard.gpkg", load_session(folder / "session.gpkg"))
    return folder / "orchard.gpkg"


def test_python_never_replaces_a_map(orchard: Path) -> None:
    before = orchard.read_bytes()
    cloud = FruitCloud.read(orchard)
    with pytest.raises(PomonaError, match=r"orchard\.gpkg: is an orchard map"):
        write_session(orchard, cloud, name="august", date="2024-08-01", recording="test")
    with pytest.raises(PomonaError, match="is an orchard map"):
        write(orchard, "")
    assert orchard.read_bytes() == before


def test_python_replaces_a_session(orchard: Path, tmp_path: Path) -> None:
    session = tmp_path / "session.gpkg"
    session.write_bytes(orchard.with_name("session.gpkg").read_bytes())
    write_session(session, FruitCloud.read(session), name="again", date="2024-08-01", recording="test")
    assert load_session(session).name == "again"


def test_a_map_that_came_while_it_was_written_stays(orchard: Path, tmp_path: Path) -> None:
    target = tmp_path / "fruits.gpkg"
    with pytest.raises(PomonaError, match="is an orchard map"):
        write(target, "whole", then=lambda: target.write_bytes(orchard.read_bytes()))
    assert target.read_bytes() == orchard.read_bytes()


def fill(folder: Path, text: str, failing: str = "") -> None:
    """Write series.csv; then fail where `failing` says with what."""
    with filled_folder(folder) as partial:
        (partial / "series.csv").write_text(text)
        if failing:
            raise PomonaError(failing.format(partial))


def test_files_of_a_folder_take_their_places_together_or_not_at_all(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "growth"
    with pytest.raises(PomonaError, match=rf"^{folder}/fruits.csv: no space$"):
        fill(folder, "half", "{}/fruits.csv: no space")
    assert not folder.exists()
    fill(folder, "first")
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(PomonaError, match="no space"):
        fill(folder, "half", "no space")
    assert (folder / "series.csv").read_text() == "first"
    fill(folder, "second")
    assert (folder / "series.csv").read_text() == "second"
    assert names(folder) == ["notes.txt", "series.csv"]
