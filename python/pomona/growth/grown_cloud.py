"""Fruits with their growth as columns, for a GIS to colour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.growth.season_growth import SeasonGrowth

__all__ = ["grown_cloud"]


def grown_cloud(growth: SeasonGrowth) -> FruitCloud:
    """Give the fruits where they were last seen, with tree, size by the curve, rate, forecast and `outlier`.

    What is gone has no size now and no rate: it has the diameter that was measured last.
    """
    told, is_told = growth.foretold, growth.is_told
    now = len(growth.fruits.days) - 1
    columns = {"size_mm": (told.sizes_mm[:, now], now)}
    columns |= {
        "rate_mm_per_day": (told.rates_mm_per_day, now),
        "rate_sigma_mm_per_day": (told.rate_sigmas_mm_per_day, now),
    }
    if growth.harvest is not None:
        columns |= {
            "forecast_mm": (told.sizes_mm[:, -1], -1),
            "forecast_low_mm": (told.lows_mm[:, -1], -1),
            "forecast_high_mm": (told.highs_mm[:, -1], -1),
        }
    extras = {name: _cells(np.where(is_told[:, day], column, np.nan)) for name, (column, day) in columns.items()}
    extras |= {"tree": growth.fruits.trees.of_fruits(), "outlier": tuple(str(int(odd)) for odd in growth.odd)}
    cloud = growth.fruits.cloud
    found = replace(cloud, extras={**cloud.extras, **extras})
    return found.select(np.argsort(growth.fruits.ids, kind="stable"))


def _cells(column: NDArray[np.float64]) -> tuple[str, ...]:
    return tuple("" if np.isnan(value) else f"{value:.4f}" for value in column)
