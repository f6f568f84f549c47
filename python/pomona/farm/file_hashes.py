"""What files hold, as a hash; a file is read again only when its size or its time of change is another."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from pomona.errors import PomonaError
from pomona.farm.ledger import Stamp

__all__ = ["FileHashes", "is_there", "stamps"]

CHUNK_BYTES = 1 << 20


class FileHashes:
    """SHA-256 of files.

    Parameters
    ----------
    known : mapping
        What was found before: stamp and hash by path.

    Attributes
    ----------
    found : dict
        What is new: stamp and hash by path.
    """

    def __init__(self, known: Mapping[str, tuple[Stamp, str]]) -> None:
        self.known = known
        self.found: dict[str, tuple[Stamp, str]] = {}

    def of(self, path: Path) -> str:
        """Return the hash of a file, or of the names and hashes of all that is in a folder.

        Raises
        ------
        PomonaError
            It cannot be read, or changes while it is read.
        """
        if not path.is_dir():
            return self._of_file(path)
        digest = hashlib.sha256()
        for file in files_in(path):
            digest.update(f"{file.relative_to(path).as_posix()}\0{self._of_file(file)}\n".encode())
        return digest.hexdigest()

    def _of_file(self, path: Path) -> str:
        try:
            before = _stamp(path)
            stamp, digest = self.found.get(str(path)) or self.known.get(str(path)) or (None, "")
            if stamp == before:
                return digest
            digest = _sha256_of(path)
            if _stamp(path) != before:
                raise PomonaError(f"{path}: changes while it is read, expected a recording that has ended")
        except OSError as error:
            raise PomonaError(f"{path}: cannot be read: {error.strerror}") from None
        self.found[str(path)] = before, digest
        return digest


def stamps(paths: Iterable[Path]) -> dict[Path, Stamp | None]:
    """Say how large and how old files are, with those in folders; None for one that is not there."""
    return {file: _stamp_or_none(file) for path in paths for file in (files_in(path) if path.is_dir() else [path])}


def is_there(output: Path) -> bool:
    """Tell whether a step's output is still there; none is empty."""
    return output.is_dir() or (output.is_file() and output.stat().st_size > 0)


def files_in(folder: Path) -> Iterator[Path]:
    """Give all files in a folder and in those within, hidden ones left out, in the order of their names."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir():
            yield from files_in(path)
        else:
            yield path


def _sha256_of(path: Path) -> str:
    with path.open("rb") as stream:
        digest = hashlib.sha256()
        while chunk := stream.read(CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


def _stamp(path: Path) -> Stamp:
    found = path.stat()
    return found.st_size, found.st_mtime_ns


def _stamp_or_none(path: Path) -> Stamp | None:
    try:
        return _stamp(path)
    except OSError:
        return None
