"""Names of strangers in pictures: short, in one line, in letters that the font has."""

from __future__ import annotations

__all__ = ["drawn_name"]

_LAST_LETTER = 0x52F
"""Latin, Greek and Cyrillic: of what comes after, the font lacks much, and warns of each."""

_MOST_LETTERS = 36


def drawn_name(name: str) -> str:
    """Return a name as it can be drawn, without its marks for formulas, a long one without its middle."""
    letters = (
        letter if letter.isprintable() and ord(letter) <= _LAST_LETTER and letter != "$" else "?" for letter in name
    )
    short = "".join(letters)
    half = _MOST_LETTERS // 2 - 2
    return short if len(short) <= _MOST_LETTERS else f"{short[:half]}...{short[-half:]}"
