"""The texts of a schema, word by word: as SQLite reads them, whatever their spaces, quotes and case."""

from __future__ import annotations

import re

__all__ = ["is_column_list", "made", "names_in", "words_of"]

# A quote or a comment that does not end runs to the end, as in SQLite; that also keeps the search linear.
WORD = re.compile(
    r"""--[^\n]* | /\*(?:.*?\*/|.*) | \s+
    | (?P<text>'[^']*(?:''[^']*)*'?)
    | "(?P<quoted>[^"]*(?:""[^"]*)*)"? | `(?P<ticked>[^`]*)`? | \[(?P<bracketed>[^\]]*)\]?
    | (?P<plain>\w+ | .)""",
    re.VERBOSE | re.DOTALL,
)

CONSTRAINTS = frozenset(
    ("as", "check", "collate", "constraint", "default", "generated", "not", "primary", "references", "unique")
)
"""What makes a column more than a name and a type."""

MAX_CHARACTERS = 100_000
"""Longer statements are nobody's table; ours have 700."""


def words_of(sql: str) -> tuple[str, ...]:
    """Return names in lower case without their quotes, texts as they are, no spaces and no comments."""
    return tuple(
        match["text"] if match["text"] is not None else match[match.lastgroup].lower()
        for match in WORD.finditer(sql[:MAX_CHARACTERS])
        if match.lastgroup is not None
    )


def made(words: tuple[str, ...]) -> tuple[str, str, tuple[str, ...]]:
    """Return what a CREATE statement makes, its name, and the words that follow; blanks where it is none."""
    if words[:1] != ("create",):
        return "", "", ()
    first = 2 if words[1:2] in (("unique",), ("virtual",)) else 1
    kind, name = (*words[first : first + 2], "", "")[:2]
    return kind, name, words[first + 2 :]


def names_in(words: tuple[str, ...]) -> set[str]:
    """Return everything that can be a name: SQLite takes a text in single quotes for one too."""
    return {word.strip("'").lower() for word in words}


def is_column_list(words: tuple[str, ...]) -> bool:
    """Tell whether these are column definitions of a name and a type, each after a comma: `, note text (80)`."""
    text = " ".join(words)
    return CONSTRAINTS.isdisjoint(words) and bool(re.fullmatch(r"(, \w[^(),]*( \( \d+( , \d+)? \))? ?)*", text))
