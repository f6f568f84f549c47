"""Files of strangers: what is asked of each of them before its content is believed.

A reader takes its bytes, text and whole numbers through here, so that a device, a bomb or a number of a thousand digits
is one line for the user, and no reader has to think of it.
"""

from __future__ import annotations

import json
import math
import re
import stat
import sys
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from pomona.errors import PomonaError

__all__ = [
    "MOST_NUMBER",
    "MOST_TEXT_BYTES",
    "decoded_text",
    "number_in",
    "parsed_json",
    "path_inside",
    "plain_text",
    "read_given_text",
    "read_text",
    "require_file",
    "shown",
    "whole_number",
]

MOST_TEXT_BYTES = 1 << 28
"""256 MiB: text is read whole, and three million boxes, a season's, are half of it."""

MOST_SHOWN = 60
"""Characters of what was found that a message repeats."""

MOST_NUMBER = 1e100
"""Nothing that is measured is larger, in no unit; and its square is a number still."""

INT64 = range(-(1 << 63), 1 << 63)

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def require_file(path: Path, expected: str) -> int:
    """Refuse what is no plain file, and so has no end or never answers; a link to one is fine.

    Returns
    -------
    int
        Bytes in it.

    Raises
    ------
    PomonaError
        When it is missing, a folder, a pipe, a socket or a device.
    """
    try:
        found = path.stat()
    except FileNotFoundError:
        raise PomonaError(f"{path}: not found, expected {expected}") from None
    except (OSError, ValueError) as error:  # a name with a NUL is a ValueError
        raise PomonaError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    kind = next((name for is_kind, name in _KINDS if is_kind(found.st_mode)), None)
    if kind is not None:
        raise PomonaError(f"{path}: found {kind}, expected a file: {expected}")
    return found.st_size


def read_text(path: Path, expected: str) -> str:
    """Read a whole text in UTF-8; the byte order mark that spreadsheets put in front is left out.

    Raises
    ------
    PomonaError
        When it is no plain file, larger than `MOST_TEXT_BYTES`, or no text.
    """
    if require_file(path, expected) > MOST_TEXT_BYTES:
        raise PomonaError(f"{path}: found more than {MOST_TEXT_BYTES >> 20} MiB, expected {expected}")
    try:
        with path.open("rb") as file:
            content = file.read(MOST_TEXT_BYTES)
    except OSError as error:
        raise PomonaError(f"{path}: cannot be read: {error.strerror}") from None
    return decoded_text(path, content, expected)


def read_given_text(path: Path, expected: str) -> str:
    """Read a text that the user names: a file, or what is open already.

    That is the standard input, ``-``, and ``/dev/fd/63``, which a shell makes of ``<(...)``. Other pipes are refused as
    `read_text` does: who opens them may wait for ever.

    Raises
    ------
    PomonaError
        As in `read_text`.
    """
    descriptor = _descriptor(path)
    if descriptor is None and str(path) != "-":
        return read_text(path, expected)
    try:
        if descriptor is None:
            content = sys.stdin.buffer.read(MOST_TEXT_BYTES + 1)
        else:
            with open(descriptor, "rb", closefd=False) as stream:
                content = stream.read(MOST_TEXT_BYTES + 1)
    except OSError as error:
        raise PomonaError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) > MOST_TEXT_BYTES:
        raise PomonaError(f"{path}: found more than {MOST_TEXT_BYTES >> 20} MiB, expected {expected}")
    return decoded_text(path, content, expected)


def _descriptor(path: Path) -> int | None:
    named = re.fullmatch(r"/(?:dev|proc/self)/fd/(\d{1,9})", str(path))
    return None if named is None else int(named[1])


def decoded_text(path: Path, content: bytes, expected: str) -> str:
    """Decode the bytes of a text, see `read_text`."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        what = "UTF-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "bytes that are not UTF-8"
        raise PomonaError(f"{path}: byte {error.start}: found {what}, expected {expected}") from None
    if "\0" in text:
        raise PomonaError(f"{path}: byte {content.index(0)}: found a NUL, not text, expected {expected}")
    return text


def parsed_json(where: str, text: str, expected: str) -> Any:
    """Parse JSON whose whole numbers fit into 64 bits.

    Raises
    ------
    PomonaError
        One line that begins with `where`.
    """
    try:
        return json.loads(text, parse_int=_int64)
    except json.JSONDecodeError as error:
        raise PomonaError(f"{where}: line {error.lineno}: not JSON ({error.msg}), expected {expected}") from None
    except ValueError as error:
        raise PomonaError(f"{where}: {error}") from None
    except RecursionError:
        raise PomonaError(f"{where}: found lists in lists without end, expected {expected}") from None


def _int64(digits: str) -> int:
    if len(digits) > len(str(INT64.start)) or int(digits) not in INT64:
        raise ValueError(f"found the whole number {digits[:20]}..., expected one of at most 64 bits")
    return int(digits)


def whole_number(where: str, text: str, expected: str) -> int:
    """Read a whole number of plain digits that fits into 64 bits.

    Raises
    ------
    PomonaError
        One line that begins with `where`.
    """
    if re.fullmatch(r"[-+]?[0-9]{1,19}", text) is None or int(text) not in INT64:
        raise PomonaError(f"{where}: found {shown(text)}, expected {expected}")
    return int(text)


def plain_text(text: str) -> bool:
    """Tell whether numbers in a text are what everybody takes for them: Python reads 1_0 as ten, and other digits."""
    return "_" not in text and text.isascii()


def number_in(where: str, field: str, cell: object) -> float:
    """Give a finite number out of a cell of text or a JSON value.

    Raises
    ------
    PomonaError
        One line that begins with `where`; numbers beyond `MOST_NUMBER` are refused too.
    """
    try:
        refused = isinstance(cell, bool) or (isinstance(cell, str) and not plain_text(cell))
        value = math.nan if refused else float(cell)  # type: ignore[arg-type] # what fails is caught
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not abs(value) <= MOST_NUMBER:  # nor is what is NaN
        raise PomonaError(f"{where}: {field}: found {shown(cell)}, expected a number")
    return value


def path_inside(where: str, folder: Path, name: str) -> Path:
    """Give the file of a name that a file's content says, and refuse one that leads out of the folder.

    Who writes such a list decides which of the reader's files are opened and hashed. A link that lies in the folder is
    followed: whoever has the folder put it there, and data sets often keep their pictures elsewhere.

    Raises
    ------
    PomonaError
        One line that begins with `where`.
    """
    for kind in (PurePosixPath(name), PureWindowsPath(name)):
        if not name or kind.anchor or ".." in kind.parts:
            raise PomonaError(f"{where}: found the file {shown(name)}, expected one inside of {folder}")
    return folder / name


def shown(value: object) -> str:
    """Represent what was found in one line, cut where it is long."""
    text = " ".join(map(str.strip, repr(value).splitlines()))
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."
