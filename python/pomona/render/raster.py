"""The fast renderer: the core's rasteriser."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona import _core
from pomona.render.scene_view import RenderedPair, Weather

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pomona.recording.calibration import Calibration
    from pomona.synth.row_geometry import RowGeometry

__all__ = ["RasterRenderer"]


class RasterRenderer:
    """Triangles, a depth buffer, shadows of the sun and light among the leaves; see `Renderer`."""

    name = "raster"

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
        """Give the pair of each pose, (N, 4, 4), in turn, from number `first` on."""
        scene = _core.RowScene(geometry, camera, session_from_camera, weather, seed=seed)
        for frame in range(first, len(session_from_camera)):
            left, right, depth_m, ids = scene.pair(session_from_camera[frame], frame)
            yield RenderedPair(left, right, depth_m, ids)
