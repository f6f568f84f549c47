"""Files and folders that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from pomona.errors import PomonaError
from pomona.outputs import refuse_database
from pomona.partial import partial_folder
from pomona.streams import is_stream, send

__all__ = ["NoLinksError", "filled_folder", "new_file", "whole_file", "whole_folder"]


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary path to write to; it takes the place of `path` when the block ends well.

    The old file stays as it was until then, and for good when the block raises. An orchard map is never replaced. What
    is no regular file, a pipe, a device or the standard output ``-``, gets the bytes when they are all there.

    Raises
    ------
    PomonaError
        When the folder is missing, `path` is a map, or it cannot be written, for example on a full disk.
    """
    path = Path(path)
    with _told(path):
        if is_stream(path):
            with tempfile.TemporaryDirectory(prefix="pomona.") as folder:
                partial = Path(folder) / "stream"
                yield partial
                send(partial, path)
            return
        refuse_database(path)
        target = Path(os.path.realpath(path))
        with partial_folder(target) as folder:
            partial = folder / target.name
            yield partial
            _flush(partial)
            refuse_database(path)  # a map may have come there meanwhile
            partial.replace(target)


@contextlib.contextmanager
def new_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; it becomes `path` when the block ends well and nobody was faster.

    Raises
    ------
    FileExistsError
        When `path` is there by then; it stays as it is.
    NoLinksError
        Where the file system knows no hard links: no other way takes a name only when it is free.
    PomonaError
        When the folder is missing or the file cannot be written.
    """
    path = Path(path)
    with _told(path):
        target = Path(os.path.realpath(path))
        with partial_folder(target) as folder:
            partial = folder / target.name
            yield partial
            _flush(partial)
            try:
                os.link(partial, target)
            except FileExistsError:
                raise
            except OSError as error:
                raise NoLinksError(f"{path}: {error.strerror}") from None


class NoLinksError(Exception):
    """The file system cannot give a file a second name."""


@contextlib.contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """Give a temporary path to make a folder at; it becomes `path`, where nothing is yet, when the block ends well.

    Raises
    ------
    PomonaError
        As `whole_file`, or when `path` is there already.
    """
    path = Path(path)
    with _told(path):
        target = Path(os.path.realpath(path))
        with partial_folder(target) as folder, _named(path, folder / target.name) as partial:
            yield partial
            if target.exists():
                raise PomonaError(f"{path}: is already there, expected a new folder")
            partial.rename(target)


@contextlib.contextmanager
def filled_folder(path: str | Path) -> Iterator[Path]:
    """Give a temporary folder to write files to; they take their places in `path` when the block ends well.

    The folder is made where it does not exist. Other files in it stay, and when the block raises so do all.

    Raises
    ------
    PomonaError
        When the folder cannot be made or written to, for example on a full disk.
    """
    path = Path(path)
    with _told(path):
        target = Path(os.path.realpath(path))
        is_new = not target.exists()
        target.mkdir(parents=True, exist_ok=True)
        try:
            # Within it: of a folder that is mounted nobody may write beside it.
            with partial_folder(target / "files") as folder, _named(path, folder / "files") as partial:
                partial.mkdir()
                yield partial
                _take_places(partial, target)
        finally:
            if is_new:
                with contextlib.suppress(OSError):
                    target.rmdir()  # which leaves a folder with files in it


def _take_places(partial: Path, target: Path) -> None:
    written = sorted(partial.iterdir())
    for file in written:
        _flush(file)
        refuse_database(target / file.name)
    for file in written:
        file.replace(target / file.name)


@contextlib.contextmanager
def _named(path: Path, partial: Path) -> Iterator[Path]:
    """Call what is being written what the user calls it where it cannot be."""
    try:
        yield partial
    except PomonaError as error:
        raise PomonaError(str(error).replace(str(partial), str(path))) from None


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except (FileExistsError, BrokenPipeError):
        raise
    except OSError as error:
        raise PomonaError(f"{path}: cannot be written: {error.strerror or error}") from None


def _flush(partial: Path) -> None:
    """Bring the file to the disk before its name shows it."""
    with partial.open("rb") as written:
        os.fsync(written.fileno())
