"""What `pomona metric` and `pomona triangulate` show."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pomona.amounts import amount
from pomona.cli.progress import counting

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pomona.detect.opening import FoundBoxes
    from pomona.free_scale import Upgrade
    from pomona.triangulation.model_recording import ModelRecording
    from pomona.triangulation.seen_fruits import FruitsOfModel


def looked_at(recording: ModelRecording, boxes: FoundBoxes) -> FruitsOfModel:
    """Find the fruits, and show how far it is on a terminal."""
    from pomona.triangulation.seen_fruits import fruits_of_model

    with counting("looking", len(recording)) as progress:
        return fruits_of_model(recording, boxes, progress)


def as_lines(output: Path, seen: FruitsOfModel, upgrade: Upgrade) -> Iterator[str]:
    """Say in words what was found."""
    yield of_fruits(seen)
    yield of_scale(upgrade)
    if upgrade:
        yield f"{output}: written in the frame of the map, metres"


def of_session(output: Path, seen: FruitsOfModel, upgrade: Upgrade | None) -> Iterator[str]:
    """Say in words what was written."""
    yield of_fruits(seen)
    if upgrade is None:
        yield f"{output}: written without a scale, in units of the model; no map takes it"
    else:
        yield of_scale(upgrade)
        if upgrade:
            yield f"{output}: written in the frame of the map, metres"


def of_fruits(seen: FruitsOfModel) -> str:
    """Say how many fruits were found."""
    skipped = f", {amount(seen.n_skipped, 'picture')} skipped: cannot be read" if seen.n_skipped else ""
    boxes = f"{seen.n_used} of {amount(seen.n_boxes, 'box')}"
    return f"{amount(len(seen.cloud), 'fruit')} triangulated from {boxes}{skipped}"


def of_scale(upgrade: Upgrade) -> str:
    """Say the scale with its uncertainty, or that there is none."""
    match, found = upgrade.match, upgrade.scaling
    if found is None:
        few = f": {amount(len(match.pairs), 'pair')} do not say how sure the scale is" if match else ""
        return f"{match.status}{few}: {amount(match.n_query, 'fruit')}, {match.n_map} in the map"
    sure = f"+- {100 * found.sigma / found.scale:.2f} %, 90 % between {found.low:.6g} and {found.high:.6g}"
    return f"{match.status}: {found.scale:.6g} metres a unit ({sure}), by {amount(found.n_pairs, 'fruit')}"
