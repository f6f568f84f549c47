"""Errors of poses, and what is said of many of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.trajectory_scores.spans import Span, spanned

__all__ = ["FIGURES", "PoseErrors", "absolute_errors", "relative_errors"]

Array = NDArray[np.float64]

FIGURES = ("rmse", "mean", "median", "p95", "max")
"""What is said of many errors, in order; p95 is the 95th percentile."""


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors of E poses or motions.

    Attributes
    ----------
    translation_m : (E,) float64
        Distances, metres of the truth.
    rotation_deg : (E,) float64
        Angles, 0 to 180.
    """

    translation_m: Array
    rotation_deg: Array

    @classmethod
    def of(cls, errors: Array) -> PoseErrors:
        """Take the transforms (E, 4, 4) that are left between the true and the found."""
        from scipy.spatial.transform import Rotation

        turns = Rotation.from_matrix(errors[:, :3, :3]).magnitude() if len(errors) else np.empty(0)
        return cls(np.linalg.norm(errors[:, :3, 3], axis=1), np.degrees(turns))

    def __len__(self) -> int:
        return len(self.translation_m)

    def figures(self) -> Mapping[str, Mapping[str, float] | None]:
        """Say `FIGURES` of both; None where there is no error to speak of."""
        return {"translation_m": _figures(self.translation_m), "rotation_deg": _figures(self.rotation_deg)}


def absolute_errors(aligned: Array, true: Array) -> PoseErrors:
    """Compare poses (F, 4, 4) in the frame of the truth with the true ones."""
    return PoseErrors.of(np.linalg.inv(true) @ aligned)


def relative_errors(found: Array, true: Array, span: Span) -> PoseErrors:
    """Compare the motions over all stretches of a length: what drift adds, whatever the frame of reference.

    Parameters
    ----------
    found, true : (F, 4, 4) float64
        Poses of the same moments, in one unit.
    span : Span
        Metres are those of the truth.
    """
    first, last = spanned(span, true)
    moved, truly = (np.linalg.inv(poses[first]) @ poses[last] for poses in (found, true))
    return PoseErrors.of(np.linalg.inv(truly) @ moved)


def _figures(errors: Array) -> dict[str, float] | None:
    if not len(errors):
        return None
    values = (np.sqrt(np.mean(errors**2)), errors.mean(), np.median(errors), np.percentile(errors, 95), errors.max())
    return {name: float(value) for name, value in zip(FIGURES, values, strict=True)}
