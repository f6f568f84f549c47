"""How a picture becomes the input of a network, and boxes in that input boxes in the picture.

Nothing is lost to half pixels: a resize that keeps the outer edges of the picture, as OpenCV's and Pillow's do,
multiplies our coordinates by new/old, and padding adds whole pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["InputPlacement", "Preparation", "prepare"]

PADDING = 114
"""Grey of the bars: what the YOLO families are trained with."""


@dataclass(frozen=True)
class Preparation:
    """What a network expects of a picture.

    Attributes
    ----------
    fit : str
        `letterbox`: shape kept, centred between grey bars; `corner`: shape kept, in the top left corner; `inside`: the
        same, and enlarged only where that is asked for; `stretch`.
    channels : str
        Their order.
    resize : str
        `linear`: of bytes, as OpenCV does it; `float`: the same without rounding; `smooth`: the filter as wide as what
        is left out, as Pillow does it.
    divide_by : float
        255 brings bytes to 0..1, 1 leaves them.
    mean, std : tuple of three float
        Taken off and divided by, after that; in the order of `channels`.
    """

    fit: Literal["letterbox", "corner", "inside", "stretch"] = "letterbox"
    channels: Literal["RGB", "BGR"] = "RGB"
    resize: Literal["linear", "float", "smooth"] = "linear"
    divide_by: float = 255.0
    mean: tuple[float, ...] = (0.0, 0.0, 0.0)
    std: tuple[float, ...] = (1.0, 1.0, 1.0)

    def __str__(self) -> str:
        """Say it in short."""
        values = f"{self.channels}/{self.divide_by:g}" if self.divide_by != 1 else self.channels
        normal = "" if not any(self.mean) else ", mean and deviation taken off"
        return f"{values}{normal}, {self.fit}"


@dataclass(frozen=True)
class InputPlacement:
    """Where a picture lies in the input of a network: input = picture * scale + offset_px, for x and y."""

    scale: tuple[float, float]
    offset_px: tuple[float, float]

    def to_picture(self, boxes_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Bring boxes (N, 4) from the input into the picture."""
        return np.asarray((boxes_px - np.tile(self.offset_px, 2)) / np.tile(self.scale, 2))


def prepare(
    picture: NDArray[np.uint8], size_px: tuple[int, int], preparation: Preparation, enlarged: float = 1.0
) -> tuple[NDArray[np.float32], InputPlacement]:
    """Prepare a picture.

    Parameters
    ----------
    picture : (H, W, 3) uint8
        BGR.
    size_px : (int, int)
        Width and height of the network's input.
    preparation : Preparation
        What the network expects.
    enlarged : float
        How much larger than it is the picture may become where it lies `inside`.

    Returns
    -------
    (3, h, w) float32, InputPlacement
        The input, and where the picture lies in it.
    """
    old_px = (picture.shape[1], picture.shape[0])
    new_px, corner_px = _fit(old_px, size_px, preparation.fit, enlarged)
    resized = _resized(picture, new_px, preparation.resize)
    given = np.full((3, size_px[1], size_px[0]), PADDING, np.float32)
    inside = np.s_[corner_px[1] : corner_px[1] + new_px[1], corner_px[0] : corner_px[0] + new_px[0]]
    for plane, channel in enumerate((2, 1, 0) if preparation.channels == "RGB" else (0, 1, 2)):
        given[plane][inside] = resized[:, :, channel]
        # (value / divide_by - mean) / std
        given[plane] *= np.float32(1 / (preparation.divide_by * preparation.std[plane]))
        given[plane] -= np.float32(preparation.mean[plane] / preparation.std[plane])
    return given, InputPlacement((new_px[0] / old_px[0], new_px[1] / old_px[1]), corner_px)


def _fit(
    old_px: tuple[int, int], size_px: tuple[int, int], fit: str, enlarged: float
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Size of the picture in the input, and its corner there; rounded as each family's own code rounds."""
    if fit == "stretch":
        return size_px, (0, 0)
    ratio = min(size_px[0] / old_px[0], size_px[1] / old_px[1])
    if fit in ("corner", "inside"):
        ratio = ratio if fit == "corner" else min(ratio, enlarged)
        return (max(int(old_px[0] * ratio), 1), max(int(old_px[1] * ratio), 1)), (0, 0)
    new_px = max(round(old_px[0] * ratio), 1), max(round(old_px[1] * ratio), 1)
    # An odd rest puts the smaller half left and above.
    return new_px, ((size_px[0] - new_px[0]) // 2, (size_px[1] - new_px[1]) // 2)


def _resized(picture: NDArray[np.uint8], size_px: tuple[int, int], how: str) -> NDArray[Any]:
    import cv2

    if how == "smooth":
        return _smoothly_resized(picture, size_px)
    source = picture.astype(np.float32) if how == "float" else picture
    return np.asarray(cv2.resize(source, size_px, interpolation=cv2.INTER_LINEAR))


def _smoothly_resized(picture: NDArray[np.uint8], size_px: tuple[int, int]) -> NDArray[np.float32]:
    """Resize with a triangle filter that widens with the shrinking, so that nothing aliases; Pillow's BILINEAR."""
    height, width = picture.shape[:2]
    rows = _triangle_filter(height, size_px[1]) @ picture.reshape(height, -1).astype(np.float32)
    columns = rows.reshape(size_px[1], width, 3).transpose(1, 0, 2).reshape(width, -1)
    resized = (_triangle_filter(width, size_px[0]) @ columns).reshape(size_px[0], size_px[1], 3)
    return np.asarray(resized.transpose(1, 0, 2), np.float32)


def _triangle_filter(old: int, new: int):  # type: ignore[no-untyped-def] # scipy.sparse.csr_array
    from scipy.sparse import csr_array

    ratio = old / new
    support = max(ratio, 1.0)
    centres = (np.arange(new) + 0.5) * ratio
    reach = np.arange(2 * int(np.ceil(support)) + 1)
    taken = np.maximum(np.floor(centres - support), 0).astype(int)[:, None] + reach
    weights = np.maximum(1 - np.abs((taken + 0.5 - centres[:, None]) / support), 0) * (taken < old)
    weights /= weights.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(new), len(reach))
    return csr_array((weights.ravel().astype(np.float32), (rows, np.minimum(taken, old - 1).ravel())), (new, old))
