"""A take scanned, and which true fruit each of its fruits is; kept as long as program and pictures are the same."""

from __future__ import annotations

import hashlib
import time
from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import pomona
from benchmarks.experiments.boxes import MIN_FRAMES, clear, fruits_often_in
from benchmarks.experiments.takes import LaidOut, Take, laid_out
from benchmarks.experiments.videos import rendered
from benchmarks.recordings import TrueBox
from pomona.atomic import whole_file
from pomona.cloud import FruitCloud, Views
from pomona.made_from import MADE_FROM
from pomona.survey import Part

SAME_BOX_IOU = 0.5


@dataclass(frozen=True, eq=False)
class Visit:
    """One take, scanned from its pictures: depth by stereo, poses by odometry.

    Attributes
    ----------
    cloud : FruitCloud
        Fruits with boxes in at least `MIN_FRAMES` frames.
    true_ids : tuple of N str
        The fruit that most boxes of each show, empty where that is none.
    countable : frozenset of str
        True fruits that show clearly in as many frames.
    parts : int
        Pieces in which the camera was followed; the cloud is that of the longest.
    seconds : float
        CPU time of the scan.
    """

    cloud: FruitCloud
    true_ids: tuple[str, ...]
    countable: frozenset[str]
    parts: int
    seconds: float


def visited(take: Take, boxes: str, folder: Path) -> Visit:
    """Scan a take with one of `BOXES`, or take up what an earlier run found."""
    video = rendered(take.video, folder)
    place = laid_out(take, video, folder)
    kept = folder / "scans" / f"{take.name}-{boxes}-{_made_by(video)}.npz"
    if not kept.is_file():
        kept.parent.mkdir(exist_ok=True)
        _scan(place, boxes, kept)
    cloud, names, parts, seconds = _read(kept)
    often = np.flatnonzero(cloud.n_views >= MIN_FRAMES)
    true_ids = tuple(names[row] for row in often)
    return Visit(cloud.select(often), true_ids, fruits_often_in(clear(place.boxes)), parts, seconds)


def _scan(place: LaidOut, boxes: str, kept: Path) -> None:
    began = time.process_time()
    given = {"detections": place.true_boxes} if boxes == "true" else {"model": boxes}
    survey = pomona.scan(place.folder, odometry=True, **given)
    part, seconds = survey.parts[survey.longest], time.process_time() - began
    arrays = {
        "positions": part.cloud.positions,
        "diameters_m": part.cloud.diameters_m,
        "covariances": part.cloud.covariances,
        "n_boxes": np.bincount(part.boxes.fruits[part.boxes.fruits >= 0], minlength=len(part.cloud)),
        "view_frames": part.cloud.views.frames,
        "view_fruits": part.cloud.views.fruits,
        "true_ids": np.array(true_fruits(part, place.boxes), dtype=np.str_),
        "parts_seconds": np.array([len(survey.parts), seconds]),
    }
    with whole_file(kept) as partial, partial.open("wb") as file:
        np.savez(file, **arrays)


def _read(kept: Path) -> tuple[FruitCloud, list[str], int, float]:
    with np.load(kept) as found:
        cloud = FruitCloud(
            found["positions"],
            diameters_m=found["diameters_m"],
            covariances=found["covariances"],
            n_views=found["n_boxes"],
            views=Views(found["view_frames"], found["view_fruits"]),
        )
        parts, seconds = found["parts_seconds"].tolist()
        return cloud, found["true_ids"].tolist(), int(parts), seconds


def true_fruits(part: Part, truth: list[TrueBox]) -> list[str]:
    """Give the true fruit that most boxes of each fruit show, "" where most show none."""
    of_frame: dict[int, list[TrueBox]] = defaultdict(list)
    for box in truth:
        of_frame[box.frame].append(box)
    votes: list[Counter[str]] = [Counter() for _ in range(len(part.cloud))]
    for frame in np.unique(part.boxes.frames).tolist():
        rows = np.flatnonzero((part.boxes.frames == frame) & (part.boxes.fruits >= 0))
        for fruit, name in zip(
            part.boxes.fruits[rows], _named(part.boxes.boxes_px[rows], of_frame[frame]), strict=True
        ):
            votes[fruit][name] += 1
    return [vote.most_common(1)[0][0] if vote else "" for vote in votes]


def _named(boxes_px: NDArray[np.float64], truth: list[TrueBox]) -> list[str]:
    """Name of the true box that each box is, "" for none."""
    if not truth:
        return [""] * len(boxes_px)
    overlap = _overlap(boxes_px, np.array([box.box_px for box in truth], np.float64))
    best = overlap.argmax(axis=1)
    same = overlap[np.arange(len(best)), best] >= SAME_BOX_IOU
    return [truth[row].fruit if is_same else "" for row, is_same in zip(best.tolist(), same.tolist(), strict=True)]


def _overlap(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Intersection over union of each box of one with each of the other, (A, B)."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.prod(np.clip(high - low, 0.0, None), axis=2)
    of_first, of_second = (np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) for boxes in (first, second))
    return np.asarray(shared / (of_first[:, None] + of_second[None] - shared))


def _made_by(video: Path) -> str:
    return hashlib.sha256(program() + (video / MADE_FROM).read_bytes()).hexdigest()[:12]


@cache
def program() -> bytes:
    """Digest of all that a scan runs: the package with its models, and the core."""
    package = Path(pomona.__file__).parent
    files = sorted(path for kind in ("*.py", "*.so", "*.onnx") for path in package.rglob(kind))
    return hashlib.sha256(b"".join(hashlib.sha256(path.read_bytes()).digest() for path in files)).digest()
