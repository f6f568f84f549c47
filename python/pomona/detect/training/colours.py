"""What light, lens and sensor do to a crop, drawn anew for each."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["disturbed"]


def disturbed(crop: NDArray[np.uint8], draw: np.random.Generator) -> NDArray[np.uint8]:
    """Give a crop, (H, W, 3) uint8 BGR, as it might have looked on another day with another camera."""
    if draw.random() < 0.5:
        crop = _other_colours(crop, draw)
    if draw.random() < 0.2:
        crop = _shadowed(crop, draw)
    crop = cv2.LUT(crop, _curves(draw))  # type: ignore[assignment]
    if draw.random() < 0.25:
        crop = _blurred(crop, draw)
    if draw.random() < 0.3:
        crop = _noisy(crop, draw)
    if draw.random() < 0.1:
        crop = _compressed(crop, draw)
    return crop


def _curves(draw: np.random.Generator) -> NDArray[np.uint8]:
    """White balance, exposure and gamma as one table of 256 values for each channel."""
    gains = np.exp(draw.normal(0, 0.08, 3) + draw.normal(0, 0.15))
    gamma = np.exp(draw.normal(0, 0.2))
    values = np.linspace(0, 1, 256)[:, None] ** gamma * gains
    return np.clip(255 * values, 0, 255).astype(np.uint8)[:, None, :]


def _other_colours(crop: NDArray[np.uint8], draw: np.random.Generator) -> NDArray[Any]:
    """Turn the hue, by little or rarely by more, and change the saturation."""
    turn = draw.normal(0, 4 if draw.random() < 0.8 else 15)
    steps = np.arange(256)
    table = np.stack(
        [(steps + round(turn)) % 180, np.clip(steps * np.exp(draw.normal(0, 0.25)), 0, 255), steps], axis=-1
    )
    hsv = cv2.cvtColor(crop, cv2.COLOR_BGR2HSV)
    return cv2.cvtColor(cv2.LUT(hsv, table.astype(np.uint8)[:, None, :]), cv2.COLOR_HSV2BGR)


def _shadowed(crop: NDArray[np.uint8], draw: np.random.Generator) -> NDArray[Any]:
    """Darken one half-plane with a soft edge."""
    height, width = crop.shape[:2]
    angle = draw.uniform(0, 2 * np.pi)
    along_x, along_y = (np.arange(side, dtype=np.float32) for side in (width, height))
    across = np.float32(np.cos(angle)) * along_x + np.float32(np.sin(angle)) * along_y[:, None]
    edge, soft = across.flat[draw.integers(across.size)], np.float32(draw.uniform(2, 30))
    lit = (1 + np.tanh((across - edge) / (2 * soft))) / 2  # the logistic curve, that cannot overflow
    light = 1 - np.float32(draw.uniform(0.3, 0.7)) * lit
    return cv2.multiply(crop, cv2.merge([light] * 3), dtype=cv2.CV_8U)


def _blurred(crop: NDArray[np.uint8], draw: np.random.Generator) -> NDArray[Any]:
    how = draw.random()
    if how < 0.4:
        return cv2.GaussianBlur(crop, (0, 0), draw.uniform(0.4, 1.5))
    if how < 0.7:  # moved while exposed, along the row
        length = int(draw.integers(2, 8))
        return cv2.blur(crop, (length, 1))
    by = draw.uniform(0.4, 0.8)  # a coarser sensor
    small = cv2.resize(crop, None, fx=by, fy=by, interpolation=cv2.INTER_AREA)
    return cv2.resize(small, crop.shape[1::-1], interpolation=cv2.INTER_LINEAR)


def _noisy(crop: NDArray[np.uint8], draw: np.random.Generator) -> NDArray[Any]:
    noise = np.empty(crop.shape, np.int16)
    cv2.setRNGSeed(int(draw.integers(1 << 31)))
    cv2.randn(noise, np.zeros(3), np.full(3, draw.uniform(2, 12)))
    return cv2.add(crop, noise, dtype=cv2.CV_8U)


def _compressed(crop: NDArray[np.uint8], draw: np.random.Generator) -> NDArray[Any]:
    _, encoded = cv2.imencode(".jpg", crop, (cv2.IMWRITE_JPEG_QUALITY, int(draw.integers(30, 90))))
    return np.asarray(cv2.imdecode(encoded, cv2.IMREAD_COLOR))
