"""Ways by fruits beside the true ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from benchmarks.slam import Found

TRUE, FOUND = "#2a5ea8", "#c23b22"


def write_picture(path: Path, results: list[Found]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 2.2 * len(results)), layout="constrained")
    rows = figure.subplots(len(results), 2, width_ratios=(3, 2), squeeze=False)
    for (way, errors), one in zip(rows, results, strict=True):
        _draw_way(way, one)
        _draw_errors(errors, one)
    rows[0, 0].legend(fontsize="small", frameon=False)
    figure.savefig(path, dpi=80, metadata={"Software": None})


def _draw_way(axes: Any, one: Found) -> None:
    across, up = sorted(np.argsort(-np.ptp(one.score.true[:, :3, 3], axis=0), kind="stable")[:2])
    for poses, colour, width, label in ((one.score.true, TRUE, 3.5, "true"), (one.score.aligned, FOUND, 1.2, "found")):
        axes.plot(poses[:, across, 3], poses[:, up, 3], color=colour, linewidth=width, label=label)
    followed = f"{len(one.score.true)} of {len(one.way)} frames"
    axes.set(title=f"{one.name}, {one.variant}: {followed}", xlabel=f"{'xyz'[across]}, m", ylabel=f"{'xyz'[up]}, m")
    axes.set_aspect("equal", adjustable="datalim")


def _draw_errors(axes: Any, one: Found) -> None:
    """From the first pose on, unaligned: what drift adds and a loop takes away."""
    true, found = (np.linalg.inv(poses[0]) @ poses for poses in (one.score.true, one.score.aligned))
    steps_m = np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1)
    apart_mm = 1000 * np.linalg.norm(true[:, :3, 3] - found[:, :3, 3], axis=1)
    axes.plot(np.concatenate([[0.0], np.cumsum(steps_m)]), apart_mm, color=FOUND)
    axes.set(xlabel="way, m", ylabel="off, mm", ylim=(0, None))
