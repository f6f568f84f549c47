"""Nothing is lost: what an output may take the place of, asked before any work begins."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from pomona.errors import PomonaError
from pomona.likes import Like, database_of, is_like
from pomona.streams import is_device, is_standard_output, is_stream

JOURNALS = ("-journal", "-wal", "-shm")
"""What SQLite calls its files beside a map: they hold what a killed writer left, and SQLite removes them."""

FORCE = "--force to replace it"
"""What else there is to do, on the command line, about a file that is in the way."""

__all__ = ["Output", "holding", "refuse_database", "refuse_inputs", "require_name", "require_outputs"]


@dataclass(frozen=True)
class Output:
    """A file or folder that is about to be written.

    Attributes
    ----------
    path : Path
        Where.
    like : Like
        What it will be, and so what it may replace.
    """

    path: Path
    like: Like


def require_outputs(
    outputs: Sequence[Output], inputs: Iterable[Path], *, force: bool = False, otherwise: str = FORCE
) -> None:
    """Refuse outputs that would destroy something.

    Parameters
    ----------
    outputs : sequence of Output
        All that one call writes.
    inputs : iterable of Path
        All that it reads.
    force : bool
        Replace what is not alike too; but never an input, and no database that is not a session.
    otherwise : str
        What the caller can do about a file in the way instead of taking another name.

    Raises
    ------
    PomonaError
        When an output has no name that a file can have; is an input, by whatever name; lies where nothing can be
        written; is a map or another database; is there already and not of the kind; or is the same as another output.
    """
    for output in outputs:
        require_name(output.path)
    refuse_inputs([output.path for output in outputs], inputs)
    for output in outputs:
        _require_place(output)
        if not is_stream(output.path) and not output.like.is_folder:
            refuse_database(output.path)
        if not force:
            _require_like(output, otherwise)
    for one, other in combinations((output.path for output in outputs), 2):
        if _are_same(one, other):
            raise PomonaError(f"{one} and {other} are the same file, expected two to write")


def holding(outputs: Iterable[Path]) -> list[Path]:
    """Return those outputs that are files with something in them, which writing would replace."""
    return [path for path in outputs if path.is_file() and path.stat().st_size > 0]


def refuse_inputs(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Refuse outputs that are inputs, through links of both kinds too, and folders of outputs with an input in them.

    Raises
    ------
    PomonaError
        Naming both.
    """
    outputs = list(outputs)
    for read in inputs:
        for output in outputs:
            if _are_same(output, read):
                raise PomonaError(f"{output}: is the input {read}, expected another place to write")
            if output.is_dir() and _real(read).is_relative_to(_real(output)):
                raise PomonaError(f"{output}: is the folder of the input {read}, expected another place to write")


def refuse_database(path: Path) -> None:
    """Refuse to replace a map or another database than a session, whoever asks: it may hold years of visits.

    Raises
    ------
    PomonaError
        When there is one.
    """
    if path.name.endswith(JOURNALS):
        raise PomonaError(f"{path}: is the name of a database's journal, which no output takes: take another name")
    found = database_of(path)
    if found == "map":
        raise PomonaError(f"{path}: is an orchard map, which no output replaces: take another name")
    if found == "other":
        raise PomonaError(
            f"{path}: is a database and no session of this program, which no output replaces: take another name, or "
            "remove it first"
        )


def require_name(path: Path) -> None:
    """Refuse what no file can be called; the system's own functions say so in exceptions that nobody expects.

    Raises
    ------
    PomonaError
        Where the name has a NUL.
    """
    if "\0" in str(path):
        raise PomonaError(f"{str(path)!r}: has a NUL in it, expected the name of a file")


def _require_like(output: Output, otherwise: str) -> None:
    path = output.path
    if path.exists() and not is_stream(path) and not is_like(output.like, path):
        raise PomonaError(f"{path}: is there already and is not {output.like.name}: take another name, or {otherwise}")


def _require_place(output: Output) -> None:
    path = output.path
    if is_stream(path):
        if output.like.is_folder or (path.exists() and stat.S_ISBLK(path.stat().st_mode)):
            raise PomonaError(f"{path}: is a device or a pipe, expected {output.like.name}")
    elif output.like.is_folder:
        if path.exists() and not path.is_dir():
            raise PomonaError(f"{path}: is a file, expected {output.like.name}")
    elif path.is_dir():
        raise PomonaError(f"{path}: is a folder, expected a file to write")
    elif not _real(path).parent.is_dir():
        link = f"is a link to {_real(path)}, and " if path.is_symlink() else ""
        raise PomonaError(f"{path}: {link}the folder {_real(path).parent if link else path.parent} is not there")
    elif not os.access(_real(path).parent, os.W_OK | os.X_OK):
        raise PomonaError(f"{path}: cannot be written: the folder {path.parent} is read-only")


def _are_same(one: Path, other: Path) -> bool:
    if is_standard_output(one) and is_standard_output(other):
        return True
    if is_device(one) or is_device(other):
        return False
    if _real(one) == _real(other):
        return True
    try:
        return one.samefile(other)
    except OSError:
        return False


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))
