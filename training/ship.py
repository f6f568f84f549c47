"""Write the models of a run: calibrated on rows that were not trained on, in 32 and in 8 bits, and its teacher in 8."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.detect.onnx.preparation import Preparation, prepare
from pomona.detect.picture_file import read_picture
from pomona.detect.shipped import EXACT, SHIPPED, model_named
from pomona.detect.training.eight_bits import write_eight_bits
from pomona.detect.training.finishing import finished
from pomona.detect.training.fruit_network import FruitNetwork, folded
from pomona.detect.training.graph import write_network
from pomona.detect.training.labels import Labelled
from pomona.detect.training.loop import means_of
from training import WIDE
from training.sources import TEST_ROWS, VALIDATION_ROWS, photographs

DATA = (
    "AppleBBCH76 and AppleBBCH81 (LatHort orchard, Dobele; republished by ai-agriculture-circuits-and-systems, "
    "CC BY 4.0), chosen, scaled and re-encoded; rendered recordings of this project"
)
SHOWN = 64
"""Pictures that show the eight bits what numbers there are."""


def main() -> None:
    """Write the models and say what they were written with."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with orchard_photos/")
    parser.add_argument("run", type=Path, help="folder of the run")
    parser.add_argument("--recipe", default="", help="what the run was begun with and asked for; kept in the models")
    given = parser.parse_args()
    validation = [
        labelled
        for kind in ("apple_76", "apple_81")
        for labelled in photographs(given.data / "orchard_photos", kind, VALIDATION_ROWS)
    ]
    network, teacher, batches = means_of(given.run / "checkpoint.pt")
    run = {"data": DATA, "batches": batches, "recipe": given.recipe}
    _write(network, run, validation, model_named(SHIPPED), model_named(EXACT))
    if teacher is not None:
        WIDE.parent.mkdir(exist_ok=True)
        _write(teacher, run, validation, WIDE)


def _write(
    network: FruitNetwork,
    run: dict[str, object],
    validation: list[Labelled],
    eight_bits: Path,
    halved: Path | None = None,
) -> None:
    network, min_score, scaled = finished(folded(network), validation)
    about = run | {
        "rows_held_out": {"test": TEST_ROWS, "validation": VALIDATION_ROWS},
        "calibration": {"slope": scaled.slope, "offset": scaled.offset},
    }
    with tempfile.TemporaryDirectory() as folder:
        exact = Path(folder) / "exact.onnx"
        write_network(exact, network, min_score, about)
        write_eight_bits(eight_bits, exact, _prepared(validation))
    if halved is not None:
        write_network(halved, network, min_score, about, halved=True)
    print(f"{eight_bits.name}: {run['batches']} batches, {scaled}, least score {min_score:.3f}")


def _prepared(pictures: list[Labelled]) -> Iterator[NDArray[np.float32]]:
    for labelled in pictures[:: max(len(pictures) // SHOWN, 1)]:
        pixels = read_picture(labelled.picture)
        given, _ = prepare(pixels, (pixels.shape[1], pixels.shape[0]), Preparation(fit="inside"))
        yield given[None]


if __name__ == "__main__":
    main()
