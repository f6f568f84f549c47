"""The story of a rendered recording: a row on a day, a camera's way, light, pictures, files."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration
from pomona.recording.picture_size import require_size
from pomona.render.camera_path import camera_path, pairs_along
from pomona.render.motion_blur import blurred, moved_while_open, right_depth_m
from pomona.render.recording_writer import RecordingWriter
from pomona.render.sensor import Sensor, exposure_for
from pomona.render.weather import draw_weather
from pomona.synth.living import RowDesign, grow
from pomona.threads import cores

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pomona.render.scene_view import RenderedPair, Renderer
    from pomona.synth.row_geometry import FruitSolids
    from pomona.trajectory import Trajectory

__all__ = ["RENDERERS", "Filming", "film"]

FOCAL_WIDTHS = 0.6516
"""Focal length in picture widths: 75 degrees from left to right, as stereo cameras for robots have."""

BASELINE_M = 0.12

FORMAT = 1

RENDERERS = ("raster", "photo", "photo-gpu")


@dataclass(frozen=True)
class Filming:
    """What is filmed, and how.

    Attributes
    ----------
    design : RowDesign
    day : date
        Of the visit.
    seed
        Of the row; with the day also of weather, shake and noise.
    path, weather
        Names in `PATHS` and `WEATHERS`.
    pairs
        0 for as many as the path takes at 10 a second.
    size_px
        Width and height.
    jitter
        How much distance, height and direction differ from the path's own, 0 to 1.
    eyes
        Electronics of the left and the right camera.
    jpeg_quality
        None writes PNG.
    renderer
        One of `RENDERERS`.
    """

    design: RowDesign = field(default_factory=RowDesign)
    day: datetime.date = datetime.date(2024, 8, 9)
    seed: int = 0
    path: str = "tractor"
    weather: str = "sun"
    pairs: int = 0
    size_px: tuple[int, int] = (640, 360)
    jitter: float = 0.0
    eyes: tuple[Sensor, Sensor] = (Sensor(), Sensor())
    jpeg_quality: int | None = None
    renderer: str = "raster"

    @property
    def visit_seed(self) -> int:
        """Seed of what differs between two visits to the same row."""
        return int(np.random.SeedSequence([self.seed, self.day.toordinal()]).generate_state(1)[0])

    @property
    def camera(self) -> Calibration:
        """The rectified pair."""
        width, height = require_size("width, height", self.size_px)
        focal_px = FOCAL_WIDTHS * width
        return Calibration(width, height, focal_px, focal_px, width / 2, height / 2, BASELINE_M)


def film(filming: Filming, folder: Path, *, tell: Callable[[int, int], None] = lambda _done, _total: None) -> int:
    """Render a recording into a folder, or go on with one that was interrupted; give the number of its pairs.

    Parameters
    ----------
    tell : callable
        Called with the number of pairs that are done, and of all.

    Raises
    ------
    PomonaError
        When something is asked that cannot be, the renderer is not installed, or the folder holds something else.
    """
    renderer, camera = renderer_called(filming.renderer), filming.camera
    weather = draw_weather(filming.weather, filming.visit_seed)
    geometry = grow(filming.design, filming.seed).on(filming.day)
    trajectory = _trajectory(filming, geometry.fruits)
    if not folder.is_dir():
        renderer.require_installed()
    writer = RecordingWriter(folder, _made_from(filming), filming.jpeg_quality)
    first = writer.first_missing(len(trajectory))
    tell(first, len(trajectory))
    poses, seed = trajectory.session_from_camera, filming.visit_seed
    if first < len(trajectory):
        pairs = renderer.render(geometry, camera, poses, weather, seed, first=first)
        for number, pair in enumerate(pairs, start=first):
            left, right = _taken(filming, camera, trajectory, number, pair)
            writer.write_frame(number, left, right, pair.depth_m, pair.ids)
            tell(number + 1, len(trajectory))
    writer.finish(camera, trajectory, geometry.fruits, filming.day.isoformat())
    return len(trajectory)


def renderer_called(name: str) -> Renderer:
    """Give a renderer by its name.

    Raises
    ------
    PomonaError
        If none has this name.
    """
    if name == "raster":
        from pomona.render.raster import RasterRenderer

        return RasterRenderer()
    if name in ("photo", "photo-gpu"):
        from pomona.render.photo import GPU_SAMPLES, PathTracer

        if name == "photo-gpu":
            return PathTracer(samples=GPU_SAMPLES, threads=cores(), gpu=True)
        return PathTracer(threads=cores())
    raise PomonaError(f"no renderer is called {name!r}; expected one of {', '.join(RENDERERS)}")


def _trajectory(filming: Filming, fruits: FruitSolids) -> Trajectory:
    """Drive past all labelled fruits."""
    along_m = fruits.centres_m[fruits.ids > 0, 0]
    if len(along_m) == 0:
        raise PomonaError(f"seed {filming.seed}: no fruit hangs on {filming.day}, expected some to film")
    reach_m = float(along_m.min()), float(along_m.max())
    pairs = filming.pairs or pairs_along(filming.path, reach_m)
    return camera_path(filming.path, reach_m, pairs, filming.visit_seed, jitter=filming.jitter)


def _taken(
    filming: Filming, camera: Calibration, trajectory: Trajectory, number: int, pair: RenderedPair
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Expose both eyes: what moves is blurred; the left eye's light sets the exposure of both."""
    exposure = exposure_for(pair.left)
    depths_m = pair.depth_m, right_depth_m(pair.depth_m, camera)
    pictures = []
    for eye, (sensor, light, depth_m) in enumerate(zip(filming.eyes, (pair.left, pair.right), depths_m, strict=True)):
        rng = np.random.default_rng([filming.visit_seed, number, eye])
        moved = moved_while_open(trajectory, number, sensor.shutter_s)
        pictures.append(sensor.develop(blurred(light, depth_m, camera, moved), exposure, rng))
    return pictures[0], pictures[1]


def _made_from(filming: Filming) -> dict[str, object]:
    """All of it as JSON values."""
    import json

    values: dict[str, Any] = json.loads(json.dumps(asdict(filming), default=str))
    if not filming.design.clear_of_posts:
        del values["design"]["clear_of_posts"]  # as before it could be asked: such recordings are gone on with
    return {"format": FORMAT, **values}
