"""Pictures of a match."""

from pomona.plot.drawing import PlotView, draw_match
from pomona.plot.files import PICTURE_SUFFIXES, require_picture_name, save_picture
from pomona.plot.projections import Projection, side_and_plan, view_from_above

__all__ = [
    "PICTURE_SUFFIXES",
    "PlotView",
    "Projection",
    "draw_match",
    "require_picture_name",
    "save_picture",
    "side_and_plan",
    "view_from_above",
]
