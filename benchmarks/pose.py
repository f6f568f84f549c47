"""How far a registration is from the truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PoseError:
    """Error of a similarity.

    Attributes
    ----------
    rotation_deg : angle between the two rotations
    translation_m : distance between the two images of the query's centre, in the map
    scale : ratio of the scales minus one
    """

    rotation_deg: float
    translation_m: float
    scale: float

    @property
    def success(self) -> bool:
        """Rotation under 5 degrees, translation under 0.3 m, scale within 5 %."""
        return self.rotation_deg < 5.0 and self.translation_m < 0.3 and abs(self.scale) < 0.05


def pose_error(found: NDArray[np.float64], true: NDArray[np.float64], query: NDArray[np.float64]) -> PoseError:
    """Compare two 4x4 `map_from_query` at the centre of the (N, 3) query."""
    centre = query.mean(axis=0)
    shift = (found[:3, :3] - true[:3, :3]) @ centre + found[:3, 3] - true[:3, 3]
    found_scale, true_scale = (float(np.cbrt(np.linalg.det(pose[:3, :3]))) for pose in (found, true))
    turn = found[:3, :3].T @ true[:3, :3] / (found_scale * true_scale)
    # |R - I|_F = 2 sqrt(2) sin(angle / 2) stays exact near zero, where the arc cosine of the trace does not.
    half = min(1.0, float(np.linalg.norm(turn - np.eye(3))) / (2.0 * np.sqrt(2.0)))
    return PoseError(
        float(np.degrees(2.0 * np.arcsin(half))), float(np.linalg.norm(shift)), found_scale / true_scale - 1
    )
