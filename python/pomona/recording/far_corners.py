"""Corners that are found in both pictures of a pair wherever they lie: coarse, but no knock is too large for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["far_corners"]

CORNERS, LEAST_CONTRAST = 1500, 10

UNIQUE = 0.8
"""Distance of the best match over that of the second; above, it is one leaf among leaves."""


def far_corners(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Give the places of corners in both pictures, found by ORB: x and y in the left, x and y in the right, (N, 4)."""
    import cv2

    orb = cv2.ORB_create(CORNERS, fastThreshold=LEAST_CONTRAST)  # type: ignore[attr-defined] # the stubs lack it
    found = [orb.detectAndCompute(_grey(one), None) for one in (left, right)]
    (here, codes), (there, others) = found
    if codes is None or others is None or len(there) < 2:
        return np.zeros((0, 4))
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(codes, others, k=2)
    sure = [best for best, second in pairs if best.distance < UNIQUE * second.distance]
    places = [(*here[one.queryIdx].pt, *there[one.trainIdx].pt) for one in sure]
    return np.array(places, np.float64).reshape(-1, 4)


def _grey(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    import cv2

    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture, np.uint8)
