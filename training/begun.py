"""The shipped networks as they were in training: to go on from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnx
import torch

from pomona.detect.training.cache import Sample
from pomona.detect.training.fruit_network import FruitNetwork, unfolded
from pomona.detect.training.graph import network_in
from pomona.detect.training.score_scaling import Scaling, scaled_network
from pomona.detect.training.shown_crops import drawn_crop
from pomona.likes import MODEL_MARK

__all__ = ["as_in_training"]

SHOWN = 32
"""Crops whose statistics the normalisations begin with."""


def as_in_training(model: Path, samples: Sequence[Sample]) -> FruitNetwork:
    """Give the network of a shipped model with its logits unscaled and its convolutions normalised."""
    told = {each.key: each.value for each in onnx.load(model).metadata_props}
    scaling = Scaling(**json.loads(told[MODEL_MARK.decode()])["calibration"])
    network = scaled_network(network_in(model), Scaling(1 / scaling.slope, -scaling.offset / scaling.slope))
    draw = np.random.default_rng(0)
    crops = [drawn_crop([samples[int(draw.integers(len(samples)))] for _ in range(4)], draw) for _ in range(SHOWN)]
    pictures = torch.from_numpy(np.stack([crop.pixels[:, :, ::-1] for crop in crops]))
    return unfolded(network, pictures.permute(0, 3, 1, 2).float() / 255)
