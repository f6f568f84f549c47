"""What is odd about diameters by hand beside those of a map: another measure, another unit, other fruits."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from math import log, pi
from statistics import median

import numpy as np

from pomona.growth.caliper_pairs import CaliperPair

__all__ = ["doubts_of"]

LIKE = 1.5
"""Times that diameters are those by hand, or the other way round, from which on it is told: cameras err by a tenth."""

MEANT = {
    2.0: "are those by hand radii?",
    0.5: "are those of the map radii, or is a day wrong?",
    1.0 / pi: "are those by hand girths?",
}
"""What makes diameters of the map as many times those by hand."""

NEAR = 0.15
"""Part by which the times may be off."""

ENOUGH, TOGETHER = 20, 0.2
"""Pairs, and their correlation within visits, below which sizes are those of other fruits: a camera that errs by twice
as much as fruits differ has .45."""


def doubts_of(pairs: Sequence[CaliperPair]) -> Iterator[str]:
    """Say in a line each what is odd about pairs of diameters."""
    times = median(pair.measured_mm / pair.caliper_mm for pair in pairs)
    if not 1.0 / LIKE < times < LIKE:
        unit = "is a unit wrong? Say it in the name of the column, diameter_mm, diameter_cm or diameter_m"
        why = next((why for meant, why in MEANT.items() if abs(log(times / meant)) < NEAR), unit)
        yield f"diameters of the map are {times:.3g} times those by hand: {why}"
    elif len(pairs) >= ENOUGH and (together := _correlation(pairs)) < TOGETHER:
        yield (
            f"diameters of the map and by hand do not go together (correlation {together:.2f} of {len(pairs)} pairs): "
            "are the names those of other fruits?"
        )


def _correlation(pairs: Sequence[CaliperPair]) -> float:
    """Correlate how diameters differ from the mean of their visit; 1 where those by hand are all the same."""
    visits: dict[str, list[CaliperPair]] = defaultdict(list)
    for pair in pairs:
        visits[pair.session].append(pair)
    sizes = [np.array([(one.measured_mm, one.caliper_mm) for one in visit]) for visit in visits.values()]
    off = np.concatenate([of_visit - of_visit.mean(axis=0) for of_visit in sizes])
    sums = off.T @ off
    norm = float(np.sqrt(sums[0, 0] * sums[1, 1]))
    return float(sums[0, 1] / norm) if norm > 0 else 1.0
