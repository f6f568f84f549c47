"""The shipped networks as they were in training: to go on from."""

from __future__ import annotations

import json
from pathlib import Path

import onnx
import torch

from pomona.detect.training.fruit_network import FruitNetwork, unfolded
from pomona.detect.training.graph import network_in
from pomona.detect.training.score_scaling import Scaling, scaled_network
from pomona.likes import MODEL_MARK

__all__ = ["as_in_training"]


def as_in_training(model: Path, pictures: torch.Tensor) -> FruitNetwork:
    """Give the network of a shipped model: logits unscaled, convolutions normalised by pictures, (N, 3, H, W)."""
    told = {each.key: each.value for each in onnx.load(model).metadata_props}
    scaling = Scaling(**json.loads(told[MODEL_MARK.decode()])["calibration"])
    network = scaled_network(network_in(model), Scaling(1 / scaling.slope, -scaling.offset / scaling.slope))
    return unfolded(network, pictures)
