"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from pomona.errors import PomonaError

__all__ = ["NoLinksError", "new_file", "whole_file"]


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to; it takes the place of `path` when the block ends well.

    The old file stays as it was until then, and for good when the block raises.

    Raises
    ------
    PomonaError
        When the folder is missing or the file cannot be written, for example on a full disk.
    """
    with _partial(path) as (partial, target):
        yield partial
        _finish(partial)
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
    with _partial(path) as (partial, target):
        yield partial
        _finish(partial)
        try:
            os.link(partial, target)
        except FileExistsError:
            raise
        except OSError as error:
            raise NoLinksError(f"{path}: {error.strerror}") from None


class NoLinksError(Exception):
    """The file system cannot give a file a second name."""


@contextlib.contextmanager
def _partial(path: str | Path) -> Iterator[tuple[Path, Path]]:
    """Give a temporary file beside the target, and the target; what is left of it goes with the block."""
    target = Path(path).resolve()
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".partial", dir=target.parent)
        os.close(handle)
    except OSError as error:
        raise PomonaError(f"{path}: cannot be written: {error.strerror}") from None
    partial = Path(name)
    try:
        yield partial, target
    except FileExistsError:
        raise
    except OSError as error:
        raise PomonaError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        # What is done is done, even where the disk does not let go of what is left over.
        with contextlib.suppress(OSError):
            partial.unlink()


def _finish(partial: Path) -> None:
    """Bring the file to the disk, with the permissions of any new file."""
    with partial.open("rb") as written:
        os.fsync(written.fileno())
    partial.chmod(0o666 & ~_umask())


def _umask() -> int:
    # The process's umask can only be read by setting it.
    mask = os.umask(0)
    os.umask(mask)
    return mask
