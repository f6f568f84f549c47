"""Units of the coordinates in a file."""

from __future__ import annotations

from typing import Literal

__all__ = ["METRES_PER_UNIT", "Unit"]

Unit = Literal["m", "cm", "mm", "free"]
"""Unit of a file's coordinates; ``free`` keeps the numbers of a reconstruction whose scale nobody knows."""

METRES_PER_UNIT: dict[Unit, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "free": 1.0}
