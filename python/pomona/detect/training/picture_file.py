"""A picture file of any size, as bytes of colour."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.reading import require_file
from pomona.recording.pictures import decoded_picture

__all__ = ["read_picture"]


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Read a picture as (H, W, 3) uint8, BGR.

    Raises
    ------
    UnreadablePictureError
        It is not there, is none, or is cut off.
    """
    import cv2

    require_file(path, "a picture")
    return np.asarray(decoded_picture(path, np.fromfile(path, np.uint8), cv2.IMREAD_COLOR), np.uint8)
