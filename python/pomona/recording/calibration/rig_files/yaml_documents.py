"""YAML as calibration tools write it, parsed by PyYAML: nothing but mappings, lists, numbers and text is built of it.

Plain scalars are read as YAML 1.2 has them, so 1e-05 is a number and `no` a text. What could make much of little, or
something else than data, is refused with its line: anchors and aliases, other tags than OpenCV's, deep nesting.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import yaml

from pomona.errors import PomonaError
from pomona.reading import read_text, shown, whole_number

__all__ = ["read_documents"]

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""LibYAML's parser where PyYAML was built with it."""

DEEPEST = 20
"""Levels of mappings and lists; those of calibrations are three."""

MOST_CHARACTERS = 1 << 24
"""A camera_info that was printed for a quarter of an hour; other calibrations are a few thousand."""

OPENCV_HEADER = re.compile(r"%YAML:[^\n]*")
"""With a colon where YAML has a blank, as OpenCV's FileStorage writes it."""

OPENCV_TAG = "tag:yaml.org,2002:opencv-"
"""In front of matrices, which are mappings with `rows`, `cols` and `data`."""

WHOLE = re.compile(r"[-+]?[0-9]+")
DECIMAL = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
NOT_FINITE = re.compile(r"([-+]?)\.(inf|nan)", re.IGNORECASE)
CONSTANTS = {"": None, "~": None, "null": None, "true": True, "false": False}


def read_documents(path: Path) -> list[dict[str, Any]]:
    """Read the mappings of a file, one for each document that is not empty.

    Raises
    ------
    PomonaError
        One line with the file, the line number and what was found.
    """
    text = OPENCV_HEADER.sub("", read_text(path, "a calibration in YAML"), count=1)
    if len(text) > MOST_CHARACTERS:
        raise PomonaError(f"{path}: found more than {MOST_CHARACTERS >> 20} MiB, expected a calibration in YAML")
    try:
        documents = [*_Documents(path, yaml.parse(text, Loader=LOADER)).read()]
    except yaml.YAMLError as error:
        raise PomonaError(f"{path}: {_told(text, error)}, expected YAML") from None
    if not documents:
        raise PomonaError(f"{path}: found nothing, expected YAML")
    return documents


def _told(text: str, error: yaml.YAMLError) -> str:
    mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
    if mark is None:  # a character that YAML does not have, told by its place
        number = text.encode()[: getattr(error, "position", 0)].count(b"\n") + 1
        return f"line {number}: found {getattr(error, 'reason', None) or 'a forbidden character'}"
    return f"line {mark.line + 1}: {problem or 'found what cannot be parsed'}"


@dataclass(frozen=True)
class _Documents:
    """Values out of the events of a parser."""

    path: Path
    events: Iterator[Any]

    def read(self) -> Iterator[dict[str, Any]]:
        for event in self.events:
            if not isinstance(event, yaml.DocumentStartEvent):
                continue
            event = next(self.events)
            found = self._value(event, 0)
            if isinstance(found, dict):
                yield found
            elif found is not None:
                self._refuse(event, shown(found), "`name: value` in YAML")

    def _value(self, event: Any, depth: int) -> Any:
        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            self._refuse(event, "an anchor or an alias", "a number, a text or a list")
        if event.tag is not None and not event.tag.startswith(OPENCV_TAG):
            self._refuse(event, f"the tag {shown(event.tag)}", "a calibration")
        if isinstance(event, yaml.ScalarEvent):
            return event.value if event.style else self._plain(event)
        if depth > DEEPEST:
            self._refuse(event, f"more than {DEEPEST} levels in each other", "a calibration")
        if isinstance(event, yaml.SequenceStartEvent):
            return [self._value(item, depth + 1) for item in self._until(yaml.SequenceEndEvent)]
        return self._mapping(depth)

    def _mapping(self, depth: int) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name in self._until(yaml.MappingEndEvent):
            if not isinstance(name, yaml.ScalarEvent):
                self._refuse(name, "no plain name", "`name: value` in YAML")
            if name.value in found:
                self._refuse(name, f"{shown(name.value)} twice", "one value for each name")
            found[name.value] = self._value(next(self.events), depth + 1)
        return found

    def _until(self, end: type[Any]) -> Iterator[Any]:
        for event in self.events:
            if isinstance(event, end):
                return
            yield event

    def _plain(self, event: Any) -> Any:
        text = event.value
        if WHOLE.fullmatch(text):
            return whole_number(f"{self.path}: line {event.start_mark.line + 1}", text, "a number of 64 bits")
        if DECIMAL.fullmatch(text):
            number = float(text)
            if not math.isfinite(number):
                self._refuse(event, shown(text), "a number of 64 bits")
            return number
        if (match := NOT_FINITE.fullmatch(text)) is not None:
            return float(match[1] + match[2])
        return CONSTANTS.get(text, text)

    def _refuse(self, event: Any, found: str, expected: str) -> NoReturn:
        raise PomonaError(f"{self.path}: line {event.start_mark.line + 1}: found {found}, expected {expected}")
