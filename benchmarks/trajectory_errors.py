"""How far found poses are from true ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.trajectory_scores import Span, absolute_errors, alignment, relative_errors
from pomona.trajectory_scores.spans import travelled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """What is wrong with the poses of some frames."""

    frames: int
    parts: int
    length_m: float
    end_m: float
    end_deg: float
    rms_m: float
    rms_deg: float
    segment_percent: float
    segment_deg_per_m: float


def compare(found: Array, true: Array, parts: int, segments_m: tuple[float, ...]) -> Errors:
    """Compare poses of one part with the truth.

    End: the last pose seen from the first one. Rms: after the rigid motion that fits positions and orientations best
    (`pomona.trajectory_scores`). Segments: KITTI's measure, mean over all
    sub-drives of the given lengths.
    """
    end = relative_errors(found, true, Span(len(true) - 1, "f"))
    after = absolute_errors(alignment(found, true).of(found), true)
    drives = [(length_m, relative_errors(found, true, Span(length_m, "m"))) for length_m in segments_m]
    return Errors(
        frames=len(true),
        parts=parts,
        length_m=float(travelled(true)[-1]),
        end_m=float(end.translation_m[0]),
        end_deg=float(end.rotation_deg[0]),
        rms_m=rms(after.translation_m),
        rms_deg=rms(after.rotation_deg),
        segment_percent=mean([100 * errors.translation_m / length_m for length_m, errors in drives]),
        segment_deg_per_m=mean([errors.rotation_deg / length_m for length_m, errors in drives]),
    )


def rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def mean(of_lengths: list[Array]) -> float:
    """Mean over all stretches of all lengths, 0 where there is none."""
    every = np.concatenate([np.empty(0), *of_lengths])
    return float(every.mean()) if len(every) else 0.0
