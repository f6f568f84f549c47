"""Growth as pictures: curves over the season, sizes now and at the harvest, and where along the row."""

from __future__ import annotations

from datetime import date
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.growth.drawn_names import drawn_name
from pomona.growth.foretelling import NINETY
from pomona.growth.growth_tables import used_classes
from pomona.growth.measured import MeasuredFruits
from pomona.growth.season_growth import SeasonGrowth
from pomona.plot.files import save_picture
from pomona.plot.sheet import FAINT, INK
from pomona.viewer.row_frame import guessed_vertical, known_vertical, page_from_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_curves", "draw_sizes", "draw_variability", "write_pictures"]

BLUE, ORANGE, RED = "#0072b2", "#e69f00", "#d55e00"
"""Of Okabe and Ito: told apart by all eyes."""

_MOST_CURVES = 150
"""Fruits that are drawn one by one; more are a grey mass."""

_JITTER_S = 36_000.0
"""Dots of a visit are drawn side by side, within a day."""

_SPAN_BY = (0.02, 0.98)
"""Quantiles of the rates that the colours span: one odd fruit does not bleach the others."""

_LEAST_SPAN = 0.02
"""Of the colours, mm a day: fruits that grow alike are of one colour."""

_MARGIN_M, _LEAST_SPAN_M = 0.15, 1.0
"""Around the fruits, and of the picture: a single fruit hangs somewhere too."""

_INCHES_PER_M, _HIGHEST_IN, _LOWEST_IN = 1.2, 3.6, 1.2
"""Of a row, and how high it is drawn."""

_MOST_TREE_NAMES = 40


def write_pictures(folder: Path, growth: SeasonGrowth) -> tuple[Path, ...]:
    """Write curves.png, sizes.png and variability.png."""
    drawn = {"curves.png": draw_curves, "sizes.png": draw_sizes, "variability.png": draw_variability}
    for name, draw in drawn.items():
        save_picture(draw(growth), folder / name)
    return tuple(folder / name for name in drawn)


def draw_curves(growth: SeasonGrowth) -> Figure:
    """Draw the sizes of fruits over the season, and the mean of all with its 90 % interval."""
    figure, axes = _figure(8.0, 4.6)
    at = _dates(growth.days)
    told = growth.foretold
    hanging = np.flatnonzero(growth.fruits.hanging)
    some = hanging[:: max(1, len(hanging) // _MOST_CURVES)]
    n_visits = len(growth.fruits.days)
    axes.plot(at, told.sizes_mm[some].T, color=FAINT, linewidth=0.5, alpha=0.6, zorder=1)
    axes.plot([], [], color=FAINT, linewidth=1.0, label="curves of fruits")
    jitter = np.linspace(-_JITTER_S, _JITTER_S, len(some)).astype("timedelta64[s]")
    for column in range(n_visits):
        axes.plot(
            at[column] + jitter, growth.fruits.diameters_mm[some, column], ".", color=INK, markersize=2.5, zorder=2
        )
    means = growth.foretold.summaries["blocks"][:, 0, :-1]
    low, high = np.quantile(means, NINETY, axis=0)
    axes.fill_between(at, low, high, color=BLUE, alpha=0.25, linewidth=0, zorder=3)
    axes.plot(at, means.mean(axis=0), color=BLUE, linewidth=2.0, marker="o", label="mean of all, with 90 %", zorder=4)
    if growth.harvest is not None:
        axes.axvline(at[n_visits - 1], color=FAINT, linestyle=":")
        axes.text(
            at[n_visits - 1], 0.02, " last visit", transform=axes.get_xaxis_transform(), color=INK, fontsize="small"
        )
    axes.plot([], [], ".", color=INK, label="sizes as measured")
    axes.set(ylabel="diameter, mm")
    n_fruits = growth.blocks[0].n_fruits
    _say(figure, f"{amount(n_fruits, 'fruit')} over {amount(n_visits, 'visit')}", _about(growth))
    axes.legend(frameon=False, labelcolor=INK, loc="upper left")
    _days_below(axes)
    return figure


def draw_sizes(growth: SeasonGrowth) -> Figure:
    """Draw how many fruits are in each size class, on the last visit and at the harvest."""
    figure, axes = _figure(8.0, 4.2)
    counts = growth.foretold.summaries["counts"]
    now = len(growth.fruits.days) - 1
    rows = used_classes(growth)
    shown = [(now, BLUE)] + ([(now + 1, ORANGE)] if growth.harvest else [])
    width = 0.8 / len(shown)
    for place, (column, colour) in enumerate(shown):
        of_day = counts[:, rows, column]
        mean, (low, high) = of_day.mean(axis=0), np.quantile(of_day, NINETY, axis=0)
        x = np.arange(len(rows)) + (place - (len(shown) - 1) / 2) * width
        errors = np.maximum([mean - low, high - mean], 0.0)
        axes.bar(x, mean, width, color=colour, label=f"{growth.days[column]}")
        axes.errorbar(x, mean, errors, fmt="none", ecolor=INK, elinewidth=1, capsize=2)
    limits = [f"{limit:g}" for limit in growth.limits_mm]
    names = [f"< {limits[0]}", *map("-".join, pairwise(limits)), f"{limits[-1]} +"]
    axes.set_xticks(np.arange(len(rows)), [names[row] for row in rows])
    axes.set(xlabel="size class, mm", ylabel="fruits")
    _legend_above(axes)
    _say(figure, "Sizes now" + (" and at the harvest" if growth.harvest else ""), "bars: 90 % intervals of the counts")
    return figure


def draw_variability(growth: SeasonGrowth) -> Figure:
    """Draw each fruit where it hangs, in the colour of its growth, and the mean size of each tree below."""
    fruits = growth.fruits
    places, rates = _seen_from_the_side(fruits), growth.foretold.rates_mm_per_day[fruits.hanging]
    figure, above, below, bar = _row_of_axes(places[fruits.hanging])
    low, high = np.quantile(rates, _SPAN_BY)
    middle, half = (low + high) / 2, max(float(high - low), _LEAST_SPAN) / 2
    x, y = places[fruits.hanging].T
    marks = above.scatter(x, y, c=rates, cmap="viridis", vmin=middle - half, vmax=middle + half, s=16)
    figure.colorbar(marks, cax=bar, label="growth, mm a day")
    above.set(ylabel="above the lowest, m")
    above.tick_params(labelbottom=False)
    _mean_of_trees(below, growth, places[:, 0])
    below.set(xlabel="along the row, m", ylabel="mean diameter, mm")
    for axes in (above, below):
        _quiet(axes)
    _say(figure, "Where the fruits grow fast", f"{growth.days[len(fruits.days) - 1]}, last visit")
    return figure


def _seen_from_the_side(fruits: MeasuredFruits) -> NDArray[np.float64]:
    """Places along the row and above the lowest fruit that hangs, (N, 2), metres."""
    known = known_vertical(fruits.path) if fruits.path.is_file() else None
    hanging = fruits.cloud.select(np.flatnonzero(fruits.hanging).tolist())
    up = guessed_vertical(hanging) if known is None else known
    page = page_from_map(hanging.positions, up / np.linalg.norm(up))
    return np.asarray((fruits.cloud.positions @ page[:3, :3].T + page[:3, 3])[:, ::2])


def _row_of_axes(places: NDArray[np.float64]) -> tuple[Figure, Axes, Axes, Axes]:
    """Axes for a row, as long in them as high, and below it along the same metres; and for a bar of colours."""
    from matplotlib.figure import Figure

    lows, highs = places.min(axis=0) - _MARGIN_M, places.max(axis=0) + _MARGIN_M
    spans = np.maximum(highs - lows, _LEAST_SPAN_M)
    left, right, bottom, top, gap, lower = 0.8, 1.2, 0.6, 0.85, 0.45, 1.9
    width = float(np.clip(_INCHES_PER_M * spans[0], 6.0, 28.0))
    inches_per_m = min(width / spans[0], _HIGHEST_IN / spans[1])
    upper = max(inches_per_m * spans[1], _LOWEST_IN)
    whole = left + width + right, bottom + lower + gap + upper + top
    figure = Figure(figsize=whole, dpi=110)

    def axes_at(x: float, y: float, size: tuple[float, float]) -> Axes:
        return figure.add_axes((x / whole[0], y / whole[1], size[0] / whole[0], size[1] / whole[1]))

    above = axes_at(left, bottom + lower + gap, (width, upper))
    below = axes_at(left, bottom, (width, lower))
    bar = axes_at(left + width + 0.15, bottom + lower + gap, (0.15, upper))
    middle = (lows + highs) / 2
    half_width, half_height = width / inches_per_m / 2, upper / inches_per_m / 2
    for axes in (above, below):
        axes.set_xlim(middle[0] - half_width, middle[0] + half_width)
    above.set_ylim(middle[1] - half_height, middle[1] + half_height)
    return figure, above, below, bar


def _mean_of_trees(axes: Axes, growth: SeasonGrowth, along_m: NDArray[np.float64]) -> None:
    drawn = growth.foretold.summaries["blocks"]
    now = len(growth.fruits.days) - 1
    trees = [row for row, block in enumerate(growth.blocks) if block.kind == "tree" and block.name] or [0]
    x = np.array([growth.blocks[row].mean_of(along_m) for row in trees])
    for column, colour in ((now, BLUE), (now + 1, ORANGE))[: 2 if growth.harvest else 1]:
        of_day = drawn[:, trees, column]
        mean, (low, high) = of_day.mean(axis=0), np.quantile(of_day, NINETY, axis=0)
        errors = np.maximum([mean - low, high - mean], 0.0)
        axes.errorbar(x, mean, errors, fmt="o", color=colour, capsize=3, label=f"{growth.days[column]}")
    if len(trees) <= _MOST_TREE_NAMES:
        for place, row in zip(x, trees, strict=True):
            text = drawn_name(growth.blocks[row].title)
            axes.text(place, 0.02, text, transform=axes.get_xaxis_transform(), ha="center", color=INK)
    axes.margins(y=0.25)
    _legend_above(axes)


def _legend_above(axes: Axes) -> None:
    """Name the days beside the title, where nothing is drawn."""
    axes.legend(frameon=False, labelcolor=INK, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0)


def _figure(width_in: float, height_in: float) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=110, layout="constrained")
    axes = figure.subplots()
    _quiet(axes)
    return figure, axes


def _quiet(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)
    axes.tick_params(colors=INK, color=FAINT, labelsize="small")


def _say(figure: Figure, title: str, about: str) -> None:
    figure.suptitle(title, x=0.02, ha="left", fontsize="x-large", fontweight="bold", color=INK)
    figure.axes[0].set_title(about, loc="left", fontsize="medium", color=INK)


def _about(growth: SeasonGrowth) -> str:
    drawn = growth.foretold.summaries["blocks"][:, 0]
    said = f"{growth.curve.fitted.family.name}; {drawn[:, -1].mean():.2f} mm a day at the last visit"
    if growth.harvest is None:
        return said
    low, high = np.quantile(drawn[:, -2], NINETY)
    return f"{said}; {drawn[:, -2].mean():.1f} mm on {growth.harvest} ({low:.1f} to {high:.1f})"


def _dates(days: tuple[date, ...]) -> NDArray[np.datetime64]:
    return np.array(days, dtype="datetime64[s]")


def _days_below(axes: Axes) -> None:
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    locator = AutoDateLocator(minticks=3, maxticks=9)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
