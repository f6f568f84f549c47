"""A folder that says what it was made from: who takes it up again must want the same."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.reading import parsed_json, read_text, shown

__all__ = ["MADE_FROM", "note_made_from"]

MADE_FROM = "made_from.json"
ABOUT = "what we keep"


def note_made_from(folder: Path, made_from: Mapping[str, Any]) -> None:
    """Write down what the files of a folder are made from, JSON values, or compare it with what is written there.

    Raises
    ------
    PomonaError
        When the folder was made from something else, or cannot be written.
    """
    note = folder / MADE_FROM
    ours = json.dumps(made_from, sort_keys=True, indent=1)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if note.is_file():
            _require_same(note, ours)
        else:
            with whole_file(note) as partial:
                partial.write_text(ours, encoding="utf-8")
    except OSError as error:
        raise PomonaError(f"{folder}: cannot be written: {error.strerror}") from None


def _require_same(note: Path, ours: str) -> None:
    theirs = read_text(note, ABOUT)
    if theirs == ours:
        return
    found, expected = parsed_json(str(note), theirs, ABOUT), json.loads(ours)
    if not isinstance(found, dict):
        raise PomonaError(f"{note}: found {shown(found)}, expected what we keep: remove the folder or take another")
    odd = _first_difference(found, expected)
    if odd is not None:
        name, there, wanted = odd
        raise PomonaError(f"{note}: {name}: found {there}, expected {wanted}: remove the folder or take another")


def _first_difference(found: Any, expected: Any, name: str = "") -> tuple[str, str, str] | None:
    """Name the innermost value that differs, and show it in both; tables and lists of one length are looked into."""
    if found == expected:
        return None
    if isinstance(found, dict) and isinstance(expected, dict):
        # Names that only they have may be of any length.
        names = {key: key if key in expected else shown(key) for key in sorted(found.keys() | expected)}
        parts = [(found.get(key), expected.get(key), f"{name}.{told}" if name else told) for key, told in names.items()]
    elif isinstance(found, list) and isinstance(expected, list) and len(found) == len(expected):
        parts = [(one, other, f"{name}[{row}]") for row, (one, other) in enumerate(zip(found, expected, strict=True))]
    else:
        return name, shown(found), shown(expected)
    return next(odd for part in parts if (odd := _first_difference(*part)) is not None)
