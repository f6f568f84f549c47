"""Size classes: the minimum belongs to a class, the maximum to the next one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona.errors import PomonaError
from pomona.growth.foretelling import Summary
from pomona.reading import shown

__all__ = ["FIVE_MM", "class_counts", "class_masses", "parsed_classes", "rising_limits"]

FIVE_MM = np.arange(40.0, 101.0, 5.0)
"""Limits of the usual classes, mm."""

KG_PER_M3 = 900.0
"""Mass of an apple against the ball of its widest diameter: 0.90 g/cm3 over 26 weighed Fuji."""


def parsed_classes(text: str) -> NDArray[np.float64]:
    """Read the limits of own classes, mm: ``60,65,70`` is below 60, 60 to 65, 65 to 70, and 70 and above.

    Raises
    ------
    PomonaError
    """
    try:
        return rising_limits([float(part) for part in text.split(",")])
    except (PomonaError, ValueError):
        raise PomonaError(
            f"--classes: found {shown(text)}, expected rising limits in mm, for example 60,65,70,75"
        ) from None


def rising_limits(limits_mm: ArrayLike) -> NDArray[np.float64]:
    """Take limits of size classes, (C - 1,): one at least, all above 0, each above the one before.

    Raises
    ------
    PomonaError
    """
    try:
        limits = np.asarray(limits_mm, dtype=np.float64)
    except (TypeError, ValueError):
        limits = np.empty(0)
    is_row = limits.ndim == 1 and limits.size > 0 and bool(np.isfinite(limits).all())
    if not is_row or limits[0] <= 0 or (np.diff(limits) <= 0).any():
        raise PomonaError(f"limits_mm: found {shown(limits_mm)}, expected rising limits in mm, above 0")
    return limits


def class_counts(limits_mm: NDArray[np.float64]) -> Summary:
    """How many fruits are in each class at each time, (C, Q): one more class than limits, below the first and above."""

    def summary(
        sizes_mm: NDArray[np.float64], _rates: NDArray[np.float64], hangs: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return _sums(limits_mm, sizes_mm, np.broadcast_to(hangs[:, None], sizes_mm.shape))

    return summary


def class_masses(limits_mm: NDArray[np.float64]) -> Summary:
    """Kilograms in each class at each time, (C, Q)."""

    def summary(
        sizes_mm: NDArray[np.float64], _rates: NDArray[np.float64], hangs: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        masses_kg = KG_PER_M3 * np.pi / 6.0 * (sizes_mm / 1000.0) ** 3
        return _sums(limits_mm, sizes_mm, hangs[:, None] * masses_kg)

    return summary


def _sums(
    limits_mm: NDArray[np.float64], sizes_mm: NDArray[np.float64], amounts: NDArray[np.float64]
) -> NDArray[np.float64]:
    classes = np.searchsorted(limits_mm, sizes_mm, side="right")
    n = len(limits_mm) + 1
    columns = zip(classes.T, amounts.T, strict=True)
    return np.stack([np.bincount(of_day, weights=amount, minlength=n) for of_day, amount in columns], axis=1)
