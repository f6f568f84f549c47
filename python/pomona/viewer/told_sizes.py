"""Size classes as the page is told of them where no growth is known: of sizes as they were measured last."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.growth.blocks import HALF_A_FRUIT
from pomona.growth.measured import MeasuredFruits
from pomona.growth.size_classes import class_counts, class_masses

__all__ = ["sizes_told"]


def sizes_told(fruits: MeasuredFruits, limits_mm: NDArray[np.float64], pack_kg: float) -> list[dict[str, Any]]:
    """Tell the lines of `classes.csv` of what is expected to hang; one measurement tells no interval."""
    n_visits = fruits.diameters_mm.shape[1]
    latest = n_visits - 1 - (~np.isnan(fruits.diameters_mm))[:, ::-1].argmax(axis=1)
    sizes_mm = fruits.diameters_mm[np.arange(len(latest)), latest][:, None]
    counts, masses_kg = (
        summary(limits_mm)(sizes_mm, sizes_mm, fruits.hang_chances)[:, 0] for summary in (class_counts, class_masses)
    )
    limits = [None, *limits_mm.tolist(), None]
    used = np.flatnonzero(counts >= min(HALF_A_FRUIT, counts.max()))
    return [
        {
            "date": fruits.days[-1].isoformat(),
            "from_mm": limits[row],
            "below_mm": limits[row + 1],
            **_amount("n_fruits", counts[row]),
            **_amount("kg", masses_kg[row]),
            **_amount("packs", masses_kg[row] / pack_kg),
        }
        for row in range(used.min(), used.max() + 1)
    ]


def _amount(name: str, amount: float) -> dict[str, float | None]:
    return {name: round(float(amount), 3), f"{name}_low": None, f"{name}_high": None}
