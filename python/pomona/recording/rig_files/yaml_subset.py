"""The part of YAML that calibration tools write: nested mappings, lists, flow lists, numbers and plain text.

Anchors, block text and flow mappings are refused with their line. Numbers follow YAML 1.2, so 1e-05 is one.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pomona.errors import PomonaError

__all__ = ["read_documents"]

_KEY = re.compile(r"""(?P<key>"[^"]*"|'[^']*'|[^\s\[\]{}&*|>"'#-][^:#]*?)\s*:(?:\s+(?P<value>.*))?$""")
_COMMENT = re.compile(r"""(?:^|\s)#(?=(?:[^"]*"[^"]*")*[^"]*$).*$""")

Line = tuple[int, int, str]
"""Line number, indent, text."""


def read_documents(path: Path) -> list[dict[str, Any]]:
    """Read the mappings of a file, one for each document; OpenCV's header `%YAML:1.0` and tags are skipped.

    Raises
    ------
    PomonaError
        One line with the file, the line number and what was found.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise PomonaError(f"{path}: cannot be read as text ({error})") from None
    documents: list[list[Line]] = [[]]
    for number, raw in enumerate(text.splitlines(), start=1):
        line = _COMMENT.sub("", raw).rstrip()
        if line.startswith(("---", "...")):
            documents.append([])
        elif line.strip() and not line.startswith("%"):
            documents[-1].append((number, len(line) - len(line.lstrip()), line.strip()))
    read = [_mapping(path, _joined(path, lines)) for lines in documents if lines]
    if not read:
        raise PomonaError(f"{path}: found nothing, expected YAML")
    return read


def _joined(path: Path, lines: list[Line]) -> list[Line]:
    """Put flow lists that run over several lines onto one."""
    joined: list[Line] = []
    open_brackets = 0
    for number, indent, text in lines:
        if open_brackets:
            start, first_indent, begun = joined.pop()
            joined.append((start, first_indent, f"{begun} {text}"))
        else:
            joined.append((number, indent, text))
        open_brackets += text.count("[") - text.count("]")
    if open_brackets:
        raise PomonaError(f"{path}: line {joined[-1][0]}: found a list that does not end, expected ]")
    return joined


def _mapping(path: Path, lines: list[Line]) -> dict[str, Any]:
    """Read lines of one indent as a mapping; deeper lines, and lists at the same indent, belong to the key above."""
    found: dict[str, Any] = {}
    indent, row = lines[0][1], 0
    while row < len(lines):
        number, here, text = lines[row]
        match = _KEY.match(text)
        if here != indent or match is None:
            raise PomonaError(f"{path}: line {number}: found {text[:40]!r}, expected `name: value` in YAML")
        key, value = match["key"].strip("\"'"), re.sub(r"^!!?\S+\s*", "", match["value"] or "")
        end = row + 1
        while end < len(lines) and (
            lines[end][1] > indent or (lines[end][1] == indent and lines[end][2].startswith("-"))
        ):
            end += 1
        block = lines[row + 1 : end]
        if key in found or (value and block):
            what = f"{key!r} twice" if key in found else repr(block[0][2][:40])
            raise PomonaError(f"{path}: line {number}: found {what}, expected one value for each name")
        found[key] = _block(path, block) if block else _value(path, number, value)
        row = end
    return found


def _block(path: Path, lines: list[Line]) -> Any:
    if not lines[0][2].startswith("-"):
        return _mapping(path, lines)
    items: list[list[Line]] = []
    for number, indent, text in lines:
        if indent == lines[0][1] and text.startswith("-"):
            inner = text[1:].lstrip()
            items.append([(number, indent + len(text) - len(inner), inner)] if inner else [])
        else:
            items[-1].append((number, indent, text))
    return [_item(path, item) for item in items]


def _item(path: Path, lines: list[Line]) -> Any:
    if not lines:
        return None
    number, _, text = lines[0]
    if len(lines) == 1 and not text.startswith("- ") and _KEY.match(text) is None:
        return _value(path, number, text)
    return _block(path, lines)


def _value(path: Path, number: int, text: str) -> Any:
    if text.startswith(("&", "*", "|", ">", "{")):
        raise PomonaError(f"{path}: line {number}: found {text[:40]!r}, expected a number, a text or a list")
    if not text.startswith("["):
        return _scalar(text)
    tokens = re.findall(r"""\[|\]|"[^"]*"|'[^']*'|[^\s,\[\]][^,\[\]]*""", text)
    stack: list[list[Any]] = [[]]
    for token in tokens:
        if token == "[":
            stack.append([])
        elif token == "]" and len(stack) > 1:
            stack[-2].append(stack.pop())
        elif token == "]":
            break
        else:
            stack[-1].append(_scalar(token.strip()))
    if len(stack) != 1 or len(stack[0]) != 1:
        raise PomonaError(f"{path}: line {number}: found {text[:40]!r}, expected a list in brackets")
    return stack[0][0]


def _scalar(text: str) -> Any:
    if text[:1] in ("'", '"'):
        return text[1:-1]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"": None, "~": None, "null": None, "true": True, "false": False, ".nan": float("nan")}.get(text, text)
