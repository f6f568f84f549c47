"""The training: seeded, and gone on with where it was interrupted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import cv2
import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from pomona.atomic import whole_file
from pomona.detect.training.cache import Sample
from pomona.detect.training.fruit_network import WIDTHS, FruitNetwork
from pomona.detect.training.learner import Learner
from pomona.detect.training.loss import loss_of, unlike_teacher
from pomona.detect.training.shown_crops import drawn_crop
from pomona.detect.training.targets import Targets, targets_of
from pomona.errors import PomonaError

__all__ = ["Plan", "Source", "Stop", "first_pictures", "means_of", "train"]

SAVED_EVERY = 200
"""Batches between two checkpoints: that is what a power failure costs at most."""


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
        bfloat16 where it helps: on graphics cards and processors that calculate with it. Others take ten times as long.
    device : str
        As PyTorch names it: cpu, cuda.
    teacher : int
        Times the channels of a second network that learns from the same crops, and from whose mean the first one
        learns too; 0 for none.
    """

    batches: int = 13000
    batch: int = 32
    rate: float = 3e-3
    warm_up: int = 300
    falling: float = 0.5
    seed: int = 1
    half_precision: bool = True
    device: str = "cpu"
    teacher: int = 0

    def rate_at(self, number: int) -> float:
        """Give the rate of a batch."""
        left = (self.batches - number) / max(self.falling * self.batches, 1)
        return self.rate * min((number + 1) / self.warm_up, 1.0, left)


Progress = Callable[[int, float], None]
"""Told the batches that are done and the mean loss of late."""

Stop = Callable[[], bool]
"""Asked after each batch whether to end."""


@dataclass(eq=False)
class _State:
    learner: Learner
    teacher: Learner | None
    done: int = 0
    loss: float = float("nan")


def train(
    sources: Sequence[Source],
    plan: Plan,
    checkpoint: Path,
    begin: FruitNetwork | None,
    progress: Progress,
    *,
    teacher: FruitNetwork | None = None,
    workers: int = 0,
    stop: Stop = lambda: False,
) -> FruitNetwork:
    """Train a network, going on from a checkpoint that is there.

    Parameters
    ----------
    sources : sequence of Source
    plan : Plan
        Each batch is drawn by the seed and its number alone, so an interruption changes nothing.
    checkpoint : Path
        Written every `SAVED_EVERY` batches, at the end, and where it is stopped.
    begin : FruitNetwork or None
        What to begin with, None for numbers drawn by the seed.
    progress : callable
    teacher : FruitNetwork or None
        What a teacher begins with; None for one that the plan asks for, if it does.
    workers : int
        Processes that draw crops meanwhile; 0 for none besides this one.
    stop : callable

    Returns
    -------
    FruitNetwork
        The mean of its weights over the last batches.

    Raises
    ------
    PomonaError
        The checkpoint is none, or damaged.
    KeyboardInterrupt
        It was stopped; all batches that are done are in the checkpoint.
    """
    torch.manual_seed(plan.seed)
    learner = Learner.begun(FruitNetwork() if begin is None else begin, plan.device)
    if teacher is None and plan.teacher:
        teacher = FruitNetwork(wider=plan.teacher)
    state = _State(learner, None if teacher is None else Learner.begun(teacher, plan.device))
    if checkpoint.is_file():
        _restore(state, checkpoint)
    for pictures, wanted in _batches(sources, plan, state.done, workers):
        _step(state, pictures, wanted, plan)
        progress(state.done, state.loss)
        stopped = stop()
        if stopped or state.done % SAVED_EVERY == 0 or state.done == plan.batches:
            _save(state, checkpoint)
        if stopped:
            raise KeyboardInterrupt
    return state.learner.mean.cpu()


def _step(state: _State, pictures: torch.Tensor, wanted: dict[str, torch.Tensor], plan: Plan) -> None:
    rate, told = plan.rate_at(state.done), None
    with torch.autocast(pictures.device.type, torch.bfloat16, enabled=_halved(plan)):
        maps = state.learner.network(pictures).float()
        if state.teacher is not None:
            taught = state.teacher.network(pictures).float()
            with torch.no_grad():
                told = state.teacher.mean(pictures).float()
    loss = loss_of(maps, wanted)
    state.learner.follow(loss if told is None else loss + unlike_teacher(maps, told, wanted), rate, state.done)
    if state.teacher is not None:
        state.teacher.follow(loss_of(taught, wanted), rate, state.done)
    state.done += 1
    late = loss.item()
    state.loss = late if np.isnan(state.loss) else 0.98 * state.loss + 0.02 * late


def _halved(plan: Plan) -> bool:
    told = getattr(torch.cpu, "_is_avx512_bf16_supported", None)  # torch has no public name for it
    return plan.half_precision and (plan.device != "cpu" or (told is not None and told()))


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


def first_pictures(sources: Sequence[Source], plan: Plan) -> torch.Tensor:
    """Give the pictures of the first batch of a plan, (N, 3, S, S), RGB from 0 to 1."""
    pictures, _ = next(_batches(sources, plan, 0, workers=0))
    return pictures


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
    content: dict[str, Any] = {**state.learner.state(), "done": state.done, "loss": state.loss}
    if state.teacher is not None:
        content["teacher"] = state.teacher.state()
    with whole_file(checkpoint) as partial:
        torch.save(content, partial)


def _restore(state: _State, checkpoint: Path) -> None:
    try:
        content = torch.load(checkpoint, map_location="cpu", weights_only=True)
        state.learner.restore(content)
        if state.teacher is not None:
            state.teacher.restore(content["teacher"])
        state.done, state.loss = int(content["done"]), float(content["loss"])
    except _DAMAGED:
        raise PomonaError(
            f"{checkpoint}: found no state of this training, cut off or overwritten; expected what it kept there: "
            "remove the file, and the training begins anew"
        ) from None


_DAMAGED = (OSError, EOFError, RuntimeError, UnpicklingError, ValueError, TypeError, LookupError, AttributeError)
"""What PyTorch raises for files that are none of its own or not whole, and for those of other networks."""


def means_of(checkpoint: Path) -> tuple[FruitNetwork, FruitNetwork | None, int]:
    """Give the mean network of a checkpoint, that of its teacher, None where it had none, and the batches they saw."""
    content = torch.load(checkpoint, map_location="cpu", weights_only=True)
    teacher = content.get("teacher")
    return _holding(content["mean"]), None if teacher is None else _holding(teacher["mean"]), content["done"]


def _holding(weights: dict[str, torch.Tensor]) -> FruitNetwork:
    network = FruitNetwork(wider=weights["stem.0.0.weight"].shape[0] // WIDTHS[0])
    network.load_state_dict(weights)
    return network.eval()
