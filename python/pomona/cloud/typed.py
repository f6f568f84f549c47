"""Columns that files keep as text, as the numbers they are."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

__all__ = ["as_floats", "as_whole", "typed"]

# Written as a number is written and no other way: 007 and -0 are names, 1_000 and inf are text.
WHOLE = re.compile(r"0|-?[1-9][0-9]{0,15}")
NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]{1,3})?")


def typed(cells: Sequence[str]) -> list[int | None] | list[float | None] | list[str]:
    """Give a column as whole numbers or numbers where every cell is one, else as it is; a blank among numbers is None.

    A column of blanks alone is text.
    """
    return as_whole(cells) or as_floats(cells) or list(cells)


def as_whole(cells: Sequence[str]) -> list[int | None] | None:
    """Give a column of whole numbers, each told back as it was written; None where one is none."""
    if not any(cells) or not all(WHOLE.fullmatch(cell) for cell in cells if cell):
        return None
    return [int(cell) if cell else None for cell in cells]


def as_floats(cells: Sequence[str]) -> list[float | None] | None:
    """Give a column of finite numbers; None where one is none."""
    if not any(cells) or not all(NUMBER.fullmatch(cell) for cell in cells if cell):
        return None
    numbers = [float(cell) if cell else None for cell in cells]
    return numbers if all(number is None or math.isfinite(number) for number in numbers) else None
