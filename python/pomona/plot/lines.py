"""The match as the figures of the paper have it: the query drawn aside, a line for every fruit found again."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.plot.projections import Projection, view_from_above
from pomona.torn_rows import laid_in_parts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from pomona.cloud import FruitCloud
    from pomona.matching import Match

__all__ = ["draw_lines"]

_MAP_COLOUR = "#2a5d8f"
_QUERY_COLOUR = "#c8502d"
_UNMATCHED_COLOUR = "#b5b5b5"
_COLOURS_OF_PROBABILITY = "summer_r"  # from yellow to green, as the lines of the paper's figures


def draw_lines(query: FruitCloud, map: FruitCloud, match: Match, *, up_in_map: ArrayLike | None = None) -> Figure:
    """Draw the query aside of the map, and a line for every pair, coloured by its probability.

    A query that was not found is drawn in its own frame, turned so that its row lies to the right.

    Parameters
    ----------
    query, map
        The clouds that were matched.
    match
        Their match.
    up_in_map
        The vertical in the map's frame where it is known.
    """
    from matplotlib.figure import Figure

    view = view_from_above(map.positions, up_in_map)
    in_map = view.project(map.positions)
    in_query = _project_query(query, match, view)
    if match.map_from_query is None and len(map) and len(query):
        in_query += in_map.mean(axis=0) - in_query.mean(axis=0)
    aside_m = _distance_aside(in_map, in_query)
    in_query[:, 1] += aside_m

    figure = Figure(figsize=_size_in_inches(np.concatenate([in_map, in_query])), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    _draw_pairs(figure, axes, in_query[match.pairs[:, 0]], in_map[match.pairs[:, 1]], match.probabilities)
    _draw_fruits(axes, in_map, match.pairs[:, 1], "map", "o", _MAP_COLOUR)
    _draw_fruits(axes, in_query, match.pairs[:, 0], "query", "^", _QUERY_COLOUR)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{view.labels[0]} (m)")
    axes.set_ylabel(f"{view.labels[1]} (m)\nquery drawn {aside_m:.1f} m aside")
    figure.suptitle(_title(match), fontsize="large")
    figure.legend(loc="outside lower center", ncols=4 if figure.get_figwidth() > 9.0 else 2, frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def _project_query(query: FruitCloud, match: Match, view: Projection) -> NDArray[np.float64]:
    if match.parts:
        return view.project(laid_in_parts(match, query).positions)
    return view_from_above(query.positions).project(query.positions)


def _distance_aside(in_map: NDArray[np.float64], in_query: NDArray[np.float64]) -> float:
    """How far the query must move up in the picture to stand clear of the map, in tenths of a metre."""
    if len(in_map) == 0 or len(in_query) == 0:
        return 0.0
    height = max(np.ptp(in_map[:, 1]), np.ptp(in_query[:, 1]))
    return float(np.round(in_map[:, 1].max() - in_query[:, 1].min() + 0.5 * height, 1))


def _size_in_inches(points: NDArray[np.float64]) -> tuple[float, float]:
    """Fit the figure to what is drawn, so that a metre is equally long both ways without empty margins."""
    width_m, height_m = np.ptp(points, axis=0) if len(points) else (1.0, 1.0)
    inches_per_metre = min(8.5 / max(width_m, 0.1), 5.0 / max(height_m, 0.1))
    return max(width_m * inches_per_metre + 1.6, 6.5), max(height_m * inches_per_metre + 1.4, 4.0)


def _draw_pairs(
    figure: Figure,
    axes: Axes,
    ends_in_query: NDArray[np.float64],
    ends_in_map: NDArray[np.float64],
    probabilities: NDArray[np.float64],
) -> None:
    from matplotlib.collections import LineCollection

    if len(probabilities) == 0:
        return
    # The surest pairs are drawn last, on top.
    order = np.argsort(probabilities, kind="stable")
    lines = LineCollection(
        list(np.stack([ends_in_query, ends_in_map], axis=1)[order]),
        array=probabilities[order],
        cmap=_COLOURS_OF_PROBABILITY,
        clim=(0.0, 1.0),
        linewidths=float(np.clip(300.0 / len(probabilities), 0.2, 0.8)),
        alpha=0.8,
        zorder=1,
    )
    axes.add_collection(lines)
    figure.colorbar(lines, ax=axes, label="probability of the pair", shrink=0.7, pad=0.01)


def _draw_fruits(
    axes: Axes, points: NDArray[np.float64], matched: NDArray[np.int64], side: str, marker: str, colour: str
) -> None:
    alone = np.setdiff1d(np.arange(len(points)), matched)
    area = float(np.clip(8000.0 / max(len(points), 1), 5.0, 16.0))
    drawn = [
        (alone, _UNMATCHED_COLOUR, f"{side}: {len(alone)} without a partner", 2),
        (matched, colour, f"{side}: {len(matched)} found again", 3),
    ]
    for rows, fill, label, zorder in drawn:
        x, y = points[rows].T
        axes.scatter(
            x,
            y,
            s=area,
            marker=marker,
            color=fill,
            edgecolors="white",
            linewidths=0.02 * area,
            label=label,
            zorder=zorder,
        )


def _title(match: Match) -> str:
    clouds = f"{match.n_query} fruits of the query, {match.n_map} of the map"
    if match.map_from_query is None:
        return f"{match.status.value}: {clouds}"
    return f"{match.status.value}: {clouds}, {len(match.pairs)} found again, log-odds {match.log_odds:.0f}"
