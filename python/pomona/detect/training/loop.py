"""The training: seeded, and gone on with where it was interrupted."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from pomona.atomic import whole_file
from pomona.detect.training.cache import Sample
from pomona.detect.training.fruit_network import FruitNetwork
from pomona.detect.training.loss import loss_of
from pomona.detect.training.shown_crops import drawn_crop
from pomona.detect.training.targets import Targets, targets_of

__all__ = ["Plan", "Source", "mean_of", "train"]

SAVED_EVERY = 25
"""Batches between two checkpoints: that is what an interruption costs at most."""

KEPT = 0.998
"""Of the mean of the weights, from one batch to the next; at the beginning less."""

CLIPPED = 10.0
"""Norm of a gradient, at most."""


@dataclass(frozen=True, eq=False)
class Source:
    """Pictures that are drawn with one chance.

    Attributes
    ----------
    samples : sequence of Sample
    share : float
        Of all pictures that are drawn, against the shares of the other sources.
    """

    samples: Sequence[Sample]
    share: float


@dataclass(frozen=True)
class Plan:
    """How long and how fast.

    Attributes
    ----------
    batches, batch : int
        How many, and crops in one.
    rate : float
        Of learning, at its highest.
    warm_up : int
        Batches in which it rises.
    falling : float
        Share of the batches, the last ones, in which it falls to nothing.
    seed : int
    half_precision : bool
        bfloat16 where it helps: on processors that calculate with it.
    device : str
        As PyTorch names it: cpu, cuda.
    """

    batches: int = 13000
    batch: int = 32
    rate: float = 3e-3
    warm_up: int = 300
    falling: float = 0.5
    seed: int = 1
    half_precision: bool = True
    device: str = "cpu"

    def rate_at(self, number: int) -> float:
        """Give the rate of a batch."""
        left = (self.batches - number) / max(self.falling * self.batches, 1)
        return self.rate * min((number + 1) / self.warm_up, 1.0, left)


Progress = Callable[[int, float], None]
"""Told the batches that are done and the mean loss of late."""


@dataclass(eq=False)
class _State:
    network: FruitNetwork
    mean: FruitNetwork
    optimiser: torch.optim.Optimizer
    done: int = 0
    loss: float = float("nan")


def train(
    sources: Sequence[Source],
    plan: Plan,
    checkpoint: Path,
    begin: FruitNetwork | None,
    progress: Progress,
    *,
    workers: int = 0,
) -> FruitNetwork:
    """Train a network, going on from a checkpoint that is there.

    Parameters
    ----------
    sources : sequence of Source
    plan : Plan
        Each batch is drawn by the seed and its number alone, so an interruption changes nothing.
    checkpoint : Path
        Written every `SAVED_EVERY` batches, and at the end.
    begin : FruitNetwork or None
        What to begin with, None for numbers drawn by the seed.
    progress : callable
    workers : int
        Processes that draw crops meanwhile; 0 for none besides this one.

    Returns
    -------
    FruitNetwork
        The mean of its weights over the last batches.
    """
    torch.manual_seed(plan.seed)
    state = _begun(FruitNetwork() if begin is None else begin, plan)
    if checkpoint.is_file():
        _restore(state, checkpoint)
    for pictures, wanted in _batches(sources, plan, state.done, workers):
        _step(state, pictures, wanted, plan)
        progress(state.done, state.loss)
        if state.done % SAVED_EVERY == 0 or state.done == plan.batches:
            _save(state, checkpoint)
    return state.mean.cpu()


def _begun(network: FruitNetwork, plan: Plan) -> _State:
    network = network.to(plan.device, memory_format=torch.channels_last)
    bent = [weights for weights in network.parameters() if weights.ndim > 1]
    plain = [weights for weights in network.parameters() if weights.ndim == 1]
    groups = [{"params": bent, "weight_decay": 0.02}, {"params": plain, "weight_decay": 0.0}]
    return _State(network, copy.deepcopy(network), torch.optim.AdamW(groups, lr=plan.rate))


def _step(state: _State, pictures: torch.Tensor, wanted: dict[str, torch.Tensor], plan: Plan) -> None:
    for group in state.optimiser.param_groups:
        group["lr"] = plan.rate_at(state.done)
    state.network.train()
    with torch.autocast(pictures.device.type, torch.bfloat16, enabled=plan.half_precision):
        maps = state.network(pictures)
    loss = loss_of(maps.float(), wanted)
    state.optimiser.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(state.network.parameters(), CLIPPED)
    state.optimiser.step()
    state.done += 1
    _follow(state.mean, state.network, min(KEPT, state.done / (state.done + 10)))
    late = loss.item()
    state.loss = late if np.isnan(state.loss) else 0.98 * state.loss + 0.02 * late


@torch.no_grad()
def _follow(mean: FruitNetwork, network: FruitNetwork, kept: float) -> None:
    for ours, theirs in zip(mean.state_dict().values(), network.state_dict().values(), strict=True):
        if ours.is_floating_point():
            ours.lerp_(theirs, 1 - kept)
        else:
            ours.copy_(theirs)


_Batch = tuple[torch.Tensor, dict[str, torch.Tensor]]
"""Pictures and what is wanted of them."""


def _batches(sources: Sequence[Source], plan: Plan, first: int, workers: int) -> Iterator[_Batch]:
    """Give the batches from number `first` on, on the plan's device: pictures (N, 3, S, S), RGB from 0 to 1."""
    drawn = DataLoader(
        _Drawn(sources, plan),
        batch_size=None,
        sampler=range(first, plan.batches),
        num_workers=workers,
        worker_init_fn=_alone,
        pin_memory=plan.device != "cpu",
    )
    for pictures, wanted in drawn:
        moved = {name: target.to(plan.device, non_blocking=True) for name, target in wanted.items()}
        yield pictures.to(plan.device, non_blocking=True).permute(0, 3, 1, 2).float() / 255, moved


def _alone(_worker: int) -> None:
    cv2.setNumThreads(1)


class _Drawn(Dataset[_Batch]):
    """Batches by their numbers: pictures (N, S, S, 3) uint8 RGB."""

    def __init__(self, sources: Sequence[Source], plan: Plan) -> None:
        self.sources, self.plan = sources, plan

    def __getitem__(self, number: int) -> _Batch:
        draw = np.random.default_rng([self.plan.seed, number])
        crops = [drawn_crop(_drawn(self.sources, draw), draw) for _ in range(self.plan.batch)]
        targets = [targets_of(crop) for crop in crops]
        wanted = {
            each.name: torch.from_numpy(np.stack([getattr(target, each.name) for target in targets]))
            for each in fields(Targets)
        }
        return torch.from_numpy(np.stack([crop.pixels[:, :, ::-1] for crop in crops])), wanted


def _drawn(sources: Sequence[Source], draw: np.random.Generator) -> list[Sample]:
    """Draw four pictures of one source: pictures drawn and photographed are not mixed in one crop."""
    shares = np.array([source.share for source in sources])
    samples = sources[int(draw.choice(len(sources), p=shares / shares.sum()))].samples
    return [samples[int(draw.integers(len(samples)))] for _ in range(4)]


def _save(state: _State, checkpoint: Path) -> None:
    content: dict[str, Any] = {
        "network": state.network.state_dict(),
        "mean": state.mean.state_dict(),
        "optimiser": state.optimiser.state_dict(),
        "done": state.done,
        "loss": state.loss,
    }
    with whole_file(checkpoint) as partial:
        torch.save(content, partial)


def _restore(state: _State, checkpoint: Path) -> None:
    content = torch.load(checkpoint, map_location="cpu", weights_only=True)
    state.network.load_state_dict(content["network"])
    state.mean.load_state_dict(content["mean"])
    state.optimiser.load_state_dict(content["optimiser"])
    state.done, state.loss = content["done"], content["loss"]


def mean_of(checkpoint: Path) -> tuple[FruitNetwork, int]:
    """Give the mean network of a checkpoint, and how many batches it has seen."""
    content = torch.load(checkpoint, map_location="cpu", weights_only=True)
    mean = FruitNetwork()
    mean.load_state_dict(content["mean"])
    return mean.eval(), content["done"]
