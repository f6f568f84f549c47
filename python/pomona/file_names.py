"""Names of files as callers give them."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from pomona.errors import PomonaError
from pomona.reading import shown
from pomona.streams import is_stream

__all__ = ["given_path", "require_suffix"]


def given_path(path: object) -> Path:
    """Take the name of a file, str or Path.

    Raises
    ------
    PomonaError
        When it is none.
    """
    try:
        return Path(path)  # type: ignore[arg-type] # what fails is caught
    except TypeError:
        raise PomonaError(f"path: found {shown(path)}, expected the name of a file") from None


def require_suffix(output: Path, suffixes: Collection[str]) -> None:
    """Refuse an output whose name says that it is something else; a stream needs no suffix.

    Raises
    ------
    PomonaError
        Naming the suffix that was found, and `suffixes`.
    """
    is_nameless = not output.suffix and is_stream(output)
    if not is_nameless and output.suffix.lower() not in suffixes:
        raise PomonaError(f"{output}: found suffix {output.suffix!r}, expected {', '.join(suffixes)}")
