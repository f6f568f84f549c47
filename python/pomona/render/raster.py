"""The fast renderer: the core's rasteriser."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from pomona import _core
from pomona.render.scene_view import RenderedPair, Weather
from pomona.threads import cores

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pomona.recording.calibration import Calibration
    from pomona.synth.row_geometry import RowGeometry

__all__ = ["RasterRenderer"]

_Arrays = tuple[Any, Any, Any, Any]


class RasterRenderer:
    """Triangles, a depth buffer, shadows of the sun and light among the leaves; see `Renderer`."""

    name = "raster"

    def require_installed(self) -> None:
        """Say nothing: it is in Pomona."""

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
        """Give the pair of each pose, (N, 4, 4), in turn, from number `first` on; as many at once as cores."""
        scene = _core.RowScene(geometry, camera, session_from_camera, weather, seed=seed)
        frames = iter(range(first, len(session_from_camera)))
        with ThreadPoolExecutor(cores(), "pomona-render") as pool:

            def begin(frame: int) -> Future[_Arrays]:
                return pool.submit(scene.pair, session_from_camera[frame], frame)

            begun = deque(map(begin, islice(frames, cores())))
            while begun:
                yield RenderedPair(*begun.popleft().result())
                begun.extend(map(begin, islice(frames, 1)))
