"""Both visits in one frame, from the side and from above: what was found again, what is new, what was missed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pomona.plot.arrows import Arrows
from pomona.plot.fates import Fates
from pomona.plot.projections import Projection, side_and_plan
from pomona.plot.sheet import FAINT, INK, Sheet
from pomona.plot.trees import Trees

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from pomona.cloud import FruitCloud
    from pomona.matching import Match

__all__ = ["draw_row"]


ROOM_M = 0.5
"""For tips of arrows beyond the fruits, at most."""


@dataclass(frozen=True)
class Mark:
    """How fruits of one fate are drawn; colours of Okabe and Ito, and a shape of its own for each."""

    name: str
    marker: str
    colour: str
    area: float
    filled: bool = True


FOUND = Mark("found again", "o", "#0072b2", 1.0)
NEW = Mark("new", "^", "#e69f00", 1.2)
MISSED = Mark("missed", "o", "#d55e00", 1.1, filled=False)
ELSEWHERE = Mark("not in view", ".", FAINT, 0.9)
MAP = Mark("in the map", "o", "#0072b2", 1.0)
QUERY = Mark("in the query", "^", "#e69f00", 1.1)


def draw_row(query: FruitCloud, map: FruitCloud, match: Match, *, up_in_map: ArrayLike | None = None) -> Figure:
    """Draw both clouds in the map's frame; a query that was not found below the map, each in a frame of its own.

    Parameters
    ----------
    query, map
        The clouds that were matched.
    match
        Their match.
    up_in_map
        The vertical in the map's frame where it is known.
    """
    if match.map_from_query is None:
        return _apart(query, map, match, up_in_map)
    fates = Fates.of(query, map, match)
    everything = np.concatenate([map.positions, fates.found, fates.new])
    views = side_and_plan(everything, up_in_map)
    places = [view.project(everything) for view in views]
    arrows = Arrows.on(Sheet.of(places), fates.was, fates.found)
    sheet = Sheet.of([_with_room(shown, arrows.ends(view)) for shown, view in zip(places, views, strict=True)])
    _draw_fates(sheet, views, fates, arrows.on_another(sheet))
    _mark_trees(sheet, Trees.along(views[0].axes[0], map, everything))
    sheet.panels[-1].set_xlabel(f"{views[0].labels[0]} (m)" + ("" if up_in_map is not None else ", vertical not told"))
    sheet.title(f"Found: {len(fates.found)} of {match.n_query} fruits seen again", _about(match))
    sheet.legend(sheet.panels[0])
    return sheet.figure


def _about(match: Match) -> str:
    context = f"{match.n_map} fruits in the map; log-odds {match.log_odds:.0f}"
    if not len(match.pairs):
        return context
    usual_cm, usual = 100 * np.median(match.distances_m), np.median(match.probabilities)
    return f"median: {usual_cm:.1f} cm from where they hung, probability {usual:.2f}; {context}"


def _apart(query: FruitCloud, map: FruitCloud, match: Match, up_in_map: ArrayLike | None) -> Figure:
    views = side_and_plan(map.positions, up_in_map)[0], side_and_plan(query.positions)[0]
    points = [_centred(view.project(cloud.positions)) for view, cloud in zip(views, (map, query), strict=True)]
    sheet = Sheet.of(points)
    for axes, view, shown, kind in zip(sheet.panels, views, points, (MAP, QUERY), strict=True):
        _scatter(axes, shown, kind)
        axes.set_ylabel(f"{view.labels[1]} (m)")
    sheet.panels[-1].set_xlabel("along the row (m), each in its own frame")
    sheet.title(
        f"{match.status.value}: the query has no place in the map",
        f"{match.n_query} fruits in the query, {match.n_map} in the map",
    )
    sheet.legend(*sheet.panels)
    return sheet.figure


def _centred(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points - points.mean(axis=0) if len(points) else points


def _with_room(places: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Add tips of arrows, (M, 2), to what a panel shows, (N, 2); one pair that is wrong shall not empty the panel."""
    least, most = places.min(axis=0, initial=np.inf), places.max(axis=0, initial=-np.inf)
    return np.concatenate([places, np.clip(ends, least - ROOM_M, most + ROOM_M)])


def _draw_fates(sheet: Sheet, views: tuple[Projection, Projection], fates: Fates, arrows: Arrows) -> None:
    kinds = ((fates.was, FOUND), (fates.new, NEW), (fates.missed, MISSED), (fates.elsewhere, ELSEWHERE))
    for axes, view in zip(sheet.panels, views, strict=True):
        for above, (positions, kind) in enumerate(kinds):
            _scatter(axes, view.project(positions), kind, zorder=4 - above)
        drawn = arrows.draw(axes, view)
        if drawn is not None and axes is sheet.panels[0]:
            arrows.tell(axes, drawn)
        axes.set_ylabel(f"{view.labels[1]} (m)")
        axes.label_outer()


def _scatter(axes: Axes, points: NDArray[np.float64], kind: Mark, zorder: int = 3) -> None:
    axes.scatter(
        points[:, 0],
        points[:, 1],
        s=kind.area * float(np.clip(9000.0 / max(len(points), 1), 9.0, 26.0)),
        marker=kind.marker,
        facecolors=kind.colour if kind.filled else "none",
        edgecolors="white" if kind.filled else kind.colour,
        linewidths=0.4 if kind.filled else 1.1,
        label=f"{len(points)} {kind.name}",
        zorder=zorder,
    )


def _mark_trees(sheet: Sheet, trees: Trees) -> None:
    names = ["tree?"] * len(trees.places) if trees.names is None else [f"tree {name}" for name in trees.names]
    for place_m, name in zip(trees.places.tolist(), names, strict=True):
        for axes in sheet.panels:
            axes.axvline(place_m, color=FAINT, linewidth=0.8, linestyle="--" if trees.names is None else "-", zorder=0)
        sheet.panels[0].annotate(
            name,
            (place_m, 1.0),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="bottom",
            fontsize="small",
            color=INK,
        )
