"""What the settings mean, from where they are defined: the comments of the core, the docstring of `pomona.match`."""

from __future__ import annotations

import inspect
import re
import textwrap

from pomona import _core

__all__ = ["comment", "meanings"]

WIDTH = 120
"""Characters of a line, the mark of the comment among them."""

PARAMETER = re.compile(r"^(?P<names>\w+(?:, \w+)*)(?: :.*)?\n(?P<text>(?:    .*\n|\n)+)", re.MULTILINE)
"""Of a docstring as numpy has them: names on a line, what they are below, indented."""


def meanings() -> dict[str, str]:
    """Return what every setting and every table means, by their names with dots between tables."""
    from pomona.matching import match

    section = re.split(r"^-+\n", inspect.getdoc(match) or "", flags=re.MULTILINE)[1]
    of_call = {
        f"match.{name}": " ".join(found["text"].split())
        for found in PARAMETER.finditer(section)
        for name in found["names"].split(", ")
    }
    return {"match": "What `pomona.match` is told by name.", **of_call, **_core.setting_meanings()}


def comment(text: str) -> list[str]:
    """Give text as lines of comments in TOML."""
    return textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)
