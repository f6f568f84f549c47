"""Growth as the page is told of it: a curve for every fruit, means of blocks, size classes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.growth.foretelling import NINETY
from pomona.growth.growth_tables import CLASS_COLUMNS, class_lines, count_intervals
from pomona.growth.season_growth import SeasonGrowth
from pomona.viewer.packed_columns import packed
from pomona.viewer.told_fruits import SHARE, TENTH_MM, FruitsTold

__all__ = ["growth_told"]

THOUSANDTH_MM = 0.001
"""Step of rates, mm a day."""

Numbers = NDArray[np.float64]


def growth_told(growth: SeasonGrowth, fruits: FruitsTold, pack_kg: float) -> dict[str, Any]:
    """Tell all that `pomona growth` writes."""
    told, shape, n_visits = growth.foretold, growth.curve.fitted.likeliest, len(growth.fruits.days)
    rows = fruits.rows_of(growth.fruits.ids)
    n = len(fruits.ids)
    is_told, is_growing = growth.is_told, growth.is_growing
    sizes_mm = {"median_mm": told.sizes_mm, "low_mm": told.lows_mm, "high_mm": told.highs_mm}
    curves = {name: np.where(is_told, sizes, np.nan) for name, sizes in sizes_mm.items()}
    speeds = {"rate_mm_per_day": told.rates_mm_per_day, "rate_sigma_mm_per_day": told.rate_sigmas_mm_per_day}
    rates = {name: np.where(is_growing, speed, np.nan) for name, speed in speeds.items()}
    return {
        "days": [day.isoformat() for day in growth.days],
        "n_visits": n_visits,
        "harvest": None if growth.harvest is None else growth.harvest.isoformat(),
        "curve": growth.curve.fitted.family.name,
        "clock": growth.curve.clock.name,
        "noise_mm": shape.noise_mm,
        "scales": dict(zip(growth.fruits.sessions, growth.foretold.scales.tolist(), strict=True)),
        **{name: packed(_spread(sizes, rows, n), TENTH_MM) for name, sizes in curves.items()},
        **{name: packed(_spread(rate, rows, n), THOUSANDTH_MM) for name, rate in rates.items()},
        "n_unmeasured": growth.fruits.n_unmeasured,
        "stopped": packed(_spread(growth.stopped, rows, n), SHARE),
        "odd": packed(_spread(growth.odd.astype(np.float64), rows, n)),
        "blocks": _blocks(growth),
        "pack_kg": pack_kg,
        "classes": _classes(growth, pack_kg),
    }


def _spread(values: Numbers, rows: NDArray[np.int64], n: int) -> Numbers:
    """Give all n fruits of the page what is known of some; NaN for the others."""
    everywhere = np.full((n, *values.shape[1:]), np.nan)
    everywhere[rows] = values
    return everywhere


def _blocks(growth: SeasonGrowth) -> list[dict[str, Any]]:
    """Tell counts, mean sizes on each day and rates of all fruits, of rows and of trees, with 90 % intervals."""
    drawn = growth.foretold.summaries["blocks"]
    mean, (low, high), counts = drawn.mean(axis=0), np.quantile(drawn, NINETY, axis=0), count_intervals(growth)
    return [
        {
            "kind": block.kind,
            "name": block.name,
            "n_fruits": block.n_fruits,
            "n_fruits_low": counts[number][0],
            "n_fruits_high": counts[number][1],
            **{
                name: values[number, :-1].round(2).tolist()
                for name, values in (("mean_mm", mean), ("low_mm", low), ("high_mm", high))
            },
            "rate_mm_per_day": [round(float(values[number, -1]), 4) for values in (low, mean, high)],
        }
        for number, block in enumerate(growth.blocks)
    ]


def _classes(growth: SeasonGrowth, pack_kg: float) -> list[dict[str, Any]]:
    lines = [dict(zip(CLASS_COLUMNS, line, strict=True)) for line in class_lines(growth, pack_kg)]
    return [{name: _plain(value) for name, value in line.items()} for line in lines]


def _plain(value: object) -> Any:
    return round(float(value), 3) if isinstance(value, float | np.floating) else None if value is None else str(value)
