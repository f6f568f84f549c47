"""A first plan, guessed from how recordings are called."""

from __future__ import annotations

import re
from pathlib import Path

from pomona.errors import PomonaError
from pomona.farm.recorded_visits import visits_by_pattern

__all__ = ["first_plan", "guessed_pattern"]

DATE = re.compile(r"\d{4}-?\d{2}-?\d{2}(?:[T_]\d{2}[:-]?\d{2}(?:[:-]?\d{2})?)?")

KINDS = ((".mp4", ".mkv", ".avi", ".mov", ".svo2", ".mcap", ".bag"), ("",), (".gpkg",), (".csv", ".ply"))
"""Suffixes of what may be a recording, the likeliest first; a folder has none. Tables often lie beside recordings."""

DEPTHS = (2, 1, 3)
"""Folders and file that row and date may be the names of."""

PLAN = """\
# A season of a farm: `pomona farm run {name}` does all of it, once, and goes on where it was stopped.
# Paths are from this file's folder. What is written goes to `results`.
results = "{results}"

[recordings]
folder = "{folder}"
pattern = "{pattern}"       # {{row}} and {{date}} once each, * is anything in a name
# table = "recordings.csv"  # instead: columns row,date,recording
skip = []                   # recordings to leave out, as "row 3/2024-08-09"

# Each table below is a verb, its keys are the verb's flags: `pomona scan --help`, ... {{row}}, {{date}} and {{beside}},
# the recording's folder, may stand in those of scan. Without its table, growth, report or export is not done.
[scan]
# model = "shipped"                     # a detector; without one, the boxes that lie beside each recording
# detections = "{{beside}}/boxes.csv"

[map]

[growth]
# harvest = "2024-09-25"

[report]
# harvest = "2024-09-25"

[export]
to = ["csv"]
"""


def first_plan(plan: Path, recordings: Path, pattern: str | None, results: str) -> tuple[str, int]:
    """Write a plan as text, and say how many recordings it finds.

    Raises
    ------
    PomonaError
        No recordings are found.
    """
    if not recordings.is_dir():
        raise PomonaError(f"{recordings}: is not there, expected the folder of the recordings")
    pattern = pattern or guessed_pattern(recordings)
    found = visits_by_pattern(f"--pattern {pattern}", recordings, pattern)
    parent = plan.absolute().parent
    absolute = recordings.absolute()
    folder = absolute.relative_to(parent) if absolute.is_relative_to(parent) else absolute
    quoted = {key: _quoted(value) for key, value in (("folder", folder.as_posix()), ("pattern", pattern))}
    return PLAN.format(name=plan.name, results=_quoted(results), **quoted), len(found)


def guessed_pattern(folder: Path) -> str:
    """Guess how row and date stand in the names of recordings: take the pattern that finds most.

    Raises
    ------
    PomonaError
        No name has a date in it.
    """
    counts: dict[str, int] = {}
    for depth in DEPTHS:
        for path in folder.glob("/".join(["*"] * depth)):
            parts = path.relative_to(folder).parts
            suffix = path.suffix if path.is_file() else ""
            is_recording = path.is_dir() or any(suffix and suffix.lower() in kind for kind in KINDS)
            if is_recording and not any(part.startswith(".") for part in parts):
                for pattern in _patterns(parts, suffix):
                    counts[pattern] = counts.get(pattern, 0) + 1
    working = []
    for pattern in sorted(counts, key=lambda one: (_rank(one), -counts[one], len(one))):
        try:
            visits_by_pattern("", folder, pattern)
        except PomonaError:
            continue
        working.append(pattern)
    if not working:
        raise PomonaError(
            f"{folder}: no recordings with a row and a date in their names, give --pattern, as {{row}}/{{date}}.mp4"
        )
    return working[0]


def _rank(pattern: str) -> int:
    """Place of a pattern's kind of recording among the kinds."""
    last = pattern.rpartition("}")[2].lower()
    return next((rank for rank, kind in enumerate(KINDS) if last and last.endswith(kind) and "" not in kind), 1)


def _patterns(parts: tuple[str, ...], suffix: str) -> list[str]:
    """Give the patterns that these names may be written in: a date in one of them, the row in it or in another."""
    stems = [*parts[:-1], parts[-1].removesuffix(suffix)]
    found = []
    for number, stem in enumerate(stems):
        date = DATE.search(stem)
        if date is None:
            continue
        before, after = stem[: date.start()], stem[date.end() :]
        if len(stems) == 1 or before or after:
            named = _around(before, after)
            if named is not None:
                found.append(_joined(stems, {number: named}, suffix))
        else:
            found += [
                _joined(stems, {number: "{date}", other: "{row}"}, suffix)
                for other in range(len(stems))
                if other != number
            ]
    return found


def _around(before: str, after: str) -> str | None:
    """Take what stands before, or else behind, a date for the row, without what joins them."""
    if plain := before.rstrip("_- "):
        return "{row}" + before[len(plain) :] + "{date}" + ("*" if after else "")
    if plain := after.lstrip("_- "):
        return "{date}" + after[: len(after) - len(plain)] + "{row}"
    return None


def _joined(stems: list[str], named: dict[int, str], suffix: str) -> str:
    return "/".join(named.get(number, "*") for number in range(len(stems))) + suffix


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
