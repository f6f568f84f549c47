"""The story of a comparison: two files -> poses of the same moments -> aligned -> errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.trajectory_scores.aligned_poses import LEVER_M, Align, TruthFit, alignment
from pomona.trajectory_scores.pose_errors import PoseErrors, absolute_errors, relative_errors
from pomona.trajectory_scores.spans import Span, travelled
from pomona.trajectory_scores.timed_poses import WITHIN_S, TimedPoses, paired_rows

__all__ = ["SPANS", "TrajectoryScore", "score_trajectory"]

SPANS = (Span(1, "f"), Span(1.0, "m"))
"""What drift is said over, where nothing else is asked."""


@dataclass(frozen=True, eq=False)
class TrajectoryScore:
    """How a trajectory compares with the truth.

    Attributes
    ----------
    n_estimate, n_truth : int
        Poses in the two files.
    true, aligned : (P, 4, 4) float64
        Of the same moments, in the frame of the truth.
    align : {"none", "rigid", "scale"}
        How they were aligned.
    truth_from_estimate : TruthFit
        What aligned them.
    absolute : PoseErrors
        Of each pose.
    relative : tuple of (Span, PoseErrors)
        Of the motions over stretches.
    """

    n_estimate: int
    n_truth: int
    true: NDArray[np.float64]
    aligned: NDArray[np.float64]
    align: Align
    truth_from_estimate: TruthFit
    absolute: PoseErrors
    relative: tuple[tuple[Span, PoseErrors], ...]

    @property
    def length_m(self) -> float:
        """The true way."""
        return float(travelled(self.true)[-1])

    def as_json(self) -> dict[str, Any]:
        """All figures for programs; errors in metres and degrees, null where no stretch is that long."""
        return {
            "poses": len(self.true),
            "n_estimate": self.n_estimate,
            "n_truth": self.n_truth,
            "length_m": self.length_m,
            "align": self.align,
            "scale": self.truth_from_estimate.scale,
            "truth_from_estimate": self.truth_from_estimate.matrix.tolist(),
            "absolute": dict(self.absolute.figures()),
            "relative": [
                {"over": span.length, "unit": span.unit, "n": len(errors), **errors.figures()}
                for span, errors in self.relative
            ],
        }


def score_trajectory(
    estimate: TimedPoses,
    truth: TimedPoses,
    *,
    align: Align = "rigid",
    lever_m: float = LEVER_M,
    spans: Sequence[Span] = SPANS,
    within_s: float | None = WITHIN_S,
) -> TrajectoryScore:
    """Compare a trajectory with the truth.

    Parameters
    ----------
    estimate, truth : TimedPoses
        As `read_poses` gives them.
    align : {"none", "rigid", "scale"}
        Whether the frame of reference of the estimate, or its unit too, is its own.
    lever_m : float
        How much orientations count in the alignment, see `alignment`; 0 aligns positions alone.
    spans : sequence of Span
        Over which stretches to give relative errors.
    within_s : float or None
        Between two times that are one; None pairs line by line.

    Raises
    ------
    PomonaError
        Fewer than two poses are of the same moments.
    """
    rows, true_rows = paired_rows(estimate, truth, within_s)
    found, true = estimate.poses[rows], truth.poses[true_rows]
    fit = alignment(found, true, align, lever_m)
    aligned = fit.of(found)
    return TrajectoryScore(
        n_estimate=len(estimate),
        n_truth=len(truth),
        true=true,
        aligned=aligned,
        align=align,
        truth_from_estimate=fit,
        absolute=absolute_errors(aligned, true),
        relative=tuple((span, relative_errors(aligned, true, span)) for span in spans),
    )
