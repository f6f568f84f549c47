"""`pomona train`: the shipped network learns a user's own fruit."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from pomona.atomic import whole_file
from pomona.detect.accuracy import areas
from pomona.detect.onnx.usual_size import USUAL_PX
from pomona.detect.training.cache import Sample, cached
from pomona.detect.training.finishing import finished, judged_on
from pomona.detect.training.graph import network_in, write_network
from pomona.detect.training.labels import Labelled
from pomona.detect.training.loop import Plan, Progress, Source, Stop, train
from pomona.detect.training.score_scaling import Scaling
from pomona.errors import PomonaWarning

__all__ = ["Trained", "fine_tune"]

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


def fine_tune(
    labelled: Sequence[Labelled],
    output: Path,
    *,
    begin: Path,
    work: Path,
    batches: int = PLAN.batches,
    seed: int = PLAN.seed,
    progress: Progress = lambda _done, _loss: None,
    stop: Stop = lambda: False,
) -> Trained:
    """Train the network of a model on labelled pictures, and write the new model, also where it is worse: it warns.

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
    stop : callable
        Asked after each batch whether to end there, with `KeyboardInterrupt` and all that is done kept in `work`.

    Raises
    ------
    PomonaError
        A picture cannot be read, the model to begin with is another, or what `work` has is damaged.
    """
    learnt, kept = _split(labelled)
    plan = replace(PLAN, batches=batches, seed=seed)
    checkpoint = work / f"{_name_of(labelled, begin, plan)}.pt"
    begun = network_in(begin)
    samples = cached(learnt, work)
    network = train([Source(samples, 1.0)], plan, checkpoint, begun, progress, stop=stop).eval()
    network, min_score, scaled = finished(network, kept)
    if stop():
        raise KeyboardInterrupt
    about = {
        "begun_with": begin.name,
        "pictures": len(labelled),
        "batches": batches,
        "seed": seed,
        "calibration": asdict(scaled),
    }
    with whole_file(output) as partial:
        write_network(partial, network, min_score, about, usual_px=_usual_px(samples))
        before, after = _precisions(begin, kept), _precisions(partial, kept)
    if after < before:
        message = f"{output}: finds less than what it began with, AP50 {after:.3f} against {before:.3f} before"
        warnings.warn(f"{message}: more pictures may help", PomonaWarning, stacklevel=2)
    fruits = sum(len(each.boxes_px) for each in labelled)
    return Trained(len(labelled), fruits, before, after, min_score, scaled)


def _usual_px(learnt: Sequence[Sample]) -> float:
    """Return the median side of the fruits; of smaller ones that of the shipped network's, which knows those too."""
    boxes_px = np.concatenate([each.labelled.boxes_px for each in learnt])
    return max(USUAL_PX, float(np.median(np.sqrt(areas(boxes_px)))) if len(boxes_px) else 0.0)


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
