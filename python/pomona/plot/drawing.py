"""The picture of a match: which one, and of what."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

from pomona.cloud import as_cloud
from pomona.errors import PomonaError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from pomona.cloud import Cloud
    from pomona.matching import Match

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
        The vertical in the map's frame where it is known.
    view
        ``row``: both clouds in the map's frame, from the side and from above: what was found again, what is new, what
        was missed. ``lines``: the query drawn aside and a line for every pair, coloured by its probability.

    Raises
    ------
    PomonaError
        There is no such view, or a file cannot be read.
    """
    from pomona.plot.lines import draw_lines
    from pomona.plot.row import draw_row

    if view not in get_args(PlotView):
        raise PomonaError(f"view: found {view!r}, expected one of {', '.join(get_args(PlotView))}")
    draw = draw_lines if view == "lines" else draw_row
    # Nothing is said of the unit of a file that was matched already.
    return draw(as_cloud(query, "free"), as_cloud(map, "free"), match, up_in_map=up_in_map)
