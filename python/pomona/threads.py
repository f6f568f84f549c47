"""How many threads: asked for by people and programs, bounded by the cores that there are."""

from __future__ import annotations

import os
from numbers import Integral
from typing import Any

from pomona.errors import PomonaError

__all__ = ["capped_threads", "cores", "require_threads"]


def cores() -> int:
    """Cores that this process may use, which in a container are fewer than there are; only Linux can tell."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def require_threads(asked: Any, place: str = "threads") -> int:
    """Take a number of threads as it was given at `place`: a flag, a field of a file, an argument.

    Raises
    ------
    PomonaError
        When it is no whole number from 1.
    """
    # Those of NumPy are whole numbers, too.
    if isinstance(asked, Integral) and not isinstance(asked, bool) and int(asked) >= 1:
        return int(asked)
    raise PomonaError(f"{place}: found {asked!r}, expected a whole number from 1")


def capped_threads(asked: int | None) -> int | None:
    """Give the number to use: no more than there are cores, which would only wait for each other; None stays None.

    Raises
    ------
    PomonaError
        As `require_threads`.
    """
    return None if asked is None else min(require_threads(asked), cores())
