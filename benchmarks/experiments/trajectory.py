"""Where the camera was, from fruit matches alone: each frame's fruits matched with the map, one frame at a time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import pomona
from benchmarks.experiments.takes import LaidOut, Take, laid_out
from benchmarks.experiments.videos import rendered
from benchmarks.experiments.visits import Visit, visited
from benchmarks.pose import pose_error
from benchmarks.results import markdown
from pomona.cloud import FruitCloud
from pomona.detect.opening import open_detector
from pomona.recording import open_recording
from pomona.recording.poses import read_tum
from pomona.survey.seeing import Seeing

MAP, VIDEO = "synthetic-1", "synthetic-3"

FIGURE = "experiments-trajectory.png"

METHODS = ("paper", "verified")

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Located:
    """Poses of one method.

    Attributes
    ----------
    row_from_camera : (F, 4, 4) float64
        NaN of frames without an answer.
    shifts_m, turns_deg : (F,) float64
        Errors; NaN likewise.
    """

    row_from_camera: Array
    shifts_m: Array
    turns_deg: Array


def trajectory(folder: Path, images: Path) -> str:
    """Locate every frame by both methods, draw it and say it in markdown."""
    map_ = visited(Take(MAP), "true", folder)
    motion = row_from_map(map_, rendered(MAP, folder))
    video = rendered(VIDEO, folder)
    frames = frames_in_camera(laid_out(Take(VIDEO), video, folder))
    _, true = read_tum(video / "poses_tum.txt")
    found = {method: located(frames, map_.cloud, motion, true, method) for method in METHODS}
    _draw(found["verified"], true, images / FIGURE)
    return report(found, frames)


def frames_in_camera(take: LaidOut) -> list[FruitCloud]:
    """Give what stereo sees of each frame's boxes, in the frame of that camera; no frame knows of another."""
    recording = open_recording(take.folder)
    seeing = Seeing(recording, open_detector(take.true_boxes, None, recording))
    lifted = [seeing(frame).lifted for frame in recording.frames()]
    return [
        FruitCloud(found.centres_in_camera, covariances=found.covariances, diameters_m=found.diameters_m)
        for found in lifted
    ]


def located(frames: list[FruitCloud], map_: FruitCloud, motion: Array, true: Array, method: str) -> Located:
    """Match each frame with the map, which a motion takes to the row; compare with the true poses, (F, 4, 4)."""
    index = pomona.Index(map_, method=method)
    poses, errors = np.full((len(frames), 4, 4), np.nan), np.full((len(frames), 2), np.nan)
    for number, frame in enumerate(frames):
        found = index.match(frame)
        if found.map_from_query is not None:
            poses[number] = motion @ found.map_from_query
            error = pose_error(poses[number], true[number], np.zeros((1, 3)))
            errors[number] = error.translation_m, error.rotation_deg
    return Located(poses, *errors.T)


def row_from_map(map_: Visit, video: Path) -> Array:
    """Rigid motion (4, 4) of the map's fruits onto their true places (Kabsch)."""
    truth = FruitCloud.read(video / "fruits.csv")
    place_of = dict(zip(truth.ids or (), truth.positions, strict=True))
    rows = [row for row, name in enumerate(map_.true_ids) if name]
    found, true = map_.cloud.positions[rows], np.array([place_of[map_.true_ids[row]] for row in rows])
    u, _, vt = np.linalg.svd((true - true.mean(axis=0)).T @ (found - found.mean(axis=0)))
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    motion = np.eye(4)
    motion[:3, :3] = u @ vt
    motion[:3, 3] = true.mean(axis=0) - motion[:3, :3] @ found.mean(axis=0)
    return motion


def report(found: dict[str, Located], frames: list[FruitCloud]) -> str:
    """Lay out the errors by method."""
    header = ("method", "frames located", "median", "90 %", "worst", "median turn", "worst turn")
    lines = [
        (
            method,
            f"{np.isfinite(one.shifts_m).sum()}/{len(frames)}",
            *(f"{1000 * np.nanpercentile(one.shifts_m, share):.1f} mm" for share in (50, 90, 100)),
            *(f"{np.nanpercentile(one.turns_deg, share):.2f}°" for share in (50, 100)),
        )
        for method, one in found.items()
    ]
    fruits = np.mean([len(frame) for frame in frames])
    return (
        f"{len(frames)} frames of `{VIDEO}`, {fruits:.0f} fruits each, one by one matched with the map of `{MAP}`, no "
        f"pose and no other frame known. Error of the camera's place and direction:\n\n{markdown(header, lines)}"
    )


def _draw(found: Located, true: Array, path: Path) -> None:
    """Draw the way from above and from the front: truth blue, found red, as in the paper."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, rows = plt.subplots(2, 1, figsize=(7, 4.2), layout="constrained", sharex=True)
    for axes, side, name in zip(rows, (1, 2), ("across (m)", "up (m)"), strict=True):
        axes.plot(true[:, 0, 3], true[:, side, 3], "o-", color="tab:blue", markersize=5, label="truth")
        poses = found.row_from_camera
        axes.plot(
            poses[:, 0, 3], poses[:, side, 3], "x-", color="tab:red", markersize=4, linewidth=1, label="fruits alone"
        )
        axes.set(ylabel=name)
        axes.set_aspect("equal", adjustable="datalim")
    rows[0].legend(frameon=False, ncols=2)
    rows[1].set(xlabel="along the row (m)")
    figure.savefig(path, dpi=110)
    plt.close(figure)
