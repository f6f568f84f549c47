"""Several files as one case: what kind of input it is, and each file behind a line of its own that survives damage."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

__all__ = ["packed", "packed_folder", "unpacked"]

_MARK = re.compile(rb"\n%%FILE ([a-z0-9_./]{1,60})\n", re.IGNORECASE)


def packed(kind: str, files: Mapping[str, bytes]) -> bytes:
    """Put files together; `kind` chooses the reader."""
    return kind.encode() + b"".join(b"\n%%%%FILE %s\n%s" % (name.encode(), body) for name, body in files.items())


def packed_folder(kind: str, folder: Path) -> bytes:
    """Put all files of a folder together."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return packed(kind, {str(file.relative_to(folder)): file.read_bytes() for file in files})


@contextmanager
def unpacked(content: bytes) -> Iterator[tuple[str, Path]]:
    """Write the files into a temporary folder; give the kind, which may be nonsense, and the folder."""
    kind, *rest = _MARK.split(content)
    with tempfile.TemporaryDirectory(prefix="pomona-fuzz-") as place:
        folder = Path(place)
        for name, body in zip(rest[::2], rest[1::2], strict=False):
            parts = [part for part in name.decode().split("/") if part.strip(".")]
            target = folder.joinpath(*parts)
            if parts and not target.exists():
                _write(target, body)
        yield kind.decode("latin-1").strip(), folder


def _write(target: Path, body: bytes) -> None:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(body)
    except (FileExistsError, NotADirectoryError):  # a name of the damaged case is a file and a folder
        return
