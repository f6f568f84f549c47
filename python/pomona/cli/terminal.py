"""The only way of the command line to a terminal: line by line, with nothing in them that commands it."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TextIO

import typer

from pomona.errors import PomonaError

READER_GONE = 141
"""Exit code when nobody reads the standard output any more, as shells have it (128 + SIGPIPE)."""

# Controls (C0, DEL, C1), marks that turn the direction of writing, separators of lines, halves of characters.
_COMMANDS = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")

_result_is_elsewhere = ContextVar("_result_is_elsewhere", default=False)
_kept_stdout: ContextVar[TextIO | None] = ContextVar("_kept_stdout", default=None)


def shown(text: str) -> str:
    """Return text for people as one line, what would command the terminal written out as in Python."""
    return _COMMANDS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def say(*lines: str) -> None:
    """Print lines of the result on the standard output; on the standard error where the output is there itself."""
    _print(sys.stderr if _result_is_elsewhere.get() else _kept_stdout.get() or sys.stdout, lines)


def say_json(value: Any) -> None:
    """Print the result for programs: JSON, which writes out all that is not plain ASCII itself."""
    import json

    say(json.dumps(value))


def tell(*lines: str) -> None:
    """Print lines on the standard error: progress, warnings, what is wrong."""
    _print(sys.stderr, lines)


@contextmanager
def result_elsewhere(elsewhere: bool) -> Iterator[None]:
    """Keep the standard output free for what a verb writes there, while the block runs, if so."""
    before = _result_is_elsewhere.set(elsewhere)
    try:
        yield
    finally:
        _result_is_elsewhere.reset(before)


@contextmanager
def libraries_on_stderr() -> Iterator[None]:
    """Keep the standard output for results while the block runs, though a library prints there by itself."""
    kept = sys.stdout
    before = _kept_stdout.set(kept)
    sys.stdout = sys.stderr if kept else kept  # nothing where whoever started the program has closed it
    try:
        yield
    finally:
        sys.stdout = kept
        _kept_stdout.reset(before)


def require_written() -> None:
    """Refuse to go on where something that another printed on the standard output, the help, did not come out.

    Raises
    ------
    PomonaError
        Where it cannot be written.
    """
    if sys.stdout is not None:
        _flush(sys.stdout)


def _print(stream: TextIO | None, lines: tuple[str, ...]) -> None:
    if stream is None:  # closed by whoever started the program
        return
    text = "".join(f"{shown(line)}\n" for line in lines)
    encoding = stream.encoding or "utf-8"
    _flush(stream, text.encode(encoding, "backslashreplace").decode(encoding))


def _flush(stream: TextIO, text: str = "") -> None:
    """Write text, and what is still waiting to be written."""
    try:
        stream.write(text)
        stream.flush()
    except OSError as error:
        _forget(stream)
        if isinstance(error, BrokenPipeError):
            raise typer.Exit(READER_GONE) from None
        if stream is not sys.stderr:
            raise PomonaError(f"the standard output: cannot be written: {error.strerror}") from None


def _forget(stream: TextIO) -> None:
    """Let what could not be written go: Python tries once more when it ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
