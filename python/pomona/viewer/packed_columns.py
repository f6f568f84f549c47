"""Columns in few bytes: whole steps, differences, deflate, base64; `web/src/told/columns.ts` unpacks them."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["packed", "packed_texts"]

MOST_STEPS = 1 << 30
"""Of a column; a wider one gets larger steps, so that whatever a map says of its places can be told."""

LARGEST_COUNT = 1 << 52
"""Steps from zero that a double still counts one by one."""


def packed(values: ArrayLike, step: float = 1.0) -> dict[str, Any]:
    """Pack numbers to the nearest multiple of a step: 1 and 0 of probabilities come back as they are.

    Parameters
    ----------
    values : (...) array of numbers
        Taken row by row; NaN is kept.
    step : float
        In the unit of the values.

    Returns
    -------
    dict
        ``n``, ``low`` in whole steps, ``step``, and ``bytes``: of each number the count of steps above `low`, plus 1,
        and 0 for NaN; of these the differences from one to the next, with the sign in the lowest bit; their four bytes,
        all lowest ones first, deflated.
    """
    numbers = np.asarray(values, dtype=np.float64).ravel()
    known = ~np.isnan(numbers)
    lowest, highest = (float(numbers[known].min()), float(numbers[known].max())) if known.any() else (0.0, 0.0)
    step = max(step, (highest - lowest) / MOST_STEPS, max(-lowest, highest) / LARGEST_COUNT)
    low = round(lowest / step)
    codes = np.zeros(len(numbers), dtype=np.int64)
    codes[known] = 1 + np.rint(numbers[known] / step).astype(np.int64) - low
    changes = np.diff(codes, prepend=0)
    folded = np.where(changes < 0, -2 * changes - 1, 2 * changes).astype("<u4")
    planes = folded.view(np.uint8).reshape(-1, 4).T
    return {"n": len(numbers), "low": low, "step": step, "bytes": _deflated(planes.tobytes())}


def packed_texts(texts: Sequence[str]) -> str:
    """Pack texts: JSON, deflated."""
    return _deflated(json.dumps(list(texts)).encode("ascii"))


def _deflated(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, 9)).decode("ascii")
