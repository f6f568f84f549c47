"""Frames read ahead of their use: decoding is a third of a scan's time and has a core to itself."""

from __future__ import annotations

import functools
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Literal

from pomona.errors import PomonaError
from pomona.recording import Frame

__all__ = ["Kind", "prefetched"]

Kind = Literal["left", "right", "depth"]

AHEAD = 2
"""Frames that wait decoded: one hides an uneven reader, more only fill memory."""


def prefetched(frames: Iterable[Frame], kinds: Iterable[Kind]) -> Generator[Frame]:
    """Give the same frames with the named pictures decoded by another thread.

    Pictures that nobody named are decoded when they are asked for. Each is decoded once. A picture that cannot be read
    raises where it is asked for, not here, so one bad picture does not end a recording.

    Parameters
    ----------
    frames : iterable of Frame
        Walked through by one thread alone, in order.
    kinds : iterable of Kind
        Pictures to decode ahead.
    """
    wanted, source = tuple(kinds), iter(frames)

    def step() -> Frame | None:
        frame = next(source, None)
        return None if frame is None else _decoded(frame, wanted)

    with ThreadPoolExecutor(1, "pomona-read") as reader:
        waiting = deque(reader.submit(step) for _ in range(AHEAD))
        while (frame := waiting.popleft().result()) is not None:
            waiting.append(reader.submit(step))
            yield frame


def _decoded(frame: Frame, wanted: tuple[Kind, ...]) -> Frame:
    readers: dict[Kind, _Once | None] = {
        "left": _once(frame.read_left),
        "right": _once(frame.read_right),
        "depth": _once(frame.read_depth),
    }
    for kind in wanted:
        if (read := readers[kind]) is not None:
            read.remember()
    return replace(frame, read_left=readers["left"], read_right=readers["right"], read_depth=readers["depth"])


def _once(read: Callable[[], Any] | None) -> _Once | None:
    return None if read is None else _Once(read)


class _Once:
    """A reader that reads once and then remembers: the picture, or why there is none."""

    def __init__(self, read: Callable[[], Any]) -> None:
        self._read, self._lock = read, threading.Lock()

    @functools.cached_property
    def _result(self) -> tuple[Any, PomonaError | None]:
        try:
            return self._read(), None
        except PomonaError as error:
            return None, error

    def remember(self) -> None:
        with self._lock:
            _ = self._result

    def __call__(self) -> Any:
        self.remember()
        picture, error = self._result
        if error is not None:
            raise error
        return picture
