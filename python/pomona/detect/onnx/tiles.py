"""Overlapping tiles of a large picture, and the boxes of all tiles as those of one picture.

Neighbouring tiles share a strip. What a fruit shows in that strip both of them see: two boxes are of one fruit when
they agree *inside the strip*, however much of it each tile cuts off.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError

__all__ = ["Tile", "Tiling", "lay_tiles", "merge_tiles", "read_tiling"]

OVERLAP = 0.2
"""Part of a tile that its neighbour sees too; a fruit smaller than that is whole in one of them."""

MAX_SHRINK = 2.0
"""Without a word of the user the picture is cut when the network would see it at less than half its size: then a fruit
of 16 px would be smaller than a cell of the finest grid, 8 px, and one with its neighbour."""

SAME_IOU = 0.5
"""Two boxes of one fruit agree in the strip at least so far; those of neighbours in a cluster do not."""

Tiling = tuple[int, int] | None
"""Columns and rows, None for as many as needed."""


@dataclass(frozen=True)
class Tile:
    """A part of a picture: xmin, ymin, xmax, ymax in whole pixels."""

    xmin: int
    ymin: int
    xmax: int
    ymax: int

    @property
    def corners_px(self) -> tuple[int, int, int, int]:
        """As one tuple."""
        return self.xmin, self.ymin, self.xmax, self.ymax


def read_tiling(text: str) -> Tiling:
    """Read a setting: `auto`, `off` or columns x rows, as 3x2."""
    if text == "auto":
        return None
    sides = re.fullmatch(r"([1-9]\d?)x([1-9]\d?)", "1x1" if text == "off" else text)
    if sides is None:
        raise PomonaError(f"tiles: found {text!r}, expected auto, off, or columns x rows, 1 to 99 each, as 3x2")
    return int(sides[1]), int(sides[2])


def lay_tiles(picture_px: tuple[int, int], network_px: tuple[int, int], tiling: Tiling) -> list[Tile]:
    """Cover a picture with tiles of one size, row by row.

    Parameters
    ----------
    picture_px, network_px : (int, int)
        Width and height of the picture, and of the network's input.
    tiling : (int, int) or None
        Columns and rows; None for as few as keep a tile within `MAX_SHRINK` times the input.
    """
    counts = tiling or tuple(map(_needed, picture_px, network_px))
    columns, rows = (_cuts(length, count) for length, count in zip(picture_px, counts, strict=True))
    return [Tile(xmin, ymin, xmax, ymax) for ymin, ymax in rows for xmin, xmax in columns]


def _needed(length_px: int, input_px: int) -> int:
    count = 1
    while _side(length_px, count) > MAX_SHRINK * input_px:
        count += 1
    return count


def _side(length_px: int, count: int) -> int:
    return int(np.ceil(length_px / (count - (count - 1) * OVERLAP)))


def _cuts(length_px: int, count: int) -> list[tuple[int, int]]:
    side = _side(length_px, count)
    starts = np.round(np.linspace(0, length_px - side, count)).astype(int).tolist()
    return [(start, start + side) for start in starts]


def merge_tiles(
    boxes_px: NDArray[np.float64],
    scores: NDArray[np.float64],
    tiles: NDArray[np.float64],
    picture_px: tuple[int, int],
    margin_px: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Make one list of the boxes of all tiles.

    Boxes of different tiles that agree in what both tiles see are one: the whole one of them, or where every tile cuts
    the fruit, all of it. A box that its tile cuts and that no other tile confirms is dropped: it is part of a fruit,
    and its centre is not the fruit's.

    Parameters
    ----------
    boxes_px : (N, 4) float64
        In the picture.
    scores : (N,) float64
        Confidence.
    tiles : (N, 4) float64
        The tile of each box.
    picture_px : (int, int)
        Width and height of the picture: its own edges cut nothing that a tile could mend.
    margin_px : float
        A box that ends so near the edge of its tile is cut by it.

    Returns
    -------
    (M, 4) float64, (M,) float64
        Boxes and scores, best first.
    """
    cut = _cut(boxes_px, tiles, picture_px, margin_px)
    kept = _Merged(len(boxes_px))
    for row in np.lexsort((-scores, cut)):
        twin = kept.twin_of(boxes_px[row], tiles[row])
        if twin is None:
            kept.add(boxes_px[row], scores[row], tiles[row], cut=bool(cut[row]))
        elif kept.cut[twin]:
            kept.grow(twin, boxes_px[row], scores[row], tiles[row])
            kept.cut[twin] = _cut(kept.boxes_px[twin, None], kept.seen_px[twin, None], picture_px, margin_px)[0]
    whole = np.flatnonzero(~kept.cut[: len(kept.tiles)])
    best_first = whole[np.argsort(-kept.scores[whole], kind="stable")]
    return kept.boxes_px[best_first], kept.scores[best_first]


class _Merged:
    """Boxes with what was seen of the picture to get each, as arrays: one look finds a twin among thousands."""

    def __init__(self, most: int) -> None:
        self.boxes_px, self.seen_px = np.empty((most, 4)), np.empty((most, 4))
        self.scores, self.cut = np.empty(most), np.zeros(most, bool)
        self.tiles: list[set[tuple[float, ...]]] = []

    def twin_of(self, box_px: NDArray[np.float64], tile: NDArray[np.float64]) -> int | None:
        """Find the first that agrees with a box of a tile in what both tiles see."""
        kept_px = self.boxes_px[: len(self.tiles)]
        (xmin, ymin, xmax, ymax), (low_x, low_y, high_x, high_y) = kept_px.T, box_px
        near = np.flatnonzero((xmin < high_x) & (ymin < high_y) & (xmax > low_x) & (ymax > low_y))
        both_px = _intersection(self.seen_px[near], tile)
        mine, theirs = _intersection(kept_px[near], both_px), _intersection(box_px, both_px)
        shared = _area(_intersection(mine, theirs))
        same = near[shared > SAME_IOU * (_area(mine) + _area(theirs) - shared)]
        # Two boxes of one tile are two fruits: the network has decided that.
        return next((row for row in same.tolist() if tuple(tile.tolist()) not in self.tiles[row]), None)

    def add(self, box_px: NDArray[np.float64], score: float, tile: NDArray[np.float64], *, cut: bool) -> None:
        """Keep a box that is no other's twin."""
        row = len(self.tiles)
        self.boxes_px[row], self.seen_px[row], self.scores[row], self.cut[row] = box_px, tile, score, cut
        self.tiles.append({tuple(tile.tolist())})

    def grow(self, row: int, box_px: NDArray[np.float64], score: float, tile: NDArray[np.float64]) -> None:
        """Join a twin to the box that it is of."""
        self.boxes_px[row] = _union(self.boxes_px[row], box_px)
        self.seen_px[row] = _union(self.seen_px[row], tile)
        self.scores[row] = max(self.scores[row], score)
        self.tiles[row].add(tuple(tile.tolist()))


def _cut(
    boxes_px: NDArray[np.float64], tiles: NDArray[np.float64], picture_px: tuple[int, int], margin_px: float
) -> NDArray[np.bool_]:
    """Whether a tile's edge that is not the picture's cuts a box."""
    low = (boxes_px[:, :2] <= tiles[:, :2] + margin_px) & (tiles[:, :2] > 0)
    high = (boxes_px[:, 2:] >= tiles[:, 2:] - margin_px) & (tiles[:, 2:] < picture_px)
    return np.asarray((low | high).any(axis=1))


def _intersection(one: NDArray[np.float64], two: NDArray[np.float64]) -> NDArray[np.float64]:
    low, high = np.maximum(one[..., :2], two[..., :2]), np.minimum(one[..., 2:], two[..., 2:])
    return np.concatenate([low, high], axis=-1)


def _union(one: NDArray[np.float64], two: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([np.minimum(one[:2], two[:2]), np.maximum(one[2:], two[2:])])


def _area(boxes_px: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.prod(np.maximum(boxes_px[..., 2:] - boxes_px[..., :2], 0), axis=-1))
