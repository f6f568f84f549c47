"""What a camera makes of light: one chain for the pictures of all renderers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Sensor", "exposure_for"]

GREY = 0.13
"""Where the exposure brings the mean of a picture, against what saturates."""

STEPS_PER_STOP = 3
"""The exposure goes in thirds of a stop, as cameras' do: from one frame to the next it jumps or stays."""

WIDEST = 6.0
"""An exposure up to which the lens opens; beyond, the picture is amplified, and its noise."""

CONTRAST = 1.15
"""Exponent about `GREY`: pictures for people are a little harder than the light."""

SHOULDER = 1.5
"""How hard highlights are bent before they saturate."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Rec. 709."""


@dataclass(frozen=True)
class Sensor:
    """A camera's electronics; one for each eye.

    Attributes
    ----------
    gain
        Exposure of this eye against the other one.
    white_balance
        Factors of red and blue.
    vignetting
        Share of the light that the corners lose.
    full_well
        Electrons of a pixel that saturates at the lowest gain: few make more shot noise.
    read_noise
        Electrons, standard deviation.
    shutter_s
        How long a picture is exposed: what moves meanwhile is blurred.
    """

    gain: float = 1.0
    white_balance: tuple[float, float] = (1.0, 1.0)
    vignetting: float = 0.2
    full_well: float = 9000.0
    read_noise: float = 5.0
    shutter_s: float = 0.002

    def develop(self, light: NDArray[np.float32], exposure: float, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Turn linear RGB light, (H, W, 3), into a picture as OpenCV has it: BGR bytes."""
        red, blue = self.white_balance
        scaled = light * (self.gain * exposure * self._falloff(light.shape[:2])[..., None])
        scaled = self._noisy(scaled, max(1.0, exposure / WIDEST), rng) * np.array([red, 1.0, blue], np.float32)
        scaled = GREY * (np.maximum(scaled, 0.0) / GREY) ** CONTRAST
        bent = (1.0 - np.exp(-SHOULDER * scaled)) / (1.0 - np.exp(-SHOULDER * 1.4))
        return np.round(255.0 * _srgb(np.clip(bent, 0.0, 1.0)))[..., ::-1].astype(np.uint8)

    def _falloff(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Share of the light by the squared distance from the middle."""
        height, width = shape
        y, x = np.mgrid[0:height, 0:width] + 0.5
        off = (x / width - 0.5) ** 2 + (y / height - 0.5) ** 2
        return np.asarray(1.0 - self.vignetting * off / 0.5, np.float32)

    def _noisy(self, scaled: NDArray[np.float32], amplified: float, rng: np.random.Generator) -> NDArray[np.float32]:
        """Add shot noise, the square root of the electrons, and read noise."""
        full = self.full_well / amplified
        sigma = np.sqrt(np.maximum(scaled, 0.0) / full + (self.read_noise / full) ** 2)
        return np.asarray(scaled + sigma * rng.standard_normal(scaled.shape, np.float32), np.float32)


def exposure_for(light: NDArray[np.float32]) -> float:
    """Give the factor that a camera would choose for a picture: of its own light alone, in steps."""
    luminance = light @ LUMINANCE
    # What is far brighter than the rest, the sky, counts no more than a white wall.
    mean = float(np.minimum(luminance, 4.0 * np.median(luminance)).mean())
    stops = np.log2(GREY / max(mean, 1e-6))
    return float(2.0 ** (np.round(stops * STEPS_PER_STOP) / STEPS_PER_STOP))


def _srgb(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Encode as sRGB does (IEC 61966-2-1)."""
    bright = 1.055 * np.power(np.maximum(linear, 0.0031308), 1.0 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, bright)


def encoded(picture: NDArray[np.uint8], suffix: str, quality: int | None) -> bytes:
    """Compress a picture: PNG, or JPEG of a quality of 1 to 100."""
    options = [] if quality is None else [cv2.IMWRITE_JPEG_QUALITY, quality]
    done, content = cv2.imencode(suffix, picture, options)
    assert done
    return content.tobytes()
