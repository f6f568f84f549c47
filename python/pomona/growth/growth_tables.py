"""Growth as tables: a line a size, a fruit, a block, a size class."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.csv_rows import write_rows
from pomona.growth.blocks import HALF_A_FRUIT
from pomona.growth.foretelling import NINETY
from pomona.growth.season_growth import SeasonGrowth

__all__ = [
    "BLOCK_COLUMNS",
    "CLASS_COLUMNS",
    "CURVE_COLUMNS",
    "FRUIT_COLUMNS",
    "SERIES_COLUMNS",
    "class_lines",
    "count_intervals",
    "used_classes",
    "write_table",
    "write_tables",
]

SERIES_COLUMNS = ("fruit_id", "date", "diameter_mm", "sigma_mm")
CURVE_COLUMNS = ("fruit_id", "date", "diameter_mm", "low_mm", "high_mm")
FRUIT_COLUMNS = (
    *("fruit_id", "tree", "n_dates", "rate_mm_per_day", "rate_sigma_mm_per_day", "rate_relative_per_day"),
    *("forecast_mm", "forecast_low_mm", "forecast_high_mm", "outlier", "hangs_probability", "stopped_probability"),
)
BLOCK_COLUMNS = (
    *("block", "name", "n_fruits", "x", "y", "z", "date", "mean_mm", "mean_low_mm", "mean_high_mm", "spread_mm"),
    *("rate_mm_per_day", "rate_sigma_mm_per_day"),
    *("forecast_date", "forecast_mm", "forecast_low_mm", "forecast_high_mm", "n_fruits_low", "n_fruits_high"),
)
CLASS_COLUMNS = (
    *("date", "from_mm", "below_mm", "n_fruits", "n_fruits_low", "n_fruits_high"),
    *("kg", "kg_low", "kg_high", "packs", "packs_low", "packs_high"),
)

Numbers = NDArray[np.float64]
Line = Sequence[object]


def write_tables(folder: Path, growth: SeasonGrowth, *, pack_kg: float) -> tuple[Path, ...]:
    """Write series.csv, curves.csv, fruits.csv, blocks.csv and classes.csv; each appears whole or not at all.

    Parameters
    ----------
    folder : Path
        Is there.
    growth : SeasonGrowth
    pack_kg : float
        Kilograms that a pack holds.
    """
    tables = {
        "series.csv": (SERIES_COLUMNS, _series(growth)),
        "curves.csv": (CURVE_COLUMNS, _curves(growth)),
        "fruits.csv": (FRUIT_COLUMNS, _fruits(growth)),
        "blocks.csv": (BLOCK_COLUMNS, _blocks(growth)),
        "classes.csv": (CLASS_COLUMNS, class_lines(growth, pack_kg)),
    }
    for name, (columns, lines) in tables.items():
        write_table(folder / name, columns, lines)
    return tuple(folder / name for name in tables)


def write_table(path: Path, columns: Sequence[str], lines: Iterable[Line]) -> None:
    """Write a CSV; numbers with four decimals at most, None and NaN as nothing."""
    with whole_file(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        write_rows(file, itertools.chain([columns], ([_cell(value) for value in line] for line in lines)))


def _cell(value: object) -> object:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.4f}".rstrip("0").rstrip(".")
    return "" if value is None else value


def _in_order_of_ids(growth: SeasonGrowth) -> list[int]:
    return list(map(int, np.argsort(growth.fruits.ids, kind="stable")))


def _series(growth: SeasonGrowth) -> Iterator[Line]:
    """Sizes as they were measured, with all that is unsure about them: their noise and their visit's scale."""
    fruits, shape = growth.fruits, growth.curve.fitted.likeliest
    sigmas_mm = np.hypot(shape.noise_mm, shape.visit_spread * fruits.diameters_mm)
    for row in _in_order_of_ids(growth):
        for column in np.flatnonzero(~np.isnan(fruits.diameters_mm[row])).tolist():
            day = fruits.days[column]
            yield fruits.ids[row], day, fruits.diameters_mm[row, column], sigmas_mm[row, column]


def _curves(growth: SeasonGrowth) -> Iterator[Line]:
    told, is_told = growth.foretold, growth.is_told
    for row in _in_order_of_ids(growth):
        for column in np.flatnonzero(is_told[row]).tolist():
            sizes = told.sizes_mm[row, column], told.lows_mm[row, column], told.highs_mm[row, column]
            yield growth.fruits.ids[row], growth.days[column], *sizes


def _fruits(growth: SeasonGrowth) -> Iterator[Line]:
    fruits, told = growth.fruits, growth.foretold
    trees, n_days, hanging, is_growing = fruits.trees.of_fruits(), fruits.n_days, fruits.hanging, growth.is_growing
    chances = fruits.hang_chances
    for row in _in_order_of_ids(growth):
        is_foretold = growth.harvest is not None and hanging[row]
        forecast = (sizes[row, -1] if is_foretold else None for sizes in (told.sizes_mm, told.lows_mm, told.highs_mm))
        rates = told.rates_mm_per_day, told.rate_sigmas_mm_per_day, told.relative_rates_per_day
        about = fruits.ids[row], trees[row], n_days[row], *(rate[row] if is_growing[row] else None for rate in rates)
        yield *about, *forecast, int(growth.odd[row]), chances[row], growth.stopped[row]


def _blocks(growth: SeasonGrowth) -> Iterator[Line]:
    drawn = growth.foretold.summaries["blocks"]
    mean, (low, high), sigma = drawn.mean(axis=0), np.quantile(drawn, NINETY, axis=0), drawn.std(axis=0)
    now, counts = len(growth.fruits.days) - 1, count_intervals(growth)
    for row, block in enumerate(growth.blocks):
        place, sizes_mm = block.mean_of(growth.fruits.cloud.positions), growth.foretold.sizes_mm[:, now]
        spread_mm = np.sqrt(block.mean_of((sizes_mm - block.mean_of(sizes_mm)) ** 2))
        about = block.kind, block.name, block.n_fruits, *place, growth.days[now]
        forecast: Line = (None,) * 4
        if growth.harvest is not None:
            forecast = growth.harvest, mean[row, -2], low[row, -2], high[row, -2]
        current = mean[row, now], low[row, now], high[row, now], spread_mm
        yield *about, *current, mean[row, -1], sigma[row, -1], *forecast, *counts[row]


def count_intervals(growth: SeasonGrowth) -> list[tuple[int, int]]:
    """Return the ends of the 90 % interval of how many fruits of each block hang."""
    low, high = np.quantile(growth.foretold.summaries["n_fruits"], NINETY, axis=0)
    return list(zip(np.rint(low).astype(int).tolist(), np.rint(high).astype(int).tolist(), strict=True))


def class_lines(growth: SeasonGrowth, pack_kg: float) -> list[Line]:
    """Count fruits, kilograms and packs by size class, on the last visit and at the harvest; empty ends left out."""
    counts, masses_kg = (_with_interval(growth.foretold.summaries[name]) for name in ("counts", "masses_kg"))
    limits: list[float | None] = [None, *growth.limits_mm.tolist(), None]
    lines: list[Line] = []
    for column in range(len(growth.fruits.days) - 1, len(growth.days)):
        for row in used_classes(growth).tolist():
            amounts = [each[row, column] for each in (*counts, *masses_kg)]
            packs = [kg / pack_kg for kg in amounts[3:]]
            lines.append((growth.days[column], limits[row], limits[row + 1], *amounts, *packs))
    return lines


def used_classes(growth: SeasonGrowth) -> NDArray[np.int64]:
    """Rows of the size classes from the smallest to the largest fruit, of the last visit and of the harvest."""
    counts = growth.foretold.summaries["counts"][:, :, len(growth.fruits.days) - 1 :]
    found = np.flatnonzero(counts.mean(axis=0).sum(axis=1) >= HALF_A_FRUIT)
    return np.arange(found.min(), found.max() + 1) if len(found) else found


def _with_interval(drawn: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    low, high = np.quantile(drawn, NINETY, axis=0)
    return drawn.mean(axis=0), low, high
