"""Where is the camera? A map of one date, every frame of another: other direction, weather, growth, sag.

Maps are scanned with true poses, so that their frame is the truth's. The frames to be found know nothing but their
pictures: boxes, true or of the shipped detector, depth from stereo, and odometry where frames are tracked. A pose is
false beyond 0.3 m or 5 degrees. NEES is the squared error under the pose's own covariance, 6 where that is right.
Writes localize.csv, localize.md and localize.png.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.localize_picture import write_picture
from benchmarks.results import markdown, shared_data, write_rows, write_text
from pomona import FruitCloud, Localization, Localizer
from pomona.detect.opening import FoundBoxes, open_detector
from pomona.localize.following import Moving, cloud_of
from pomona.matching import Up
from pomona.recording import Recording, open_recording
from pomona.recording.poses import read_tum, write_tum
from pomona.survey import scan
from pomona.survey.pose_source import pose_source_of
from pomona.survey.seeing import Seeing
from pomona.trajectory import Trajectory

EXAMPLES = Path(__file__).parents[1] / "examples" / "row"

FALSE_M, FALSE_DEG = 0.3, 5.0

SHOWN = ("2024-08-09", "2024-08-28")
"""Map and drive of the picture."""

UP = np.array([0.0, 0.0, 1.0])
"""Of the true poses, and so of the maps."""

VERTICAL = "tracked, vertical known"
"""The mode that is told where up is, as an IMU does."""


@dataclass(frozen=True, eq=False)
class Drive:
    """One date with one kind of boxes: its map, and what its frames show."""

    row: str
    date: str
    boxes: str
    map: FruitCloud
    frames: tuple[FruitCloud, ...]
    moved: tuple[NDArray[np.float64] | None, ...]
    map_from_camera: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Outcome:
    """All frames of one drive in the map of another."""

    map: Drive
    query: Drive
    mode: str
    found: tuple[Localization, ...]
    seconds: NDArray[np.float64]

    @property
    def steps(self) -> NDArray[np.float64]:
        """From each pose that was found to the true one, (F, 6): metres and radians in the camera's frame."""
        both = zip(self.found, self.query.map_from_camera, strict=True)
        return np.array([_step(one.map_from_camera, true) for one, true in both if one]).reshape(-1, 6)

    @property
    def nees(self) -> NDArray[np.float64]:
        """Squared errors of the poses that were found under their own covariances, (F,)."""
        covariances = [one.covariance for one in self.found if one]
        return np.array([e @ np.linalg.solve(c, e) for e, c in zip(self.steps, covariances, strict=True)])


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks localize", description=__doc__)
    parser.add_argument("--boxes", default="true,shipped", help="true, shipped or both")
    options = parser.parse_args(arguments)
    outcomes = [
        outcome
        for boxes in options.boxes.split(",")
        for row in _rows()
        for map, query in permutations([drive(row.name, visit, boxes) for visit in visits(row)], 2)
        for outcome in outcomes_of(map, query)
    ]
    text = report(outcomes)
    sys.stdout.write(text)
    if options.boxes == parser.get_default("boxes"):
        record(outcomes, text)


def report(outcomes: list[Outcome]) -> str:
    """Give the table of all drives."""
    rows = [as_row(outcome) for outcome in outcomes]
    return markdown(tuple(rows[0]), [tuple(map(str, row.values())) for row in rows])


def record(outcomes: list[Outcome], text: str) -> None:
    """Write tables and picture."""
    write_rows("localize.csv", [as_row(outcome) for outcome in outcomes])
    write_text("localize.md", text)
    shown = [one for one in outcomes if (one.map.date, one.query.date) == SHOWN and one.query.boxes == "shipped"]
    modes = ("single", "tracked", VERTICAL)
    tracked = next(one for one in reversed(shown) if one.mode == "tracked")
    write_picture("localize.png", tracked, {mode: nees_of(outcomes, mode) for mode in modes})


def _rows() -> Iterator[Path]:
    yield EXAMPLES
    if (data := shared_data("localize: rendered row")) is not None:
        yield data / "rendered_row"


def visits(row: Path) -> list[Path]:
    return [visit for visit in sorted(row.iterdir()) if visit.is_dir()]


def drive(row: str, visit: Path, boxes: str) -> Drive:
    """Scan a date for its map, and look at each of its frames alone."""
    with tempfile.TemporaryDirectory() as folder:
        posed, bare = _recordings(visit, Path(folder) / "poses.txt")
        map = scan(posed, _detector(visit, boxes, posed), depth="stereo").cloud
        seeing = Seeing(bare, _detector(visit, boxes, bare), depth="stereo", colour=False)
        camera = Moving(pose_source_of(bare))
        clouds, moved = [], []
        for frame in bare.frames():
            clouds.append(cloud_of(seeing(frame).lifted))
            moved.append(camera(frame))
            camera.use()
        assert posed.trajectory is not None
        poses = posed.trajectory.session_from_camera
    sys.stderr.write(f"{visit.name}, {boxes} boxes: {len(map)} fruits\n")
    return Drive(row, visit.name, boxes, map, tuple(clouds), tuple(moved), poses)


def _recordings(visit: Path, at_frames: Path) -> tuple[Recording, Recording]:
    """Open a date with true poses and without any. The poses of the videos have a clock of their own: one a frame."""
    if not (visit / "row.mp4").exists():
        return open_recording(visit), open_recording(visit, own_poses=False)
    bare = open_recording(visit / "row.mp4")
    _, poses = read_tum(visit / "poses_tum.txt")
    times_s = np.arange(len(poses), dtype=np.float64) if bare.times_s is None else bare.times_s
    write_tum(at_frames, Trajectory(np.arange(len(poses)), times_s, poses))
    return open_recording(visit / "row.mp4", poses=at_frames), bare


def _detector(visit: Path, boxes: str, recording: Recording) -> FoundBoxes:
    if boxes == "shipped":
        return open_detector(None, Path("shipped"), recording)
    return open_detector(visit / "ids" if (visit / "ids").is_dir() else visit / "boxes.csv", None, recording)


def outcomes_of(map: Drive, query: Drive) -> Iterator[Outcome]:
    """Find every frame from nothing, then one after the other."""
    localizer = Localizer(map.map, threads=1)
    yield _outcome(map, query, "single", lambda cloud, _moved, _up: localizer.locate(cloud))
    yield _outcome(map, query, "tracked", lambda cloud, moved, _up: localizer.update(cloud, moved))
    localizer.reset()
    yield _outcome(map, query, "tracked, motion unknown", lambda cloud, _moved, _up: localizer.update(cloud))
    localizer.reset()
    yield _outcome(map, query, VERTICAL, lambda cloud, moved, up: localizer.update(cloud, moved, up=up))


def _outcome(
    map: Drive, query: Drive, mode: str, find: Callable[[FruitCloud, NDArray[np.float64] | None, Up], Localization]
) -> Outcome:
    found, seconds = [], []
    for cloud, moved, true in zip(query.frames, query.moved, query.map_from_camera, strict=True):
        up = (true[:3, :3].T @ UP).tolist(), UP.tolist()
        begun_s = time.perf_counter()
        found.append(find(cloud, moved, up))
        seconds.append(time.perf_counter() - begun_s)
    return Outcome(map, query, mode, tuple(found), np.array(seconds))


def _step(found: NDArray[np.float64] | None, true: NDArray[np.float64]) -> NDArray[np.float64]:
    assert found is not None
    off = np.linalg.solve(found, true)
    return np.concatenate((off[:3, 3], Rotation.from_matrix(off[:3, :3]).as_rotvec()))


def nees_of(outcomes: list[Outcome], mode: str) -> NDArray[np.float64]:
    return np.concatenate([one.nees for one in outcomes if one.mode == mode])


def as_row(outcome: Outcome) -> dict[str, object]:
    steps, n = outcome.steps, len(outcome.found)
    off_mm = 1000 * np.linalg.norm(steps[:, :3], axis=1)
    off_deg = np.degrees(np.linalg.norm(steps[:, 3:], axis=1))
    return {
        "row": outcome.query.row,
        "map": outcome.map.date,
        "frames of": outcome.query.date,
        "boxes": outcome.query.boxes,
        "mode": outcome.mode,
        "found": f"{len(steps) / n:.3f}",
        "false": int(((off_mm > 1000 * FALSE_M) | (off_deg > FALSE_DEG)).sum()),
        "mm": f"{_quantile(off_mm, 50):.1f}",
        "95 % mm": f"{_quantile(off_mm, 95):.1f}",
        "deg": f"{_quantile(off_deg, 50):.2f}",
        "95 % deg": f"{_quantile(off_deg, 95):.2f}",
        "NEES": f"{outcome.nees.mean() if len(steps) else np.nan:.1f}",
        "ms": f"{1000 * np.median(outcome.seconds):.1f}",
    }


def _quantile(values: NDArray[np.float64], percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else float("nan")
