"""The weather of a visit: presets, and what they may be on one day."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pomona.errors import PomonaError
from pomona.render.scene_view import Weather

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["WEATHERS", "draw_weather"]

Colour = tuple[float, float, float]
Range = tuple[float, float]


@dataclass(frozen=True)
class _Kind:
    """Ranges to draw from; angles in degrees. The sun may stand on either side of the row."""

    elevation_deg: Range
    strength: Range
    brightness: Range
    sun: Colour
    sky: Colour
    horizon: Colour
    wind_m: Range


WEATHERS: Mapping[str, _Kind] = {
    "sun": _Kind(
        elevation_deg=(30, 62),
        strength=(2.8, 4.6),
        brightness=(0.9, 1.1),
        sun=(1.0, 0.94, 0.84),
        sky=(0.40, 0.62, 1.05),
        horizon=(0.95, 1.1, 1.3),
        wind_m=(0.0, 0.003),
    ),
    "hazy": _Kind(
        elevation_deg=(30, 60),
        strength=(0.7, 1.8),
        brightness=(0.9, 1.1),
        sun=(1.0, 0.95, 0.88),
        sky=(0.72, 0.80, 0.95),
        horizon=(0.90, 0.93, 0.97),
        wind_m=(0.0, 0.003),
    ),
    "overcast": _Kind(
        elevation_deg=(30, 60),
        strength=(0.0, 0.0),
        brightness=(0.7, 1.1),
        sun=(1.0, 1.0, 1.0),
        sky=(1.0, 1.0, 1.03),
        horizon=(0.82, 0.85, 0.90),
        wind_m=(0.0, 0.004),
    ),
    "dusk": _Kind(
        elevation_deg=(4, 14),
        strength=(0.4, 1.6),
        brightness=(0.06, 0.16),
        sun=(1.0, 0.62, 0.32),
        sky=(0.42, 0.52, 0.80),
        horizon=(1.0, 0.78, 0.58),
        wind_m=(0.0, 0.002),
    ),
}
"""By name. Dusk is dimmer by its brightness, the sun with the sky."""


def draw_weather(kind: str, seed: int) -> Weather:
    """Draw the weather of one visit.

    Raises
    ------
    PomonaError
        If no weather has this name.
    """
    if kind not in WEATHERS:
        raise PomonaError(f"no weather is called {kind!r}; expected one of {', '.join(WEATHERS)}")
    ranges, rng = WEATHERS[kind], np.random.default_rng([seed, 0x57EA])
    brightness = rng.uniform(*ranges.brightness)
    return Weather(
        sun_elevation_rad=float(np.deg2rad(rng.uniform(*ranges.elevation_deg))),
        sun_azimuth_rad=float(rng.uniform(-np.pi, np.pi)),
        sun_strength=float(brightness * rng.uniform(*ranges.strength)),
        sun_colour=ranges.sun,
        sky_colour=_dimmed(ranges.sky, brightness),
        horizon_colour=_dimmed(ranges.horizon, brightness),
        wind_m=float(rng.uniform(*ranges.wind_m)),
    )


def _dimmed(colour: Colour, brightness: float) -> Colour:
    red, green, blue = (float(brightness * channel) for channel in colour)
    return red, green, blue
