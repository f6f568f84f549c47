"""The index of a map in its file: read as it is, or made anew where it is not what it should be."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pomona.errors import PomonaError, PomonaWarning
from pomona.likes import INDEX, is_like
from pomona.outputs import require_name

__all__ = ["out_of_index"]

T = TypeVar("T")


def out_of_index(
    path: Path, read: Callable[[Path], T], make: Callable[[Path], None], *, absent: Callable[[Path], None] | None = None
) -> T:
    """Read the index at `path`; where that is of another map or version, or damaged, it is made anew first.

    Parameters
    ----------
    path : Path
        The file.
    read : callable
        Reads it, or raises a ValueError that says why it is of no use.
    make : callable
        Makes the index of the map and saves it there; a `PomonaWarning` says so, and why.
    absent : callable, optional
        What is done first where nothing is there; else that is an error.

    Raises
    ------
    PomonaError
        The file is missing or is no index, or of no use where nothing can be written in its place.
    """
    require_name(path)
    if absent is not None and not path.exists():
        absent(path)
    if not path.is_file():
        raise PomonaError(f"{path}: is no file, expected one that Index.save wrote")
    if not is_like(INDEX, path):
        raise PomonaError(f"{path}: is not {INDEX.name}, expected a file that Index.save wrote")
    try:
        return read(path)
    except OSError as error:
        raise PomonaError(f"{path}: {error.strerror}") from None
    except ValueError as error:
        try:
            make(path)
        except PomonaError as failure:
            raise PomonaError(f"{path}: {error}; it cannot be made anew: {failure}") from None
        warnings.warn(f"{path}: {error}; it was made anew", PomonaWarning, stacklevel=3)
    return read(path)
