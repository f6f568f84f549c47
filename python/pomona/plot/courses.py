"""A found trajectory beside the true one, and how the errors grow along the way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.plot.sheet import FAINT, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pomona.trajectory_scores import TrajectoryScore

__all__ = ["draw_courses"]

TRUE, FOUND = "#2a5ea8", "#c23b22"


def draw_courses(score: TrajectoryScore, title: str) -> Figure:
    """Draw both trajectories in the plane in which the true one extends most, and the errors of each pose below."""
    from matplotlib.figure import Figure

    from pomona.trajectory_scores.spans import travelled

    figure = Figure(figsize=(9.0, 7.0), dpi=110, layout="constrained")
    figure.suptitle(title, x=0.02, ha="left", fontweight="bold", color=INK)
    course, places, turns = figure.subplots(3, 1, height_ratios=(2, 1, 1))
    _draw_course(course, score)
    way_m = travelled(score.true)
    places.plot(way_m, 1000 * score.absolute.translation_m, color=FOUND)
    places.set(ylabel="error, mm", ylim=(0, None))
    turns.plot(way_m, score.absolute.rotation_deg, color=FOUND)
    turns.set(xlabel="true way, m", ylabel="error, degrees", ylim=(0, None))
    for axes in (course, places, turns):
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(FAINT)
        axes.tick_params(colors=INK, color=FAINT, labelsize="small")
    return figure


def _draw_course(axes: Axes, score: TrajectoryScore) -> None:
    across, up = _largest(score.true[:, :3, 3])
    for poses, colour, width, name in ((score.true, TRUE, 3.0, "true"), (score.aligned, FOUND, 1.2, "found")):
        axes.plot(poses[:, across, 3], poses[:, up, 3], color=colour, linewidth=width, label=name)
    axes.plot(*score.true[0, [across, up], 3], "o", color=TRUE)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=f"{'xyz'[across]}, m", ylabel=f"{'xyz'[up]}, m")
    axes.legend(frameon=False, labelcolor=INK)


def _largest(positions: NDArray[np.float64]) -> tuple[int, int]:
    """Give the two axes along which positions extend most, in order of their names."""
    first, second = sorted(np.argsort(-np.ptp(positions, axis=0), kind="stable")[:2].tolist())
    return first, second
