"""What every stereo matcher gives: depth, and how sure it is at the boxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["FruitDepth"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FruitDepth:
    """What a stereo pair says of the depth at boxes.

    Attributes
    ----------
    depth_m : (H, W) float32
        Depth along the optical axis of the left camera, 0 where nothing was measured.
    disparity_sigma_px : (D,) float64
        Standard deviation of the disparity of the fruit in each box, NaN where nothing is known of it.
    disparity_px : (D,) float64 or None
        Disparity of the fruit's centre, NaN where nothing is known of it; None where the pixels of `depth_m` vote.
    support : (D,) float64 or None
        Part of the fruit's outline that looks alike in both pictures; 0 where it does not match, so that its disparity
        is what the usual size of the picture's fruits gives it; None where pixels vote.
    """

    depth_m: NDArray[np.float32]
    disparity_sigma_px: Array
    disparity_px: Array | None = None
    support: Array | None = None
