"""Pictures of one scene that were exposed differently: the face of the core's `stereo/exposure.rs`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona import _core

__all__ = ["gain", "like"]

Picture = NDArray[np.uint8]


def gain(picture: Picture, reference: Picture) -> float:
    """Factor that brings a picture (H, W) to the exposure of another one of the same scene; 1 where nothing says."""
    return _core.exposure_gains(_channels(picture), _channels(reference))[0]


def like(picture: Picture, reference: Picture) -> Picture:
    """Give a picture as exposed as another one of the same scene; itself where both were exposed alike.

    Parameters
    ----------
    picture, reference : (H, W) or (H, W, 3) uint8
        Of one kind; each colour has its own gain.
    """
    import cv2

    tables = _core.exposure_tables(_channels(picture), _channels(reference))
    if tables is None:
        return picture
    table = tables[0] if picture.ndim == 2 else np.ascontiguousarray(tables.T)[None]
    return np.asarray(cv2.LUT(picture, table), np.uint8)


def _channels(picture: Picture) -> Picture:
    return np.ascontiguousarray(picture[..., None] if picture.ndim == 2 else picture)
