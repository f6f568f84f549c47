"""Train the shipped detector; an interrupted run goes on, a finished one is exported by `python -m training.ship`."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import cv2
import torch

from pomona.detect.shipped import EXACT, model_named
from pomona.detect.training.cache import cached
from pomona.detect.training.loop import Plan, Source, first_pictures, train
from training import WIDE
from training.begun import as_in_training
from training.sources import TEST_ROWS, VALIDATION_ROWS, photographs, rendered

RENDERED_SHARE = 0.45
"""Of the pictures that are drawn, where there are rendered ones."""


def main() -> None:
    """Run the recipe."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with orchard_photos/")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the run")
    parser.add_argument("--rendered", type=Path, nargs="*", default=[], help="recordings of `pomona synth video`")
    parser.add_argument("--batches", type=int, default=Plan.batches)
    parser.add_argument("--device", default=Plan.device, help="cpu or cuda")
    parser.add_argument("--batch", type=int, default=Plan.batch, help="crops in one")
    parser.add_argument("--rate", type=float, default=Plan.rate)
    parser.add_argument("--falling", type=float, default=Plan.falling, help="share of the batches in which it falls")
    parser.add_argument("--seed", type=int, default=Plan.seed)
    parser.add_argument("--go-on", action="store_true", help="begin with the shipped network and its teacher")
    parser.add_argument("--teacher", type=int, default=Plan.teacher, help="times the channels of one to learn from")
    parser.add_argument("--workers", type=int, default=0, help="processes that draw crops")
    given = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)  # the workers are forked, and would wait for threads that they do not have
    torch.backends.cudnn.benchmark = True  # crops are all of one size
    given.output.mkdir(parents=True, exist_ok=True)
    begun_s = time.monotonic()

    def tell(done: int, loss: float) -> None:
        if done % 20 == 0:
            print(f"{done} of {given.batches} batches, loss {loss:.3f}, {time.monotonic() - begun_s:.0f} s", flush=True)

    sources = _sources(given.data, given.rendered, given.output / "cache")
    plan = Plan(
        batches=given.batches,
        batch=given.batch,
        rate=given.rate,
        falling=given.falling,
        seed=given.seed,
        device=given.device,
        teacher=given.teacher,
    )
    begin, teacher = None, None
    if given.go_on:
        pictures = first_pictures(sources, Plan(seed=given.seed))
        begin, teacher = (as_in_training(model, pictures) for model in (model_named(EXACT), WIDE))
    checkpoint = given.output / "checkpoint.pt"
    train(sources, plan, checkpoint, begin, tell, teacher=teacher, workers=given.workers)


def _sources(data: Path, recordings: list[Path], cache: Path) -> list[Source]:
    held_out = TEST_ROWS + VALIDATION_ROWS
    apples = [
        labelled
        for kind in ("apple_76", "apple_81")
        for labelled in photographs(data / "orchard_photos", kind, but=held_out)
    ]
    sources = [Source(cached(apples, cache), 1.0)]
    if recordings:
        drawn = [labelled for recording in recordings for labelled in rendered(recording)]
        share = RENDERED_SHARE / (1 - RENDERED_SHARE)
        sources.append(Source(cached(drawn, cache), share))
    return sources


if __name__ == "__main__":
    main()
