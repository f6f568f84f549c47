"""Text that a file can hold: JSON and Python know halves of characters, UTF-8 does not."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["UNICODE", "broken_at"]

UNICODE = "characters of Unicode"
"""What is expected of every text, in the words of the errors."""


def broken_at(texts: Sequence[str]) -> int | None:
    """Give the number of the first text with half a character in it; None where all can be written."""
    if _is_whole("".join(texts)):  # halves of two texts do not become one character
        return None
    return next(number for number, text in enumerate(texts) if not _is_whole(text))


def _is_whole(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
