"""`pomona train`: the shipped network learns a user's own fruit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from pomona.amounts import amount
from pomona.atomic import whole_file
from pomona.detect.picture_boxes import boxes_within, read_boxes
from pomona.detect.picture_file import pictures_in
from pomona.detect.training.cache import cached
from pomona.detect.training.finishing import finished, judged_on
from pomona.detect.training.graph import network_in, write_network
from pomona.detect.training.labels import Labelled
from pomona.detect.training.loop import Plan, Progress, Source, train
from pomona.detect.training.score_scaling import Scaling
from pomona.errors import PomonaError
from pomona.recording.pictures import picture_size

__all__ = ["Trained", "fine_tune", "labelled_pictures"]

LEAST_PICTURES = 5
"""Fewer cannot be split into some to learn from and some to try it on."""

EVERY = 5
"""A fifth of the pictures is not learnt from: it calibrates the scores and says how well it went."""

PLAN = Plan(batches=1200, batch=8, rate=3e-4, warm_up=50, falling=0.5)
"""Half an hour on two cores; the rate is low, for what was learnt before shall stay."""


@dataclass(frozen=True)
class Trained:
    """What came of it, on the pictures that were kept apart.

    Attributes
    ----------
    n_pictures, n_fruits : int
        All that had boxes, and their boxes.
    before, after : float
        AP50 of the network that it began with, and of the new one.
    min_score : float
        Least score that counts right.
    scaling : Scaling
    """

    n_pictures: int
    n_fruits: int
    before: float
    after: float
    min_score: float
    scaling: Scaling


def labelled_pictures(places: Sequence[Path], boxes: Path) -> list[Labelled]:
    """Read pictures with their boxes; one without a box is one without a fruit.

    Raises
    ------
    PomonaError
        One line with the file and the line, what was found and what was expected.
    """
    pictures = pictures_in(places)
    listed = read_boxes(boxes, pictures)
    labelled = []
    for name, path in pictures.items():
        boxes_px = boxes_within(boxes, listed.get(name, ()), picture_size(path))
        labelled.append(Labelled(path, boxes_px, np.full(len(boxes_px), np.nan, np.float32)))
    if len(labelled) < LEAST_PICTURES or not listed:
        found = f"found {amount(len(labelled), 'picture')} with {amount(sum(map(len, listed.values())), 'box')}"
        raise PomonaError(f"{boxes}: {found}, expected {LEAST_PICTURES} pictures or more, and boxes in them")
    return labelled


def fine_tune(
    labelled: Sequence[Labelled],
    output: Path,
    *,
    begin: Path,
    work: Path,
    batches: int = PLAN.batches,
    seed: int = PLAN.seed,
    progress: Progress = lambda _done, _loss: None,
) -> Trained:
    """Train the network of a model on labelled pictures, and write the new model.

    Parameters
    ----------
    labelled : sequence of Labelled
    output : Path
        The new model.
    begin : Path
        The shipped model in 32 bits, or one that was trained from it.
    work : Path
        Folder of checkpoints and decoded pictures: a training that was interrupted goes on from there.
    batches, seed : int
    progress : callable
        Told the batches that are done, and the mean loss of late.
    """
    learnt, kept = _split(labelled)
    plan = replace(PLAN, batches=batches, seed=seed)
    checkpoint = work / f"{_name_of(labelled, begin, plan)}.pt"
    network = train([Source(cached(learnt, work), 1.0)], plan, checkpoint, network_in(begin), progress).eval()
    network, min_score, scaled = finished(network, kept)
    about = {
        "begun_with": begin.name,
        "pictures": len(labelled),
        "batches": batches,
        "seed": seed,
        "calibration": asdict(scaled),
    }
    with whole_file(output) as partial:
        write_network(partial, network, min_score, about)
        before, after = _precisions(begin, kept), _precisions(partial, kept)
    fruits = sum(len(each.boxes_px) for each in labelled)
    return Trained(len(labelled), fruits, before, after, min_score, scaled)


def _precisions(model: Path, kept: Sequence[Labelled]) -> float:
    from pomona.detect.onnx import OnnxDetector

    return judged_on(OnnxDetector.open(model, min_score=0.05), kept).average_precision


def _split(labelled: Sequence[Labelled]) -> tuple[list[Labelled], list[Labelled]]:
    """Keep the last fifth apart, in the order of their names: neighbours may be crops of one photograph."""
    ordered = sorted(labelled, key=lambda each: each.picture.name)
    n_kept = max(len(ordered) // EVERY, 1)
    return ordered[:-n_kept], ordered[-n_kept:]


def _name_of(labelled: Sequence[Labelled], begin: Path, plan: Plan) -> str:
    """Name a run by all that it depends on, so that only the same one goes on."""
    digest = sha256(json.dumps(asdict(plan)).encode() + begin.read_bytes())
    for each in labelled:
        digest.update(f"{each.picture.resolve()} {each.picture.stat().st_mtime_ns}".encode() + each.boxes_px.tobytes())
    return digest.hexdigest()[:16]
