"""The part of YAML that calibration tools write: nested mappings, lists, flow lists, numbers and plain text.

Anchors, block text and flow mappings are refused with their line. Numbers follow YAML 1.2, so 1e-05 is one.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pomona.errors import PomonaError
from pomona.reading import read_text, shown

__all__ = ["read_documents"]

# Both walk over a line once, whatever is in it.
_KEY = re.compile(r"""(?P<key>"[^"]*"\s*|'[^']*'\s*|[^\s\[\]{}&*|>"'#-][^:#]*):(?:\s+(?P<value>.*))?$""")
_HASH = re.compile(r"(?:^|(?<=\s))#")

DEEPEST = 20
"""Levels of mappings and lists; those of calibrations are three."""

Line = tuple[int, int, str]
"""Line number, indent, text."""


def read_documents(path: Path) -> list[dict[str, Any]]:
    """Read the mappings of a file, one for each document; OpenCV's header `%YAML:1.0` and tags are skipped.

    Raises
    ------
    PomonaError
        One line with the file, the line number and what was found.
    """
    text = read_text(path, "a calibration in YAML")
    documents: list[list[Line]] = [[]]
    for number, raw in enumerate(text.splitlines(), start=1):
        line = _without_comment(raw).rstrip()
        if line.startswith(("---", "...")):
            documents.append([])
        elif line.strip() and not line.startswith("%"):
            documents[-1].append((number, len(line) - len(line.lstrip()), line.strip()))
    read = [_mapping(path, _joined(path, lines)) for lines in documents if lines]
    if not read:
        raise PomonaError(f"{path}: found nothing, expected YAML")
    return read


def _without_comment(line: str) -> str:
    """Cut at the first # that stands alone and not in quotes: that has an even number of quotes behind it."""
    behind, end = 0, len(line)
    found = len(line)
    for match in reversed([*_HASH.finditer(line)]):
        behind += line.count('"', match.start(), end)
        end = match.start()
        if behind % 2 == 0:
            found = end
    return line[:found]


def _joined(path: Path, lines: list[Line]) -> list[Line]:
    """Put flow lists that run over several lines onto one."""
    joined: list[tuple[int, int, list[str]]] = []
    open_brackets = 0
    for number, indent, text in lines:
        if open_brackets:
            joined[-1][2].append(text)
        else:
            joined.append((number, indent, [text]))
        open_brackets += text.count("[") - text.count("]")
    if open_brackets:
        raise PomonaError(f"{path}: line {joined[-1][0]}: found a list that does not end, expected ]")
    return [(number, indent, " ".join(texts)) for number, indent, texts in joined]


def _mapping(path: Path, lines: list[Line], depth: int = 0) -> dict[str, Any]:
    """Read lines of one indent as a mapping; deeper lines, and lists at the same indent, belong to the key above."""
    _require_depth(path, lines[0][0], depth)
    found: dict[str, Any] = {}
    indent, row = lines[0][1], 0
    while row < len(lines):
        number, here, text = lines[row]
        match = _KEY.match(text)
        if here != indent or match is None:
            raise PomonaError(f"{path}: line {number}: found {shown(text)}, expected `name: value` in YAML")
        key, value = match["key"].strip().strip("\"'"), re.sub(r"^!!?\S+\s*", "", match["value"] or "")
        end = row + 1
        while end < len(lines) and (
            lines[end][1] > indent or (lines[end][1] == indent and lines[end][2].startswith("-"))
        ):
            end += 1
        block = lines[row + 1 : end]
        if key in found or (value and block):
            what = f"{shown(key)} twice" if key in found else shown(block[0][2])
            raise PomonaError(f"{path}: line {number}: found {what}, expected one value for each name")
        found[key] = _block(path, block, depth + 1) if block else _value(path, number, value)
        row = end
    return found


def _block(path: Path, lines: list[Line], depth: int) -> Any:
    if not lines[0][2].startswith("-"):
        return _mapping(path, lines, depth)
    _require_depth(path, lines[0][0], depth)
    items: list[list[Line]] = []
    for number, indent, text in lines:
        if indent == lines[0][1] and text.startswith("-"):
            inner = text[1:].lstrip()
            items.append([(number, indent + len(text) - len(inner), inner)] if inner else [])
        else:
            items[-1].append((number, indent, text))
    return [_item(path, item, depth + 1) for item in items]


def _require_depth(path: Path, number: int, depth: int) -> None:
    if depth > DEEPEST:
        raise PomonaError(
            f"{path}: line {number}: found more than {DEEPEST} levels in each other, expected a calibration"
        )


def _item(path: Path, lines: list[Line], depth: int) -> Any:
    if not lines:
        return None
    number, _, text = lines[0]
    if len(lines) == 1 and not text.startswith("- ") and _KEY.match(text) is None:
        return _value(path, number, text)
    return _block(path, lines, depth)


def _value(path: Path, number: int, text: str) -> Any:
    if text.startswith(("&", "*", "|", ">", "{")):
        raise PomonaError(f"{path}: line {number}: found {shown(text)}, expected a number, a text or a list")
    if not text.startswith("["):
        return _scalar(text)
    tokens = re.findall(r"""\[|\]|"[^"]*"|'[^']*'|[^\s,\[\]][^,\[\]]*""", text)
    stack: list[list[Any]] = [[]]
    for token in tokens:
        if token == "[":
            stack.append([])
            _require_depth(path, number, len(stack))
        elif token == "]" and len(stack) > 1:
            stack[-2].append(stack.pop())
        elif token == "]":
            break
        else:
            stack[-1].append(_scalar(token.strip()))
    if len(stack) != 1 or len(stack[0]) != 1:
        raise PomonaError(f"{path}: line {number}: found {shown(text)}, expected a list in brackets")
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
