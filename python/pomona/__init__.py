"""Pomona finds the same fruits again."""

from pomona._core import __version__
from pomona.errors import PomonaError

__all__ = ["PomonaError", "__version__"]
