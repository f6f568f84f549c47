"""What a renderer is told besides the geometry, and what it gives back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from pomona.recording.calibration import Calibration
    from pomona.synth.row_geometry import RowGeometry

__all__ = ["RenderedPair", "Renderer", "Weather"]


@dataclass(frozen=True)
class Weather:
    """The light of one visit.

    Attributes
    ----------
    sun_elevation_rad, sun_azimuth_rad
        Where the sun stands; the azimuth from the row's x towards its y.
    sun_strength
        Irradiance of the sun against a white sky's; 0 for overcast.
    sun_colour, sky_colour, horizon_colour
        Linear RGB; the sky turns from one to the other towards the horizon.
    wind_m
        Standard deviation of how far leaves are moved between frames.
    """

    sun_elevation_rad: float
    sun_azimuth_rad: float
    sun_strength: float
    sun_colour: tuple[float, float, float]
    sky_colour: tuple[float, float, float]
    horizon_colour: tuple[float, float, float]
    wind_m: float = 0.0


@dataclass(frozen=True, eq=False)
class RenderedPair:
    """One rectified stereo pair and its truth, of the left picture.

    Attributes
    ----------
    left, right : (H, W, 3) float32
        Linear RGB as light arrives, no exposure, no noise; what the sensor does comes later, once for all renderers.
    depth_m : (H, W) float32
        Along the optical axis at the pixel's centre, infinite for the sky.
    ids : (H, W) uint16
        Fruit at the pixel's centre, 0 for none.
    """

    left: NDArray[np.float32]
    right: NDArray[np.float32]
    depth_m: NDArray[np.float32]
    ids: NDArray[np.uint16]


class Renderer(Protocol):
    """Whoever turns geometry into pictures."""

    def require_installed(self) -> None:
        """Raise a `PomonaError` where something that it needs is not installed."""
        ...

    def render(
        self,
        geometry: RowGeometry,
        camera: Calibration,
        session_from_camera: NDArray[np.float64],
        weather: Weather,
        seed: int,
        *,
        first: int = 0,
    ) -> Iterator[RenderedPair]:
        """Give the pair of each pose, (N, 4, 4), in turn; OpenCV axes, the left camera.

        What an interrupted run has done already is left out with `first`: the pairs from this number on are the same.
        """
        ...
