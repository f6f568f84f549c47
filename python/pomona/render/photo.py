"""Photo-real pictures: paths traced by Blender's Cycles, in a process of its own that exchanges files with this one."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.render.layout import lay_out
from pomona.render.scene_view import RenderedPair, Weather
from pomona.threads import require_threads

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.recording.calibration import Calibration
    from pomona.render.surfaces import Surface
    from pomona.synth.row_geometry import RowGeometry

__all__ = ["BLENDER_PYTHON", "GPU_SAMPLES", "INSTALL", "PathTracer"]

SCRIPT = Path(__file__).with_name("blender_script") / "render_job.py"

BLENDER_PYTHON = "POMONA_BLENDER_PYTHON"
"""Environment variable: a Python with `bpy`, where that of Pomona has none."""

GPU_SAMPLES = 16
"""Paths of a pixel on a graphics card: twice what the processor traces, and with many rows at once nearly free."""

NO_BLENDER = 3
"""Exit code of the script when Blender's module cannot be loaded."""

INSTALL = "pip install bpy==5.0.1"
"""What brings Blender's module, of the version that the extra `render` names."""

TOLD = "pomona pair "
"""What the script prints before the number of a pair that is done."""


@dataclass(frozen=True)
class PathTracer:
    """A renderer by path tracing.

    Pairs that are complete in `folder` are not rendered again, so a run that was killed goes on where it was.

    Attributes
    ----------
    samples : int
        Paths of a pixel, before the noise is removed.
    threads : int
    gpu : bool
        On a graphics card; its pictures differ in their last digits from those of the processor.
    folder : Path or None
        Where the job and its pairs are kept; None for a folder that is gone afterwards.
    interpreter : str or None
        A Python in which `bpy` is installed; None for that of the environment variable `BLENDER_PYTHON`, else this one.
    """

    name: ClassVar[str] = "photo"

    samples: int = 8
    threads: int = 1
    gpu: bool = False
    folder: Path | None = None
    interpreter: str | None = None

    def require_installed(self) -> None:
        """Refuse where Blender's module cannot be loaded.

        Raises
        ------
        PomonaError
            Saying what to install.
        """
        command = [_python(self.interpreter), "-c", "import bpy"]
        with _started(command[0]):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise PomonaError(_reason(NO_BLENDER, done.stderr))

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
        """Give the pair of each pose, (N, 4, 4), in turn, from number `first` on; OpenCV axes, the left camera.

        Raises
        ------
        PomonaError
            Without Blender's module, when `folder` holds another job, when Blender fails.
        """
        surfaces, places = lay_out(geometry, seed)
        job = self._job(camera, session_from_camera, weather, seed) | {"places": places}
        with self._kept() as folder:
            _write_job(folder, job, surfaces)
            yield from self._pairs(folder, range(first, len(session_from_camera)))

    def _job(self, camera: Calibration, poses: NDArray[np.float64], weather: Weather, seed: int) -> dict[str, Any]:
        if camera.baseline_m is None:
            raise PomonaError("baseline_m: found none, expected the distance of the right camera, metres")
        if self.samples < 1:
            raise PomonaError(f"samples: found {self.samples}, expected a whole number from 1")
        return {
            **{name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy", "baseline_m")},
            "poses": np.asarray(poses).tolist(),
            "weather": dataclasses.asdict(weather),
            "samples": self.samples,
            "threads": require_threads(self.threads),
            "gpu": self.gpu,
            "seed": seed,
        }

    @contextlib.contextmanager
    def _kept(self) -> Iterator[Path]:
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
            yield self.folder
            return
        with tempfile.TemporaryDirectory(prefix="pomona.") as folder:
            yield Path(folder)

    def _pairs(self, folder: Path, numbers: range) -> Iterator[RenderedPair]:
        """Read pairs as they come to the folder."""
        there = [_pair_file(folder, number) for number in numbers]
        if all(path.exists() for path in there):
            yield from map(_read, there)
            return
        with _blender(self.interpreter, folder, numbers.start) as told:
            for path in there:
                while not path.exists():
                    if next(told, None) is None:
                        raise PomonaError(f"{path}: Blender ended before it was rendered")
                yield _read(path)


def _write_job(folder: Path, job: dict[str, Any], surfaces: dict[str, Surface]) -> None:
    """Leave the job in its folder; what is there already must be the same one."""
    arrays: dict[str, Any] = {}
    for name, surface in surfaces.items():
        parts = {"vertices_m": surface.vertices_m, "faces": surface.faces, **surface.values}
        arrays |= {f"{name}/{part}": array for part, array in parts.items()}
    digest = hashlib.sha256()
    for key, array in arrays.items():
        digest.update(key.encode() + np.ascontiguousarray(array).tobytes())
    # The same pictures come of any number of threads.
    told = json.dumps(job | {"surfaces": digest.hexdigest()}, indent=1)
    path = folder / "job.json"
    if path.exists() and _without_threads(path.read_text()) != _without_threads(told):
        raise PomonaError(f"{folder}: holds the pictures of another job, expected this one or an empty folder")
    for kind in ("truth", "pairs"):
        (folder / kind).mkdir(exist_ok=True)
    with whole_file(folder / "surfaces.npz") as partial, partial.open("wb") as file:
        np.savez(file, **arrays)
    with whole_file(path) as partial:
        partial.write_text(told)


def _without_threads(told: str) -> dict[str, Any]:
    return {name: value for name, value in json.loads(told).items() if name != "threads"}


@contextlib.contextmanager
def _blender(interpreter: str | None, folder: Path, first: int) -> Iterator[Iterator[str]]:
    """Run the script; give its lines about pairs, and say in one line what went wrong."""
    python = _python(interpreter)
    with (folder / "blender.log").open("w") as log:
        command = [python, str(SCRIPT), str(folder), str(first)]
        with _started(python):
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        try:
            yield _lines(process, folder)
        finally:
            process.kill()
            process.communicate()


def _python(interpreter: str | None) -> str:
    return interpreter or os.environ.get(BLENDER_PYTHON, sys.executable)


@contextlib.contextmanager
def _started(python: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise PomonaError(f"{python}: cannot be run: {error.strerror}") from None


def _lines(process: subprocess.Popen[str], folder: Path) -> Iterator[str]:
    assert process.stdout is not None
    yield from (line for line in process.stdout if line.startswith(TOLD))
    if process.wait() != 0:
        raise PomonaError(_reason(process.returncode, (folder / "blender.log").read_text()))


def _reason(code: int, log: str) -> str:
    last = (log.strip().splitlines() or ["no word"])[-1]
    if code != NO_BLENDER:
        return f"Blender: ended with {code}: {last}"
    if "bpy" in last:
        return f"photo-real pictures need Blender's module bpy, which is not installed: {INSTALL}"
    return f"photo-real pictures need a library of the system for bpy: {last}"


def _pair_file(folder: Path, number: int) -> Path:
    return folder / "pairs" / f"{number:04d}.npz"


def _read(path: Path) -> RenderedPair:
    with np.load(path) as arrays:
        pictures = {name: arrays[name].astype(np.float32) for name in ("left", "right")}
        return RenderedPair(**pictures, depth_m=arrays["depth_m"], ids=arrays["ids"])
