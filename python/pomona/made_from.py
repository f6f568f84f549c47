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
    odd = next((name for name in sorted(found.keys() | expected) if found.get(name) != expected.get(name)), None)
    if odd is not None:
        there, wanted = shown(found.get(odd)), shown(expected.get(odd))
        name = odd if odd in expected else shown(odd)  # theirs may be of any length
        raise PomonaError(f"{note}: {name}: found {there}, expected {wanted}: remove the folder or take another")
