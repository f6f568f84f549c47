"""Where a file lies until it is whole: a folder beside its place, locked by the run that writes in it."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

__all__ = ["partial_folder"]

SLOTS = 8
"""Runs that write one target at a time and are told apart; the ones after write too, but are not cleaned up."""


@contextlib.contextmanager
def partial_folder(target: Path) -> Iterator[Path]:
    """Give an empty folder beside `target`, which is gone when the block ends.

    A run that is killed leaves its folder, but not the lock on it: the next one for the same target removes it. The
    folder of a run that still writes stays locked and is left alone, however old it is.

    Raises
    ------
    OSError
        When there can be no folder beside `target`.
    """
    folder, lock = _taken(target)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _taken(target: Path) -> tuple[Path, int | None]:
    """Lock the first free folder and remove what killed runs left; without locks, take one of a new name."""
    taken: tuple[Path, int] | None = None
    for number in range(SLOTS):
        folder = target.parent / f".{target.name}.{number}.partial"
        if taken is not None and not folder.is_dir():
            continue
        lock = _cleared(folder, target.name)
        if taken is None and lock is not None:
            taken = folder, lock
        elif lock is not None:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)
    if taken is not None:
        return taken
    return Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".partial", dir=target.parent)), None


def _cleared(folder: Path, name: str) -> int | None:
    """Make or take over a folder, emptied and locked; None where another run has it or nothing can be locked."""
    folder.mkdir(exist_ok=True)
    lock_file = folder / f"{name}.lock"
    lock = None if folder.is_symlink() else _locked(lock_file)
    if lock is None:
        with contextlib.suppress(OSError):
            folder.rmdir()  # which leaves a folder with a lock in it
        return None
    for left in folder.iterdir():
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left)
        elif left != lock_file:
            left.unlink()
    return lock


def _locked(file: Path) -> int | None:
    """Open and lock a file, without waiting; None where that cannot be."""
    try:
        import fcntl

        lock = os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, stat.S_IRUSR | stat.S_IWUSR)
    except (ImportError, OSError):
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # The run that made the file may have removed it between our two calls: then this is a lock on nothing.
        if os.fstat(lock).st_nlink:
            return lock
    except OSError:
        pass
    os.close(lock)
    return None
