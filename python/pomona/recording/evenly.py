"""Which rows to look at where a few of many tell."""

from __future__ import annotations

import numpy as np

__all__ = ["evenly"]


def evenly(n_rows: int, most: int) -> list[int]:
    """Give the rows in the middles of so many equal parts of all, each once; all of them where there are no more."""
    middles = (2 * np.arange(most) + 1) * n_rows // (2 * most)
    return list(dict.fromkeys(middles.tolist())) if n_rows > 0 else []
