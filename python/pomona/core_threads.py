"""Threads as the core has them: things that are made by the hundred share them."""

from __future__ import annotations

from pomona import _core
from pomona.threads import cores, require_threads

__all__ = ["Threads", "core_threads"]

Threads = _core.Threads
"""At most so many threads, for all that are given them. Threads of one's own keep some memory when they end."""


def core_threads(asked: int | Threads | None) -> Threads | None:
    """Start as many threads as were asked for, no more than there are cores; None are those of the whole process.

    Raises
    ------
    PomonaError
        As `pomona.threads.require_threads`.
    """
    if asked is None or isinstance(asked, Threads):
        return asked
    return Threads(min(require_threads(asked), cores()))
