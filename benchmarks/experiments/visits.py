"""A take scanned, and which true fruit each of its fruits is; kept as long as program and pictures are the same."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import pomona
from benchmarks.experiments.boxes import MIN_FRAMES, clear, fruits_often_in
from benchmarks.experiments.naming import detected, named_boxes, true_fruits
from benchmarks.experiments.takes import LaidOut, Take, laid_out
from benchmarks.experiments.videos import rendered
from pomona.atomic import whole_file
from pomona.cloud import FruitCloud, Views
from pomona.made_from import MADE_FROM

FORMAT = b"2"
"""Of the files of scans."""


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
    detected : frozenset of str
        True fruits around which the scan was given boxes in as many frames.
    """

    cloud: FruitCloud
    true_ids: tuple[str, ...]
    countable: frozenset[str]
    detected: frozenset[str]


def visited(take: Take, boxes: str, folder: Path) -> Visit:
    """Scan a take with one of `BOXES`, or take up what an earlier run found."""
    video = rendered(take.video, folder)
    place = laid_out(take, video, folder)
    kept = folder / "scans" / f"{take.name}-{boxes}-{_made_by(video)}.npz"
    if not kept.is_file():
        kept.parent.mkdir(exist_ok=True)
        _scan(place, boxes, kept)
    return _read(kept, fruits_often_in(clear(place.boxes)))


def _scan(place: LaidOut, boxes: str, kept: Path) -> None:
    given = {"detections": place.true_boxes} if boxes == "true" else {"model": boxes}
    survey = pomona.scan(place.folder, odometry=True, **given)
    if len(survey.parts) > 1:
        sys.stderr.write(f"{kept.stem}: the track broke, the longest of {len(survey.parts)} parts is taken\n")
    part = survey.parts[survey.longest]
    names = named_boxes(part.boxes, place.boxes)
    arrays = {
        "positions": part.cloud.positions,
        "diameters_m": part.cloud.diameters_m,
        "covariances": part.cloud.covariances,
        "n_boxes": np.bincount(part.boxes.fruits[part.boxes.fruits >= 0], minlength=len(part.cloud)),
        "view_frames": part.cloud.views.frames,
        "view_fruits": part.cloud.views.fruits,
        "true_ids": np.array(true_fruits(part, names), dtype=np.str_),
        "detected": np.array(detected(part.boxes, names), dtype=np.str_),
    }
    with whole_file(kept) as partial, partial.open("wb") as file:
        np.savez(file, **arrays)


def _read(kept: Path, countable: frozenset[str]) -> Visit:
    with np.load(kept) as found:
        cloud = FruitCloud(
            found["positions"],
            diameters_m=found["diameters_m"],
            covariances=found["covariances"],
            n_views=found["n_boxes"],
            views=Views(found["view_frames"], found["view_fruits"]),
        )
        often = np.flatnonzero(found["n_boxes"] >= MIN_FRAMES)
        true_ids = tuple(found["true_ids"][often].tolist())
        return Visit(cloud.select(often), true_ids, countable, frozenset(found["detected"].tolist()))


def _made_by(video: Path) -> str:
    return hashlib.sha256(FORMAT + program() + (video / MADE_FROM).read_bytes()).hexdigest()[:12]


@cache
def program() -> bytes:
    """Digest of all that a scan runs: the package with its models, and the core."""
    package = Path(pomona.__file__).parent
    files = sorted(path for kind in ("*.py", "*.so", "*.onnx") for path in package.rglob(kind))
    return hashlib.sha256(b"".join(hashlib.sha256(path.read_bytes()).digest() for path in files)).digest()
