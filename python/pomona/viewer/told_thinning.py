"""Thinning as the page is told of it: who will drop, and in which order a tree gives its other fruits."""

from __future__ import annotations

from typing import Any

import numpy as np

from pomona.growth.season_growth import SeasonGrowth
from pomona.growth.thinning_plan import are_fruitlets, plan_thinning, rates_are_known
from pomona.viewer.packed_columns import packed
from pomona.viewer.told_fruits import SHARE, FruitsTold
from pomona.viewer.told_growth import THOUSANDTH_MM

__all__ = ["thinning_told"]


def thinning_told(growth: SeasonGrowth, fruits: FruitsTold, target: int | None) -> dict[str, Any] | None:
    """Tell the plan for every target at once; None where no fruit was measured on both of the last two days.

    ``place`` of a fruit is its place among those that its tree keeps, from 1: with a target of so many fruits, those of
    a higher place are thinned. It is NaN for what will drop, and for what does not hang.
    """
    if not rates_are_known(growth):
        return None
    plan = plan_thinning(growth, target)
    rows = fruits.rows_of(growth.fruits.ids[plan.rows])
    columns = {
        "cluster": (plan.clusters + 1, 1.0),
        "cluster_size": (plan.cluster_sizes, 1.0),
        "rate_mm_per_day": (plan.rates_mm_per_day, THOUSANDTH_MM),
        "drop_probability": (plan.drop.probabilities, SHARE),
        "place": (plan.places, 1.0),
    }
    told: dict[str, Any] = {}
    for name, (values, step) in columns.items():
        everywhere = np.full(len(fruits.ids), np.nan)
        everywhere[rows] = values
        told[name] = packed(everywhere, step)
    before, last = sorted(set(growth.fruits.days))[-2:]
    days = {"from": before.isoformat(), "to": last.isoformat()}
    about = {"target": target, "are_fruitlets": are_fruitlets(growth), "is_told": plan.drop.is_told}
    return {**about, "fast_mm_per_day": plan.drop.fast_mm_per_day, **days, **told}
