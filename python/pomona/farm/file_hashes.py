"""What files hold, as a hash; a file is read again only when its size or its time of change is another."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path

from pomona.atomic import whole_file
from pomona.errors import PomonaError

__all__ = ["ChangedMeanwhileError", "FileHashes", "Stamp", "stamps"]

CHUNK_BYTES = 1 << 20

Stamp = tuple[int, int]
"""Size in bytes, time of the last change in nanoseconds."""


class ChangedMeanwhileError(PomonaError):
    """A file is written while it is read."""


class FileHashes:
    """SHA-256 of files, remembered in a file of their own.

    Parameters
    ----------
    memory : Path
        Where they are remembered; what cannot be read there is forgotten.
    """

    def __init__(self, memory: Path) -> None:
        self.memory = memory
        self.known: dict[str, tuple[Stamp, str]] = {}
        try:
            for name, ((size, time_ns), digest) in json.loads(memory.read_text(encoding="utf-8")).items():
                self.known[name] = (int(size), int(time_ns)), str(digest)
        except (OSError, ValueError, AttributeError, TypeError):
            self.known = {}
        self.is_new = False

    def of(self, path: Path) -> str:
        """Return the hash of a file, or of the names and hashes of all that is in a folder.

        Raises
        ------
        PomonaError
            It cannot be read.
        ChangedMeanwhileError
            It changes while it is read.
        """
        if path.is_dir():
            digest = hashlib.sha256()
            for file in files_in(path):
                digest.update(f"{file.relative_to(path).as_posix()}\0{self._of_file(file)}\n".encode())
            return digest.hexdigest()
        return self._of_file(path)

    def save(self) -> None:
        """Remember, for the next run."""
        if self.is_new:
            with whole_file(self.memory) as partial:
                partial.write_text(json.dumps(self.known), encoding="utf-8")
            self.is_new = False

    def _of_file(self, path: Path) -> str:
        try:
            before = _stamp(path)
            name = str(path)
            if name in self.known and self.known[name][0] == before:
                return self.known[name][1]
            with path.open("rb") as stream:
                digest = hashlib.sha256()
                while chunk := stream.read(CHUNK_BYTES):
                    digest.update(chunk)
            if _stamp(path) != before:
                raise ChangedMeanwhileError(f"{path}: changes while it is read, expected a recording that has ended")
        except OSError as error:
            raise PomonaError(f"{path}: cannot be read: {error.strerror}") from None
        self.known[name] = before, digest.hexdigest()
        self.is_new = True
        return digest.hexdigest()


def stamps(paths: Iterable[Path]) -> dict[Path, Stamp | None]:
    """Say how large and how old files are, with those in folders; None for one that is not there."""
    return {file: _stamp_or_none(file) for path in paths for file in (files_in(path) if path.is_dir() else [path])}


def files_in(folder: Path) -> Iterator[Path]:
    """Give all files in a folder and in those within, hidden ones left out, in the order of their names."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir():
            yield from files_in(path)
        else:
            yield path


def _stamp(path: Path) -> Stamp:
    found = path.stat()
    return found.st_size, found.st_mtime_ns


def _stamp_or_none(path: Path) -> Stamp | None:
    try:
        return _stamp(path)
    except OSError:
        return None
