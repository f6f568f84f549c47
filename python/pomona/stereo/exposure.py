"""Pictures of one scene that were exposed differently: the gain between them, and how it is taken out.

Windows of pictures are compared by their values, so a picture that is brighter by a third matches nowhere. Both eyes,
and neighbouring frames, see nearly the same scene: the gain is what the quantiles of their values differ by. What the
scene itself changes from frame to frame stays below the least gain that is taken out, so pictures that were exposed
alike stay as they are.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEAST_GAIN", "gain", "like"]

Picture = NDArray[np.uint8]

QUANTILES = np.linspace(0.2, 0.9, 15)
"""Dark parts are noise, and the brightest are cut off."""

USABLE = (4.0, 250.0)
"""Values that are neither cut off nor a few steps of rounding."""

LEAST_GAIN = 1.05
"""Pictures that were exposed alike differ by less: from frame to frame of `rendered_row` by up to 1.035, between the
eyes by up to 1.02."""

COLUMNS = 160
"""So many columns, and rows as far apart, are enough: 14,400 pixels of 16 : 9."""


def gain(picture: Picture, reference: Picture) -> float:
    """Factor that brings a picture (H, W) to the exposure of another one of the same scene; 1 where nothing says."""
    mine, theirs = (_quantiles(one) for one in (picture, reference))
    usable = (np.minimum(mine, theirs) > USABLE[0]) & (np.maximum(mine, theirs) < USABLE[1])
    return float(np.exp(np.median(np.log(theirs[usable] / mine[usable])))) if usable.any() else 1.0


def _quantiles(picture: Picture) -> NDArray[np.float64]:
    """Quantiles by the histogram, between whole values as if each filled its step."""
    step = max(picture.shape[1] // COLUMNS, 1)
    below = np.cumsum(np.bincount(picture[::step, ::step].ravel(), minlength=256))
    return np.asarray(np.interp(QUANTILES * below[-1], below, np.arange(256) + 0.5), np.float64)


def like(picture: Picture, reference: Picture) -> Picture:
    """Give a picture as exposed as another one of the same scene; itself where gains stay below `LEAST_GAIN`.

    Parameters
    ----------
    picture, reference : (H, W) or (H, W, 3) uint8
        Of one kind; each colour has its own gain.
    """
    import cv2

    channels = picture[..., None] if picture.ndim == 2 else picture
    wanted = reference[..., None] if reference.ndim == 2 else reference
    gains = [gain(channels[..., k], wanted[..., k]) for k in range(channels.shape[-1])]
    if max(max(one, 1 / one) for one in gains) < LEAST_GAIN:
        return picture
    table: NDArray[Any] = np.clip(np.rint(np.arange(256)[:, None] * np.array(gains)), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(picture, table.squeeze(1) if picture.ndim == 2 else table[None]), np.uint8)
