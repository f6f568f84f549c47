"""What is wrong with a value is told by the name of the flag that gave it, not by that of a field."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from pomona.errors import PomonaError

__all__ = ["told_by_flags"]


@contextmanager
def told_by_flags(flags: Mapping[str, str]) -> Iterator[None]:
    """Put flags in place of fields, `flags` by their names, with which the lines of errors in the block begin."""
    try:
        yield
    except PomonaError as error:
        field, colon, rest = str(error).partition(": ")
        if not colon or field not in flags:
            raise
        raise PomonaError(f"{flags[field]}: {rest}") from None
