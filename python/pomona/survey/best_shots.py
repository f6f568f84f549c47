"""One small picture of each fruit, cut while the recording is scanned: no frame is read again for it."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.fruit_crop import FruitCrop
from pomona.survey.seeing import Look

__all__ = ["BestShots"]

Picture = NDArray[np.uint8]

CROP_PX = 48
"""Longest side of a crop; one that is smaller in its frame stays as it is."""

AROUND = 1.5
"""Side of a crop over the longer side of the box: what hangs around a fruit tells which one it is."""

WEBP_QUALITY = 70


@dataclass(frozen=True, eq=False)
class _Shot:
    """A fruit in one frame: the row of its box there, what the shot is worth, and the pixels."""

    frame: int
    row: int
    worth: float
    pixels: Picture


class BestShots:
    """The best shot of each track so far; a track costs 7 kB until its crop is encoded."""

    def __init__(self, shots: Mapping[Hashable, _Shot] | None = None) -> None:
        self._best = dict(shots or {})

    def offer(self, look: Look, tracks: Sequence[Hashable | None], picture: Picture) -> None:
        """Take the shots of a frame that are better than those before; `tracks` has that of each box, or None."""
        for row, worth in _worths(look, picture):
            track = tracks[row]
            if track is None:
                continue
            if (known := self._best.get(track)) is None or worth > known.worth:
                self._best[track] = _Shot(look.frame, row, worth, _cut(picture, look.detections.boxes_px[row]))

    def with_those_of(self, other: BestShots) -> BestShots:
        """Give the shots of two parts that became one, whose tracks are numbered apart."""
        parts = enumerate((self, other))
        return BestShots({(part, track): shot for part, shots in parts for track, shot in shots._best.items()})

    def crops(self, frames: NDArray[np.int64], fruits: NDArray[np.int64]) -> dict[int, FruitCrop]:
        """Give the crop of each fruit, by row; `frames` and `fruits` are those of all boxes, -1 for no fruit."""
        first_box = dict(zip(*(column.tolist() for column in np.unique(frames, return_index=True)), strict=True))
        best: dict[int, _Shot] = {}
        for shot in sorted(self._best.values(), key=lambda shot: (-shot.worth, shot.frame, shot.row)):
            best.setdefault(int(fruits[first_box[shot.frame] + shot.row]), shot)
        best.pop(-1, None)
        return {fruit: FruitCrop(shot.frame, _encoded(shot.pixels)) for fruit, shot in sorted(best.items())}


def _worths(look: Look, picture: Picture) -> Iterator[tuple[int, float]]:
    """Give row and worth of each box with a place: how many pixels show the fruit, and how sharp its frame is.

    A fruit near by, in full view, shows most pixels; a shaken frame has weak edges everywhere. Edges of the box alone
    would prefer leaves in front of the fruit.
    """
    import cv2

    if look.fruit_px is None or not len(look.lifted):
        return
    sharpness = float(cv2.meanStdDev(cv2.Laplacian(picture[:, :, 1], cv2.CV_16S))[1].item())
    rows = look.lifted.rows
    shown_px = (1.0 - np.clip(look.lifted.hidden, 0.0, 1.0)) * (1.0 + look.fruit_px[rows])
    yield from zip(rows.tolist(), (sharpness * shown_px).tolist(), strict=True)


def _cut(picture: Picture, box_px: NDArray[np.float64]) -> Picture:
    """Cut a square around a box, moved into the picture where it reaches out."""
    import cv2

    side = min(max(round(AROUND * float((box_px[2:] - box_px[:2]).max())), 1), *picture.shape[:2])
    corner = np.round((box_px[:2] + box_px[2:] - side) / 2).astype(int)
    x, y = np.clip(corner, 0, np.array(picture.shape[1::-1]) - side).tolist()
    cut = picture[y : y + side, x : x + side]
    if side <= CROP_PX:
        return cut.copy()
    return np.asarray(cv2.resize(cut, (CROP_PX, CROP_PX), interpolation=cv2.INTER_AREA), np.uint8)


def _encoded(pixels: Picture) -> bytes:
    import cv2

    done, content = cv2.imencode(".webp", pixels, [cv2.IMWRITE_WEBP_QUALITY, WEBP_QUALITY])
    if not done:
        raise PomonaError("a crop cannot be encoded as WebP by this OpenCV")
    return content.tobytes()
