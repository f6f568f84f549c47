"""Arrays as the types of the borders hold them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError

__all__ = ["checked_array"]


def checked_array(name: str, values: Any, dtype: Any, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Return `values` as a contiguous array of `dtype`; None in `shape` takes any length."""
    try:
        if isinstance(values, np.ndarray) and np.iscomplexobj(values):
            raise TypeError  # NumPy leaves the imaginary part out, with a warning
        array = np.ascontiguousarray(values, dtype=dtype)
    except (TypeError, ValueError, OverflowError):
        raise PomonaError(f"{name}: expected an array of {np.dtype(dtype).name}") from None
    fits = array.ndim == len(shape) and all(
        want is None or found == want for found, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("N" if want is None else str(want) for want in shape)
        found = ", ".join(map(str, array.shape))
        raise PomonaError(f"{name}: found shape ({found}), expected ({wanted})")
    return array
