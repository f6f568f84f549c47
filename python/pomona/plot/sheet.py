"""The page of a picture: panels above each other, in which a metre is equally long, a title and a legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["FAINT", "INK", "Sheet"]

INK, FAINT = "#3c3c3c", "#b4b4b4"

IN_PER_M = 0.75
WIDTHS_IN = (10.0, 45.0)
"""A tree of a long row stays large enough to be looked at, down to rows of 60 m."""

MIN_PANEL_IN, MAX_PANEL_IN = 0.8, 4.2
BESIDE_IN, BELOW_IN = 0.8, 1.9
"""What the names of the axes take, and the title with the legend."""

MARGIN, MOST_MARGIN_M = 0.03, 0.4
"""Around the fruits: a part of the row's length, metres at most."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """An empty page.

    Attributes
    ----------
    figure : Figure
    panels : tuple of Axes
        From the top down.
    in_per_m : float
        Inches that a metre has.
    """

    figure: Figure
    panels: tuple[Axes, ...]
    in_per_m: float

    @classmethod
    def of(cls, shown: Sequence[NDArray[np.float64]]) -> Sheet:
        """Make one whose panels fit the (N, 2) points that each will show."""
        from matplotlib.figure import Figure

        low, high = _ends(np.concatenate(shown)[:, 0])
        margin_m = min(MARGIN * max(high - low, 0.1), MOST_MARGIN_M)
        length_m = high - low + 2 * margin_m
        width_in = float(np.clip(IN_PER_M * length_m, *WIDTHS_IN))
        in_per_m = (width_in - BESIDE_IN) / length_m
        heights_m = [float(np.ptp(_ends(points[:, 1]))) + 2 * margin_m for points in shown]
        in_per_m = min(in_per_m, MAX_PANEL_IN / max(heights_m))
        heights_in = [max(height_m * in_per_m, MIN_PANEL_IN) for height_m in heights_m]
        figure = Figure(figsize=(width_in, sum(heights_in) + BELOW_IN), dpi=110, layout="constrained")
        panels = tuple(figure.subplots(len(shown), 1, sharex=True, height_ratios=heights_in, squeeze=False)[:, 0])
        for axes, points, height_in in zip(panels, shown, heights_in, strict=True):
            axes.set_xlim(low - margin_m, high + margin_m)
            _scale(axes, sum(_ends(points[:, 1])) / 2, height_in / in_per_m)
        return cls(figure, panels, in_per_m)

    def title(self, verdict: str, about: str) -> None:
        """Say what this is, in large, and some figures below."""
        self.figure.suptitle(verdict, x=0.02, ha="left", fontsize="x-large", fontweight="bold", color=INK)
        self.panels[0].set_title(about, loc="left", fontsize="medium", color=INK, pad=20)

    def legend(self, *panels: Axes) -> None:
        """Say what the marks of some panels are, below all of them."""
        shown = [axes.get_legend_handles_labels() for axes in panels]
        handles = [handle for handles, _ in shown for handle in handles]
        labels = [label for _, labels in shown for label in labels]
        self.figure.legend(
            handles, labels, loc="outside lower center", ncols=4, frameon=False, labelcolor=INK, handletextpad=0.2
        )


def _ends(places: NDArray[np.float64]) -> tuple[float, float]:
    return (float(places.min()), float(places.max())) if len(places) else (0.0, 1.0)


def _scale(axes: Axes, middle: float, height_m: float) -> None:
    axes.set_ylim(middle - height_m / 2, middle + height_m / 2)
    axes.set_aspect("equal")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)
    axes.tick_params(colors=INK, color=FAINT, labelsize="small")
