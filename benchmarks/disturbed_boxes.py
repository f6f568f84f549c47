"""What real detectors and cameras do to the rendered row: boxes that miss, boxes around leaves, pictures made worse."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.recordings import TrueBox, in_camera
from pomona.recording import Recording, open_recording

BANDS, BANDS_A_FRAME = 2.0, 0.37
"""Of a lamp at 100 Hz under a shutter that rolls for 20 ms, 27 times a second."""

Boxes = list[TrueBox]
"""A box whose fruit is "" shows none."""

FALSE_SIDES_M = (0.06, 0.09)
"""What is taken for a fruit is as large as one."""

BEHIND_M = 0.3
"""A false box lies on what the picture shows, or up to this far behind it: leaves hide leaves."""


@dataclass(frozen=True)
class Boxed:
    """How boxes err.

    Attributes
    ----------
    missing : float
        Part of the boxes that is missing.
    burst : int
        Frames in a row in which one fruit's boxes are missing.
    false : float
        Boxes around leaves, as a part of the true ones.
    lasting : int
        Frames in which each false box shows at the same place of the scene.
    jitter_px : float
        Standard deviation of each edge.
    """

    missing: float = 0.0
    burst: int = 1
    false: float = 0.0
    lasting: int = 10
    jitter_px: float = 0.0


def disturbed_boxes(boxes: Boxes, how: Boxed, recording: Recording, seed: int) -> Boxes:
    """Give the boxes that such a detector finds in a rendered recording, in order of frames."""
    rng = np.random.default_rng(seed)
    kept = _without_missing(boxes, how, recording.numbers, rng)
    strays = _strays(recording, how, round(how.false * len(boxes)), rng)
    moved = [_jittered(box, how.jitter_px, recording, rng) for box in (*kept, *strays)]
    return sorted(moved, key=lambda box: box.frame)


def _without_missing(boxes: Boxes, how: Boxed, frames: Sequence[int], rng: np.random.Generator) -> Boxes:
    """Drop boxes of a fruit in bursts: with the probability p a burst begins in a frame, 1 - (1 - p)^n are missing."""
    if how.missing == 0.0:
        return boxes
    begins = 1.0 - (1.0 - how.missing) ** (1.0 / how.burst)
    of_fruit: dict[str, Boxes] = defaultdict(list)
    for box in boxes:
        of_fruit[box.fruit].append(box)
    kept = []
    for fruit in sorted(of_fruit):
        starts = rng.random(len(frames) + how.burst - 1) < begins
        hidden = {number: bool(starts[row : row + how.burst].any()) for row, number in enumerate(frames)}
        kept += [box for box in of_fruit[fruit] if not hidden[box.frame]]
    return sorted(kept, key=lambda box: box.frame)


def _strays(recording: Recording, how: Boxed, wanted: int, rng: np.random.Generator) -> Boxes:
    """Boxes around places of the foliage, each in as many frames as it lasts or stays in the picture."""
    frames = list(recording.frames())
    strays: Boxes = []
    calibration = recording.calibration
    while len(strays) < wanted:
        first = int(rng.integers(len(frames)))
        depth_m = frames[first].read_depth()
        column, row = rng.integers(20, calibration.width - 20), rng.integers(20, calibration.height - 20)
        if depth_m[row, column] == 0:
            continue
        z = float(depth_m[row, column]) + rng.uniform(0.0, BEHIND_M)
        ray = np.array([(column - calibration.cx) / calibration.fx, (row - calibration.cy) / calibration.fy, 1.0])
        pose = frames[first].session_from_camera
        place = pose[:3, :3] @ (ray * z) + pose[:3, 3]
        side_m = rng.uniform(*FALSE_SIDES_M)
        for frame in frames[first : first + how.lasting]:
            box_px = _seen(in_camera(frame.session_from_camera, place), side_m, recording)
            if box_px is not None:
                strays.append(TrueBox(frame.number, "", box_px, 1.0))
    return strays[:wanted]


def _seen(place: NDArray[np.float64], side_m: float, recording: Recording) -> tuple[float, ...] | None:
    calibration = recording.calibration
    if place[2] <= 0.3:
        return None
    column = calibration.fx * place[0] / place[2] + calibration.cx
    row = calibration.fy * place[1] / place[2] + calibration.cy
    half = calibration.fx * side_m / 2 / place[2]
    inside = half < column < calibration.width - half and half < row < calibration.height - half
    return (
        tuple(float(round(edge)) for edge in (column - half, row - half, column + half, row + half)) if inside else None
    )


def _jittered(box: TrueBox, sigma_px: float, recording: Recording, rng: np.random.Generator) -> TrueBox:
    if sigma_px == 0.0:
        return box
    size = np.array(recording.calibration.size_px * 2, np.float64)
    edges = np.clip(np.array(box.box_px) + sigma_px * rng.normal(size=4), 0.0, size)
    edges[:2] = np.minimum(edges[:2], edges[2:] - 1.0)
    return replace(box, box_px=tuple(np.round(edges, 3).tolist()))


Change = Callable[[NDArray[np.uint8], str, int], NDArray[np.uint8]]
"""Gives the picture that the camera takes instead, of its side (left, right) and the row of its frame."""


def flickering(stops: float, seed: int) -> Change:
    """Every frame is exposed by up to so many stops more or less."""
    by_frame = np.random.default_rng(seed).uniform(-stops, stops, 10_000)
    return lambda picture, _, row: _exposed(picture, 2.0 ** by_frame[row])


def rolling(share: float) -> Change:
    """Bands roll down the picture, brighter and darker by such a share; both eyes see them."""

    def change(picture: NDArray[np.uint8], _: str, row: int) -> NDArray[np.uint8]:
        down = np.arange(len(picture)) / len(picture)
        light = 1.0 + share * np.sin(2.0 * np.pi * (BANDS * down + BANDS_A_FRAME * row))
        return np.clip(np.rint(picture * light[:, None, None]), 0, 255).astype(np.uint8)

    return change


def stepped(factor: float, at_row: int) -> Change:
    """From one frame on, all are darker."""
    return lambda picture, _, row: _exposed(picture, factor if row >= at_row else 1.0)


def one_eye(factor: float) -> Change:
    """Make the right picture darker than the left one."""
    return lambda picture, side, _: _exposed(picture, factor if side == "right" else 1.0)


def misaligned(lower_px: float, turned_deg: float) -> Change:
    """Lower the right picture, and turn it about its middle."""

    def change(picture: NDArray[np.uint8], side: str, _: int) -> NDArray[np.uint8]:
        if side == "left":
            return picture
        height, width = picture.shape[:2]
        turn = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), turned_deg, 1.0)
        turn[1, 2] += lower_px
        return np.asarray(cv2.warpAffine(picture, turn, (width, height), flags=cv2.INTER_CUBIC), np.uint8)

    return change


def _exposed(picture: NDArray[np.uint8], factor: float) -> NDArray[np.uint8]:
    return np.clip(np.rint(picture * factor), 0, 255).astype(np.uint8)


def write_recording(source: Path, folder: Path, frames: Sequence[int], boxes: Boxes, change: Change | None) -> None:
    """Make a recording folder of some frames of a rendered one, without poses, with detections.csv without names."""
    folder.mkdir(parents=True)
    (folder / "calibration.json").write_bytes((source / "calibration.json").read_bytes())
    for side in ("left", "right"):
        (folder / side).mkdir()
        for row, number in enumerate(frames):
            _write_picture(source / side / f"{number:04d}.jpg", folder / side, change, side, row)
    wanted = set(frames)
    lines = ["frame,xmin,ymin,xmax,ymax,score\n"]
    lines += [f"{box.frame},{','.join(f'{edge:g}' for edge in box.box_px)},1\n" for box in boxes if box.frame in wanted]
    (folder / "detections.csv").write_text("".join(lines), encoding="utf-8")


def _write_picture(source: Path, folder: Path, change: Change | None, side: str, row: int) -> None:
    if change is None:
        (folder / source.name).symlink_to(source.resolve())
        return
    picture = change(np.asarray(cv2.imread(str(source)), np.uint8), side, row)
    cv2.imwrite(str((folder / source.name).with_suffix(".png")), picture)


def rendered(source: Path) -> Recording:
    """Open a rendered recording with its poses and exact depth."""
    return open_recording(source)
