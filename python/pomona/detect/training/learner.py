"""A network that learns: its weights, their mean of late, and what moves them."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import torch

from pomona.detect.training.fruit_network import FruitNetwork

__all__ = ["Learner"]

KEPT = 0.998
"""Of the mean of the weights, from one batch to the next; at the beginning less."""

CLIPPED = 10.0
"""Norm of a gradient, at most."""

DECAY = 0.02
"""Of weights that are multiplied with something, times the rate."""


@dataclass(eq=False)
class Learner:
    """A network in training.

    Attributes
    ----------
    network : FruitNetwork
        As the last batch left it.
    mean : FruitNetwork
        The mean of its weights over the last batches: what is used in the end.
    optimiser : torch.optim.Optimizer
    """

    network: FruitNetwork
    mean: FruitNetwork
    optimiser: torch.optim.Optimizer

    @classmethod
    def begun(cls, network: FruitNetwork, device: str) -> Learner:
        """Begin with a network, on a device."""
        network = network.to(device, memory_format=torch.channels_last)
        bent = [weights for weights in network.parameters() if weights.ndim > 1]
        plain = [weights for weights in network.parameters() if weights.ndim == 1]
        groups = [{"params": bent, "weight_decay": DECAY}, {"params": plain, "weight_decay": 0.0}]
        return cls(network.train(), copy.deepcopy(network).eval(), torch.optim.AdamW(groups))

    def follow(self, loss: torch.Tensor, rate: float, done: int) -> None:
        """Take the step that a loss asks for, after `done` others."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), CLIPPED)
        self.optimiser.step()
        self._average(min(KEPT, (done + 1) / (done + 11)))

    @torch.no_grad()
    def _average(self, kept: float) -> None:
        pairs = zip(self.mean.state_dict().values(), self.network.state_dict().values(), strict=True)
        moving = [pair for pair in pairs if pair[0].is_floating_point()]  # the others count batches
        ours, theirs = zip(*moving, strict=True)
        torch._foreach_lerp_(ours, theirs, 1 - kept)

    def state(self) -> dict[str, Any]:
        """Give what a checkpoint keeps."""
        return {name: getattr(self, name).state_dict() for name in ("network", "mean", "optimiser")}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from what `state` gave."""
        for name in ("network", "mean", "optimiser"):
            getattr(self, name).load_state_dict(state[name])
