"""What a trained network still lacks: scores that are probabilities, and a least score."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from pomona.amounts import amount
from pomona.detect.accuracy import Found, Judged, judged
from pomona.detect.onnx import OnnxDetector
from pomona.detect.picture_file import read_picture
from pomona.detect.training.fruit_network import FruitNetwork
from pomona.detect.training.graph import write_network
from pomona.detect.training.labels import Labelled
from pomona.detect.training.score_scaling import Scaling, fitted_scaling, scaled_network
from pomona.errors import PomonaError

__all__ = ["finished", "judged_on"]

LOW_SCORE = 0.05
"""Boxes below it say nothing about those that count."""


def finished(network: FruitNetwork, validation: Sequence[Labelled]) -> tuple[FruitNetwork, float, Scaling]:
    """Scale a network's scores on pictures that it was not trained on.

    Returns
    -------
    FruitNetwork, float, Scaling
        The network, without normalisations as the one given; the least score with which it counts right on those
        pictures; how its logits were scaled.

    Raises
    ------
    PomonaError
        It finds nothing there.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fruits.onnx"
        write_network(path, network, LOW_SCORE, {})
        scaled = fitted_scaling(_found(path, validation))
        network = scaled_network(network, scaled)
        write_network(path, network, LOW_SCORE, {})
        found = _found(path, validation)
    return network, found.score_of_right_count(), scaled


def _found(model: Path, validation: Sequence[Labelled]) -> Judged:
    found = judged_on(OnnxDetector.open(model), validation)
    if len(found.scores) == 0:
        pictures = amount(len(validation), "picture")
        raise PomonaError(
            f"the trained network finds nothing in the {pictures} kept apart, so its scores cannot be calibrated: "
            "more pictures or more batches may help"
        )
    return found


def judged_on(detector: OnnxDetector, pictures: Iterable[Labelled]) -> Judged:
    """Judge a detector on labelled pictures."""
    return judged(
        Found(detector.detect(read_picture(each.picture)), each.boxes_px, each.ignored_px, each.smallest_px)
        for each in pictures
    )
