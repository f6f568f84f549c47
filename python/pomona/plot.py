"""Pictures of a match: both clouds seen from above, a line for every fruit found again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pomona.atomic import whole_file
from pomona.cloud import as_cloud
from pomona.errors import PomonaError

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from pomona.cloud import Cloud
    from pomona.matching import Match

PICTURE_SUFFIXES = (".png", ".svg", ".pdf")

_MAP_COLOUR = "#2a5d8f"
_QUERY_COLOUR = "#c8502d"
_UNMATCHED_COLOUR = "#b5b5b5"
_COLOURS_OF_PROBABILITY = "summer_r"  # from yellow to green, as the lines of the paper's figures


@dataclass(frozen=True, eq=False)
class View:
    """The plane a cloud is drawn in.

    Attributes
    ----------
    axes
        (2, 3) orthonormal; to the right and upwards in the picture.
    labels
        What the two axes are, without the unit.
    """

    axes: NDArray[np.float64]
    labels: tuple[str, str]

    def project(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates of (N, 3) positions in the picture, (N, 2)."""
        return positions @ self.axes.T


def view_from_above(positions: NDArray[np.float64], up: ArrayLike | None = None) -> View:
    """Look down the vertical with the row to the right; without a vertical, onto the two largest extents.

    Parameters
    ----------
    positions
        (N, 3) metres.
    up
        The vertical in the frame of the positions, of any length but zero.
    """
    if up is None:
        along, across = _principal_axes(positions)[:2]
        return View(
            np.stack([along, across]), ("along the largest extent", "along the second extent, vertical unknown")
        )
    vertical = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    horizontal = positions - np.outer(positions @ vertical, vertical)
    along = _principal_axes(horizontal)[0]
    along = along - (along @ vertical) * vertical
    if np.linalg.norm(along) < 1e-9:  # all fruits on one vertical: any horizontal direction will do
        along = np.cross(vertical, np.eye(3)[np.argmin(np.abs(vertical))])
    along /= np.linalg.norm(along)
    return View(np.stack([along, np.cross(vertical, along)]), ("along the row", "across the row, seen from above"))


def _principal_axes(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) directions of falling extent as rows; the largest component of each is positive, so that none flips."""
    if len(positions) == 0:
        return np.eye(3)
    axes: NDArray[np.float64] = np.linalg.svd(positions - positions.mean(axis=0))[2]
    largest = axes[np.arange(3), np.argmax(np.abs(axes), axis=1)]
    return axes * np.where(largest < 0.0, -1.0, 1.0)[:, None]


def draw_match(query: Cloud, map: Cloud, match: Match, *, up_in_map: ArrayLike | None = None) -> Figure:
    """Draw the query aside of the map, and a line for every pair, coloured by its probability.

    A query that was not found is drawn in its own frame, turned so that its row lies to the right.

    Parameters
    ----------
    query, map
        The clouds that were matched, or the names of their files.
    match
        Their match.
    up_in_map
        The vertical in the map's frame where it is known.
    """
    from matplotlib.figure import Figure

    # Nothing is said of the unit of a file that was matched already.
    query, map = as_cloud(query, "free"), as_cloud(map, "free")
    view = view_from_above(map.positions, up_in_map)
    in_map = view.project(map.positions)
    in_query = _project_query(query.positions, match, view)
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


def _project_query(positions: NDArray[np.float64], match: Match, view: View) -> NDArray[np.float64]:
    if match.map_from_query is not None:
        return view.project(positions @ match.map_from_query[:3, :3].T + match.map_from_query[:3, 3])
    return view_from_above(positions).project(positions)


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


def require_picture_name(path: Path) -> None:
    """Refuse a file name that is no picture, before any work is done.

    Raises
    ------
    PomonaError
        The suffix is none of `PICTURE_SUFFIXES`.
    """
    if path.suffix.lower() not in PICTURE_SUFFIXES:
        found = path.suffix or "no suffix"
        raise PomonaError(f"{path}: found {found}, expected a picture named {', '.join(PICTURE_SUFFIXES)}")


def save_picture(figure: Figure, path: Path) -> None:
    """Write a figure as its suffix says; the file appears whole or not at all."""
    require_picture_name(path)
    with whole_file(path) as partial:
        figure.savefig(partial, format=path.suffix.lower()[1:])
