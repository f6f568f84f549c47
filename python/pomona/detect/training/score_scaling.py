"""Scores that are probabilities, and the least score that makes counts right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from pomona.detect.accuracy import Judged
from pomona.detect.training.fruit_network import FruitNetwork

__all__ = ["Scaling", "fitted_scaling", "scaled_network"]

LEAST = 1e-6
"""Scores nearer to 0 or 1 have no logit worth a name."""


@dataclass(frozen=True)
class Scaling:
    """What Platt's scaling does to a logit: slope * logit + offset."""

    slope: float
    offset: float


def fitted_scaling(found: Judged) -> Scaling:
    """Fit the logits of boxes to whether they are right, by maximum likelihood (Platt 1999).

    Each side is counted as if there were one more of either, so that a perfect detector is not sure of itself.
    """
    from scipy.optimize import minimize

    scores = np.clip(found.scores, LEAST, 1 - LEAST)
    logits, right = np.log(scores / (1 - scores)), found.right
    n_right, n_wrong = int(right.sum()), int((~right).sum())
    wanted = np.where(right, (n_right + 1) / (n_right + 2), 1 / (n_wrong + 2))

    def loss(at: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
        fitted = np.exp(at[0]) * logits + at[1]
        return float((np.logaddexp(0, fitted) - wanted * fitted).mean())

    slope, offset = minimize(loss, np.zeros(2), method="Nelder-Mead").x
    return Scaling(float(np.exp(slope)), float(offset))


@torch.no_grad()
def scaled_network(network: FruitNetwork, scaling: Scaling) -> FruitNetwork:
    """Give a network whose logits of centres are scaled: no decoder needs to know of it."""
    made = FruitNetwork(normalised=False, wider=network.wider).eval()
    made.load_state_dict(network.state_dict())
    made.map.weight[0] *= scaling.slope
    made.map.bias[0] = made.map.bias[0] * scaling.slope + scaling.offset
    return made
