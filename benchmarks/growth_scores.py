"""Foretold sizes against the truth."""

import numpy as np
from numpy.typing import NDArray

from benchmarks.growth_draw import DrawnSizes
from pomona.growth.foretelling import NINETY
from pomona.growth.season_growth import SeasonGrowth


def scores(found: SeasonGrowth, drawn: DrawnSizes) -> dict[str, object]:
    told, true_mm = found.foretold, drawn.true_mm
    judged = ~np.isnan(true_mm)
    low, high = told.lows_mm[:, -1], told.highs_mm[:, -1]
    errors = (told.sizes_mm[:, -1] - true_mm)[judged]
    block, *trees = (covers(found, number, true_mm) for number in range(len(found.blocks)))
    return {
        "rate_error_mm_per_day": float(np.nanmedian(np.abs(told.rates_mm_per_day - drawn.true_rates))),
        "bias_mm": float(errors.mean()),
        "rmse_mm": float(np.sqrt((errors**2).mean())),
        "n_fruits": int(judged.sum()),
        "fruits_covered": int(((low <= true_mm) & (true_mm <= high))[judged].sum()),
        "block_covered": int(block),
        "n_trees": len(trees),
        "trees_covered": sum(trees),
    }


def covers(found: SeasonGrowth, number: int, true_mm: NDArray[np.float64]) -> bool:
    """Whether the interval of a block's mean holds the truth."""
    low, high = np.quantile(found.foretold.summaries["blocks"][:, number, -2], NINETY)
    chances = np.where(np.isnan(true_mm), 0.0, found.blocks[number].chances)
    return bool(low <= chances @ np.nan_to_num(true_mm) / chances.sum() <= high)


def line(rows: list[dict[str, object]]) -> tuple[str, ...]:
    def column(key: str) -> NDArray[np.float64]:
        return np.array([row[key] for row in rows], dtype=float)

    biases = column("bias_mm")
    shares = (
        column("fruits_covered").sum() / column("n_fruits").sum(),
        column("block_covered").mean(),
        column("trees_covered").sum() / column("n_trees").sum(),
    )
    return (
        str(len(rows)),
        f"{np.median(column('rate_error_mm_per_day')):.3f}",
        f"{biases.mean():+.2f}",
        f"{biases[np.abs(biases).argmax()]:+.2f}",
        f"{np.sqrt((column('rmse_mm') ** 2).mean()):.2f}",
        *(f"{share:.3f}" for share in shares),
    )
