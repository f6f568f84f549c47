"""What a file lists by number, each number once."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from pomona.errors import PomonaError

__all__ = ["by_id"]

Thing = TypeVar("Thing")


def by_id(path: Path, noun: str, listed: Iterable[tuple[int, Thing]]) -> dict[int, Thing]:
    """Give things by their numbers.

    Raises
    ------
    PomonaError
        A number is there twice.
    """
    found: dict[int, Thing] = {}
    for number, thing in listed:
        if number in found:
            raise PomonaError(f"{path}: found {noun} {number} twice, expected it once")
        found[number] = thing
    return found
