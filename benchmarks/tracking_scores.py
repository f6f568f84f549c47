"""How well boxes were told apart: counts, splits, and the usual scores of multi-object tracking.

A run is two lists, one entry a frame: the true name of each box ("" for one that shows no fruit) and the track that it
was given (-1 for none). Boxes are the same on both sides, so a box matches itself alone.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MIN_VIEWS = 5

Names = list[tuple[str, ...]]
Numbers = list[NDArray[np.int64]]


@dataclass(frozen=True)
class Count:
    """Fruits against tracks of at least `MIN_VIEWS` boxes.

    Attributes
    ----------
    true : int
        Fruits with boxes in that many frames.
    reported : int
        Tracks with that many boxes.
    split : int
        Tracks too many on one fruit: of the reported ones, those whose fruit has another one.
    false : int
        Tracks most of whose boxes show no fruit.
    """

    true: int
    reported: int
    split: int
    false: int

    @property
    def error(self) -> float:
        """Reported over true, less 1."""
        return self.reported / self.true - 1.0


def count(names: Names, numbers: Numbers) -> Count:
    """Count fruits and tracks that enough frames saw."""
    views = Counter(name for frame in names for name in frame if name)
    held: dict[int, Counter[str]] = defaultdict(Counter)
    for frame, told in zip(names, numbers, strict=True):
        for name, number in zip(frame, told.tolist(), strict=True):
            if number >= 0:
                held[number][name] += 1
    mains = Counter(of.most_common(1)[0][0] for of in held.values() if of.total() >= MIN_VIEWS)
    false = mains.pop("", 0)
    return Count(
        true=sum(seen >= MIN_VIEWS for seen in views.values()),
        reported=mains.total() + false,
        split=mains.total() - len(mains),
        false=false,
    )


def mot_scores(names: Names, numbers: Numbers) -> dict[str, float]:
    """MOTA, IDF1, HOTA and identity switches over all boxes, as TrackEval computes them."""
    from trackeval.metrics import CLEAR, HOTA, Identity

    sequence = _sequence(names, numbers)
    quiet = {"PRINT_CONFIG": False}
    clear = CLEAR(quiet).eval_sequence(sequence)
    return {
        "mota": float(clear["MOTA"]),
        "hota": float(np.mean(HOTA().eval_sequence(sequence)["HOTA"])),
        "idf1": float(Identity(quiet).eval_sequence(sequence)["IDF1"]),
        "switches": int(clear["IDSW"]),
    }


def often(names: Names, numbers: Numbers) -> tuple[Names, Numbers]:
    """Leave out the fruits and the tracks that too few frames saw."""
    views = Counter(name for frame in names for name in frame if name)
    boxes = Counter(number for told in numbers for number in told.tolist())
    kept_names = [tuple(name if views[name] >= MIN_VIEWS else "" for name in frame) for frame in names]
    kept_numbers = [np.where([boxes[number] >= MIN_VIEWS for number in told.tolist()], told, -1) for told in numbers]
    return kept_names, kept_numbers


def _sequence(names: Names, numbers: Numbers) -> dict[str, object]:
    row_of_name = {name: row for row, name in enumerate(sorted({name for frame in names for name in frame if name}))}
    row_of_number = {
        number: row for row, number in enumerate(sorted({int(n) for told in numbers for n in told if n >= 0}))
    }
    true, found, same = [], [], []
    for frame, told in zip(names, numbers, strict=True):
        true_boxes = [box for box, name in enumerate(frame) if name]
        found_boxes = [box for box, number in enumerate(told.tolist()) if number >= 0]
        true.append(np.array([row_of_name[frame[box]] for box in true_boxes], int))
        found.append(np.array([row_of_number[int(told[box])] for box in found_boxes], int))
        same.append(np.equal.outer(true_boxes, found_boxes).astype(float).reshape(len(true_boxes), len(found_boxes)))
    return {
        "num_timesteps": len(names),
        "num_gt_ids": len(row_of_name),
        "num_tracker_ids": len(row_of_number),
        "num_gt_dets": sum(map(len, true)),
        "num_tracker_dets": sum(map(len, found)),
        "gt_ids": true,
        "tracker_ids": found,
        "similarity_scores": same,
    }
