"""A small picture of one fruit, as a session saw it best."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FruitCrop"]


@dataclass(frozen=True)
class FruitCrop:
    """A fruit in the frame that shows most of it.

    Attributes
    ----------
    frame : int
        Number of the frame.
    picture : bytes
        A WebP or JPEG file.
    """

    frame: int
    picture: bytes
