"""A stretch of a recording with one frame of reference: what its frames saw becomes fruits, each once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.survey.motion import Camera
from pomona.survey.seeing import Look
from pomona.survey.sightings import Sightings, fruits_of
from pomona.trajectory import Trajectory

__all__ = ["Boxes", "OpenPart", "Part"]


@dataclass(frozen=True, eq=False)
class Boxes:
    """Every box of a part and the fruit in it, one row a box, in order of time.

    Attributes
    ----------
    frames : (B,) int64
        Frame number.
    boxes_px : (B, 4) float64
        xmin, ymin, xmax, ymax.
    scores : (B,) float64
        Confidence, 0 to 1.
    fruits : (B,) int64
        Row of the fruit in the part's cloud, -1 where the box is of none.
    """

    frames: NDArray[np.int64]
    boxes_px: NDArray[np.float64]
    scores: NDArray[np.float64]
    fruits: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Part:
    """Fruits of a stretch of the recording.

    Attributes
    ----------
    cloud : FruitCloud
        Every fruit once, in the part's frame of reference. `extras` has `diameter_sigma_m`, the standard deviation of
        the diameter in metres, and, of a recording with colour, `colour` as #rrggbb.
    trajectory : Trajectory
        Poses of the left camera.
    boxes : Boxes
        Which box is which fruit.
    began : str or None
        Why the part before it ended; None of the first.
    """

    cloud: FruitCloud
    trajectory: Trajectory
    boxes: Boxes
    began: str | None = None


class OpenPart:
    """A part that still grows, frame by frame.

    Parameters
    ----------
    number : int
        Which part of the recording.
    began : str or None
        Why it began.
    """

    def __init__(self, number: int, began: str | None) -> None:
        self._number, self._began = number, began
        self._looks: list[Look] = []
        self._times_s: list[float] = []
        self._seen: Counter[str] = Counter()

    def add(self, look: Look, time_s: float) -> None:
        """Take the next frame."""
        self._looks.append(look)
        self._times_s.append(time_s)
        self._seen.update(look.detections.ids or ())

    def __len__(self) -> int:
        return len(self._looks)

    @property
    def n_fruits(self) -> int:
        """How many fruits there are so far, near enough to show while the work goes on."""
        return len(self._seen)

    def closed(self, camera: Camera) -> Part:
        """Make the fruits of all the frames."""
        frames = [look.frame for look in self._looks]
        sightings = Sightings.of(self._looks)
        owners, names = self._owners()
        session_from_camera = camera.refined(self._number, frames, sightings, owners[sightings.boxes])
        row_of, named = _measured(owners, sightings, names)
        measured = np.flatnonzero(owners[sightings.boxes] >= 0)
        fruits = row_of[owners[sightings.boxes[measured]]]
        cloud = fruits_of(sightings.select(measured), fruits, self._looks, session_from_camera, named)
        trajectory = Trajectory(np.array(frames, np.int64), np.array(self._times_s), session_from_camera)
        return Part(cloud, trajectory, _boxes(self._looks, row_of[owners]), self._began)

    def _owners(self) -> tuple[NDArray[np.int64], list[str]]:
        """Fruit of each box of the part as a row of the names, -1 for none."""
        # Only a single frame comes without names: there a box is a fruit.
        ids = [name for look in self._looks for name in look.detections.ids or map(str, range(len(look.detections)))]
        row_of = {name: row for row, name in enumerate(dict.fromkeys(ids))}
        return np.array([row_of[name] for name in ids], np.int64), list(row_of)


def _measured(
    owners: NDArray[np.int64], sightings: Sightings, names: Sequence[str]
) -> tuple[NDArray[np.int64], list[str]]:
    """Count off the fruits that have a place in 3D, in the order in which they were first seen.

    Returns
    -------
    row_of : (N + 1,) int64
        New row of each old one, -1 of a fruit never measured; the last is for boxes of no fruit.
    names : list of str
        Names in the new order.
    """
    fruits = owners[sightings.boxes]
    found, first = np.unique(fruits[fruits >= 0], return_index=True)
    found = found[np.argsort(first, kind="stable")]
    row_of = np.full(len(names) + 1, -1, np.int64)
    row_of[found] = np.arange(len(found))
    return row_of, [names[row] for row in found]


def _boxes(looks: Sequence[Look], fruits: NDArray[np.int64]) -> Boxes:
    return Boxes(
        frames=np.repeat([look.frame for look in looks], [len(look.detections) for look in looks]).astype(np.int64),
        boxes_px=np.concatenate([np.empty((0, 4)), *(look.detections.boxes_px for look in looks)]),
        scores=np.concatenate([np.empty(0), *(look.detections.scores for look in looks)]),
        fruits=fruits,
    )
