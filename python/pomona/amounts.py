"""How many of something, in words: one fruit, two fruits."""

from __future__ import annotations

__all__ = ["amount"]

_MANY = {"box": "boxes", "identity": "identities"}
"""Plurals that take more than an s."""


def amount(count: int, noun: str) -> str:
    """Give the count with its noun, whose singular is given: ``1 fruit``, ``2 fruits``."""
    return f"{count} {noun if count == 1 else _MANY.get(noun, f'{noun}s')}"
