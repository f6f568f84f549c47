"""Outputs that are no files: the standard output, pipes and devices, which are written straight into."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import sys
from pathlib import Path

__all__ = ["STANDARD_OUTPUT", "is_device", "is_standard_output", "is_stream", "send"]

STANDARD_OUTPUT = Path("-")
"""The name of the standard output, as other programs have it."""


def is_stream(path: Path) -> bool:
    """Tell whether a path is written straight into: there is something, and it is neither a file nor a folder."""
    mode = _mode(path)
    return is_standard_output(path) or (mode != 0 and not stat.S_ISREG(mode) and not stat.S_ISDIR(mode))


def is_device(path: Path) -> bool:
    """Tell a character device, such as ``/dev/null`` or a terminal, which holds nothing that could be lost."""
    return stat.S_ISCHR(_mode(path))


def is_standard_output(path: Path) -> bool:
    """Tell the standard output by its name ``-`` or by what it is, such as ``/dev/stdout`` or the file it goes to."""
    if path == STANDARD_OUTPUT:
        return True
    try:
        return os.path.samestat(path.stat(), os.fstat(sys.stdout.fileno()))
    except (OSError, ValueError, AttributeError):  # a standard output that is closed, or is none of the system's
        return False


def send(file: Path, stream: Path) -> None:
    """Copy the bytes of a file into a stream.

    Raises
    ------
    OSError
        When the other end is closed, or the device is full.
    """
    with file.open("rb") as whole:
        if is_standard_output(stream):
            if sys.stdout is None:
                raise OSError(errno.EBADF, os.strerror(errno.EBADF))
            sys.stdout.flush()
            shutil.copyfileobj(whole, sys.stdout.buffer)
            sys.stdout.buffer.flush()
            return
        # Nothing is made or cut here: what is no stream any more was not meant.
        with os.fdopen(os.open(stream, os.O_WRONLY), "wb") as end:
            shutil.copyfileobj(whole, end)


def _mode(path: Path) -> int:
    try:
        return path.stat().st_mode
    except (OSError, ValueError):
        return 0
