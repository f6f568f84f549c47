"""Boxes that came with a recording: those that a scan takes where nobody names others."""

from __future__ import annotations

from pathlib import Path

__all__ = ["BESIDE", "boxes_beside"]

BESIDE = ("detections.csv", "ids")
"""Boxes, or else instance masks, in the folder of a recording."""


def boxes_beside(recording: Path) -> Path | None:
    """Give the file of boxes or the folder of masks, None where there is neither."""
    return next((place for name in BESIDE if (place := recording / name).exists()), None)
