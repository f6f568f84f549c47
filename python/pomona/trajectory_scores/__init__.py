"""How far found poses are from true ones: absolute and relative errors, in place and in orientation."""

from pomona.trajectory_scores.aligned_poses import LEVER_M, Align, TruthFit, alignment
from pomona.trajectory_scores.pose_errors import PoseErrors, absolute_errors, relative_errors
from pomona.trajectory_scores.spans import Span, spanned
from pomona.trajectory_scores.timed_poses import TimedPoses, paired_rows, read_poses
from pomona.trajectory_scores.trajectory_score import TrajectoryScore, score_trajectory

__all__ = [
    "LEVER_M",
    "Align",
    "PoseErrors",
    "Span",
    "TimedPoses",
    "TrajectoryScore",
    "TruthFit",
    "absolute_errors",
    "alignment",
    "paired_rows",
    "read_poses",
    "relative_errors",
    "score_trajectory",
    "spanned",
]
