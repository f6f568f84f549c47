"""Stretches of a way over which drift is measured: so many frames, or so many metres."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError

__all__ = ["Span", "spanned", "travelled"]

TOLERANCE = 0.1
"""A stretch may be longer or shorter than asked by this part of it: frames lie where they lie."""

_WRITTEN = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*(m|f)")


@dataclass(frozen=True)
class Span:
    """A length of way.

    Attributes
    ----------
    length : float
        Above 0; a whole number of frames.
    unit : {"f", "m"}
        Frames or metres.
    """

    length: float
    unit: Literal["f", "m"]

    @classmethod
    def parsed(cls, text: str) -> Span:
        """Read `10f`, ten frames, or `1.5m`.

        Raises
        ------
        PomonaError
            The text is neither, or says nothing of a length.
        """
        found = _WRITTEN.fullmatch(text.strip())
        length = float(found[1]) if found else 0.0
        if found is None or not 0 < length < 1e9 or (found[2] == "f" and not length.is_integer()):
            raise PomonaError(f"--over: found {text!r}, expected frames or metres: 1f, 10f, 1m, 0.5m")
        return cls(length, "m" if found[2] == "m" else "f")

    def __str__(self) -> str:
        if self.unit == "m":
            return f"{self.length:g} m"
        return "1 frame" if self.length == 1 else f"{self.length:g} frames"


def travelled(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the way (F,) from the first of some poses (F, 4, 4), metres."""
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def spanned(span: Span, true: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give the first (P,) and the last (P,) row of every such stretch of the true poses (F, 4, 4).

    One begins at each pose. Of metres, it ends at the pose where the way comes nearest to that length, and near it.
    """
    starts = np.arange(len(true))
    if span.unit == "f":
        first = starts[: max(0, len(true) - int(span.length))]
        return first, first + int(span.length)
    way_m = travelled(true)
    after = np.clip(np.searchsorted(way_m, way_m + span.length), 1, len(true) - 1)
    over_m, under_m = way_m[after] - way_m - span.length, way_m + span.length - way_m[after - 1]
    last = np.where(under_m <= over_m, after - 1, after)
    near = np.abs(way_m[last] - way_m - span.length) <= TOLERANCE * span.length
    kept = near & (last > starts)
    return starts[kept], last[kept]
