"""Clouds as the core reads them, and which of them its errors are about."""

from __future__ import annotations

import numpy as np

from pomona import _core
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError

__all__ = ["core_arrays", "refused_by_core"]

OF_NO_CLOUD = ("configuration", "map_from_query", "noise_m", "per_frame", "setting", "up")
"""What the core's errors begin with where they are not about the fruits."""


def core_arrays(cloud: FruitCloud) -> _core._Arrays:
    """Return the arrays the core reads, contiguous."""
    views = cloud.views
    return {
        "positions": np.ascontiguousarray(cloud.positions, np.float64),
        "covariances": None if cloud.covariances is None else np.ascontiguousarray(cloud.covariances, np.float64),
        "diameters_m": None if cloud.diameters_m is None else np.ascontiguousarray(cloud.diameters_m, np.float64),
        "view_frames": None if views is None else np.ascontiguousarray(views.frames, np.int64),
        "view_fruits": None if views is None else np.ascontiguousarray(views.fruits, np.int64),
    }


def refused_by_core(cloud: str, error: Exception) -> PomonaError:
    """Name the cloud that an error of the core is about, where it is about one."""
    told = str(error)
    return PomonaError(told if told.startswith(OF_NO_CLOUD) else f"{cloud}: {told}")
