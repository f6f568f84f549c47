"""Boxes and tracks as MOTChallenge text: `frame,id,x,y,w,h[,conf,...]`, one line a box, no header.

Frames count from 1: line `1,...` belongs to the first frame of the recording, whatever its number. An id of -1 is none.
x and y are taken as written, in our pixels, where the left edge of the picture is 0: so write trackers and annotation
tools. MOTChallenge's own sequences count pixels from 1 (https://motchallenge.net/instructions/), their boxes come out
one pixel right and down.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from pomona.detect.listed import ListedBox
from pomona.errors import PomonaError
from pomona.reading import number_in

__all__ = ["is_mot", "read_mot"]

FIELDS = ("frame", "id", "x", "y", "w", "h", "conf")
NEEDED = 6
UNKNOWN_SCORE = -1.0
"""Written by trackers that keep no confidence."""
IGNORED_SCORE = 0.0
"""In a ground truth: not to be considered."""


def is_mot(line: str) -> bool:
    """Whether the first line of a file is one of numbers, so that it is no header."""
    cells = _cells(line)
    return len(cells) >= NEEDED and all(re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", cell) for cell in cells)


def read_mot(path: Path, text: str, numbers: Sequence[int]) -> Iterator[ListedBox]:
    """Give the boxes of a text.

    Parameters
    ----------
    path : Path
        For messages.
    text : str
        The lines; what follows `conf` is ignored.
    numbers : sequence of int
        The recording's frame numbers in order of time.

    Raises
    ------
    PomonaError
        One line with the file, line and field, what was found and what was expected.
    """
    for line, row in enumerate(text.splitlines(), start=1):
        cells = _cells(row)
        if any(cells):
            box = _box(f"{path}: line {line}", f"line {line}", cells, numbers)
            if box.score != IGNORED_SCORE:
                yield box


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split(",")] if "," in line else line.split()


def _box(where: str, line: str, cells: list[str], numbers: Sequence[int]) -> ListedBox:
    if len(cells) < NEEDED:
        raise PomonaError(f"{where}: found {len(cells)} cells, expected at least frame,id,x,y,w,h")
    frame, identity, x, y, width, height, *rest = (
        number_in(where, name, cell) for name, cell in zip(FIELDS, cells, strict=False)
    )
    if frame != int(frame) or not 1 <= frame <= len(numbers):
        raise PomonaError(f"{where}: frame: found {frame:g}, expected 1 to {len(numbers)}: frames count from 1 here")
    for name, size in (("w", width), ("h", height)):
        if size <= 0:
            raise PomonaError(f"{where}: {name}: found {size:g}, expected pixels above 0")
    score = rest[0] if rest and rest[0] != UNKNOWN_SCORE else 1.0
    name = "" if identity < 0 else f"{identity:.15g}"
    return ListedBox(line, numbers[int(frame) - 1], (x, y, x + width, y + height), score, name)
