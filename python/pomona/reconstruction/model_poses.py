"""Poses as models write them: a quaternion, real part first, and a translation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import MOST_NUMBER
from pomona.recording.poses import transforms

__all__ = ["pose_of", "quaternion_and_place"]

Array = NDArray[np.float64]

UNIT_LENGTH = 1e-2
"""By which a quaternion may be longer or shorter than 1."""


def pose_of(where: str, numbers: Sequence[float]) -> Array:
    """Give the rigid transform (4, 4) of qw, qx, qy, qz, tx, ty, tz.

    Raises
    ------
    PomonaError
        One line that begins with `where`: a number is not finite, or the quaternion not of length 1.
    """
    if not all(abs(number) <= MOST_NUMBER for number in numbers):  # nor is what is NaN
        raise PomonaError(f"{where}: pose: found NaN or infinity, expected qw qx qy qz tx ty tz")
    w, x, y, z, *place = numbers
    length = float(np.linalg.norm([w, x, y, z]))
    if abs(length - 1) > UNIT_LENGTH:
        raise PomonaError(f"{where}: pose: found a quaternion of length {length:.3g}, expected 1")
    return np.asarray(transforms(np.array([[x, y, z, w]]), np.array([place]))[0])


def quaternion_and_place(pose: Array) -> tuple[float, ...]:
    """Give qw, qx, qy, qz, tx, ty, tz of a rigid transform, (4, 4)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True).tolist()
    return w, x, y, z, *pose[:3, 3].tolist()
