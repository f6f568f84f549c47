"""The picture of a match: which one, and of what."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from pomona.amounts import amount
from pomona.arrays import checked_array
from pomona.cloud import as_cloud
from pomona.errors import PomonaError
from pomona.matching import Match
from pomona.reading import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from pomona.cloud import Cloud, FruitCloud

__all__ = ["PlotView", "draw_match"]

PlotView = Literal["row", "lines"]


def draw_match(
    query: Cloud, map: Cloud, match: Match, *, up_in_map: ArrayLike | None = None, view: PlotView = "row"
) -> Figure:
    """Draw a match.

    Parameters
    ----------
    query, map
        The clouds that were matched, or the names of their files.
    match
        Their match.
    up_in_map
        The vertical in the map's frame, (3,), where it is known.
    view
        ``row``: both clouds in the map's frame, from the side and from above: what was found again, what is new, what
        was missed. ``lines``: the query drawn aside and a line for every pair, coloured by its probability.

    Raises
    ------
    PomonaError
        There is no such view, a file cannot be read, the clouds are not those that were matched, or the vertical is
        no direction.
    """
    from pomona.plot.lines import draw_lines
    from pomona.plot.row import draw_row

    if view not in get_args(PlotView):
        raise PomonaError(f"view: found {view!r}, expected one of {', '.join(get_args(PlotView))}")
    if not isinstance(match, Match):
        raise PomonaError(f"match: found {shown(match)}, expected what pomona.match gives")
    draw = draw_lines if view == "lines" else draw_row
    # Nothing is said of the unit of a file that was matched already.
    in_query, in_map = as_cloud(query, "free"), as_cloud(map, "free")
    _require_matched("query", in_query, match.n_query)
    _require_matched("map", in_map, match.n_map)
    return draw(in_query, in_map, match, up_in_map=None if up_in_map is None else _direction(up_in_map))


def _require_matched(side: str, cloud: FruitCloud, n_matched: int) -> None:
    if len(cloud) != n_matched:
        raise PomonaError(f"{side}: found {amount(len(cloud), 'fruit')}, expected the {n_matched} that were matched")


def _direction(up_in_map: ArrayLike) -> NDArray[np.float64]:
    direction: NDArray[np.float64] = checked_array("up_in_map", up_in_map, np.float64, (3,))
    if not np.isfinite(direction).all() or not direction.any():
        raise PomonaError(f"up_in_map: found {direction.tolist()}, expected a finite vector that is not zero")
    return direction
