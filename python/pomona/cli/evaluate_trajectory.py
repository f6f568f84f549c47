"""`pomona evaluate trajectory`: found poses against true ones."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.cli.terminal import say, say_json, tell
from pomona.cli.verbs import Writes
from pomona.likes import PICTURE

if TYPE_CHECKING:
    from pomona.trajectory_scores import PoseErrors, TrajectoryScore


class AlignBy(StrEnum):
    """What of the estimate's frame of reference is its own."""

    none = "none"
    rigid = "rigid"
    scale = "scale"


def evaluate_trajectory(
    estimate: Path = typer.Argument(
        metavar="ESTIMATE", help="Poses of the camera: TUM or KITTI text, or a session (.gpkg)."
    ),
    truth: Path = typer.Argument(metavar="TRUTH", help="The true ones, of any of these kinds."),
    align: AlignBy = typer.Option(
        AlignBy.rigid, help="Frames of reference: one and the same, apart by a motion, or by a scale too."
    ),
    lever_m: float | None = typer.Option(
        None,
        "--lever",
        min=0.0,
        metavar="METRES",
        help="How much orientations count in the alignment, as axes this long; else 1. 0: positions alone.",
    ),
    over: list[str] | None = typer.Option(
        None, metavar="1f|1m", help="Stretches for relative errors, frames or metres, more than once; else 1f and 1m."
    ),
    within_s: float | None = typer.Option(
        None, "--within", min=0.0, metavar="SECONDS", help="Between two times that are one; else 0.01."
    ),
    in_order: bool = typer.Option(False, "--in-order", help="Pair line by line, whatever the times say."),
    plot: Annotated[Path | None, Writes(PICTURE)] = typer.Option(
        None, help="Draw both trajectories and the errors here: .png, .svg or .pdf."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
) -> None:
    """Absolute errors of poses, and relative errors over stretches of the way, in place and orientation.

    Poses are compared at the same times; where one of the files has no times, line by line. They are aligned with their
    orientations too: along a straight row positions leave the turn about it free.
    """
    from pomona.errors import PomonaError
    from pomona.plot import require_picture_name
    from pomona.trajectory_scores import LEVER_M, Span, read_poses, score_trajectory
    from pomona.trajectory_scores.timed_poses import WITHIN_S
    from pomona.trajectory_scores.trajectory_score import SPANS

    if plot is not None:
        require_picture_name(plot)
    if in_order and within_s is not None:
        raise PomonaError("--within: found with --in-order, expected one of them")
    apart_s = WITHIN_S if within_s is None else within_s
    spans = tuple(map(Span.parsed, over)) if over else SPANS
    score = score_trajectory(
        read_poses(estimate),
        read_poses(truth),
        align=align.value,
        lever_m=LEVER_M if lever_m is None else lever_m,
        spans=spans,
        within_s=None if in_order else apart_s,
    )
    if plot is not None:
        _draw(plot, score, estimate)
    if json:
        say_json(score.as_json())
    else:
        say(*_as_lines(score))
    n_known = min(score.n_estimate, score.n_truth)
    if 2 * len(score.true) <= n_known:
        common = f"only {len(score.true)} of {n_known} times are in both files"
        tell(f"pomona: {common}; --in-order pairs poses line by line")


def _draw(plot: Path, score: TrajectoryScore, estimate: Path) -> None:
    from pomona.plot import save_picture
    from pomona.plot.courses import draw_courses

    save_picture(draw_courses(score, f"{estimate.name} beside the truth"), plot)


def _as_lines(score: TrajectoryScore) -> list[str]:
    from pomona.trajectory_scores.pose_errors import FIGURES

    scale = f", scale {score.truth_from_estimate.scale:.6g}" if score.align == "scale" else ""
    about = f"{len(score.true)} poses of {score.n_estimate} and of {score.n_truth} true ones, {score.length_m:.2f} m"
    rows = [("", "n", *FIGURES), *_rows("absolute", score.absolute)]
    for span, errors in score.relative:
        rows += _rows(f"over {span}", errors)
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    table = [
        "  ".join(
            [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        )
        for row in rows
    ]
    return [f"{about}, aligned: {score.align}{scale}", *table]


def _rows(name: str, errors: PoseErrors) -> list[tuple[str, ...]]:
    from pomona.trajectory_scores.pose_errors import FIGURES

    figures = errors.figures()
    rows = []
    for of, unit, factor, digits in (("translation_m", "mm", 1000.0, 2), ("rotation_deg", "degrees", 1.0, 4)):
        found = figures[of]
        cells = ["-"] * len(FIGURES) if found is None else [f"{factor * found[one]:.{digits}f}" for one in FIGURES]
        rows.append((f"{name}, {unit}", str(len(errors)), *cells))
    return rows
