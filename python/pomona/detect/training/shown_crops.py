"""Crops of labelled pictures: one picture or four, at sizes drawn anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona.detect.training.cache import Sample
from pomona.detect.training.colours import disturbed

__all__ = ["SIDE_PX", "PictureCrop", "drawn_crop"]

SIDE_PX = 320
"""Of a crop; half of it is the side of one of four pictures in a crop."""

MAX_ENLARGED = 1.6
"""Of a picture alone; beyond that it is blurred more than any that it stands for."""

MAX_OF_FOUR = 1.1
"""The same of one of four: larger, too little is left of what is around a fruit."""

FOUR = 0.45
"""Share of crops made of four pictures: the only way in which a picture gets smaller than a crop."""

STRETCHED = 0.06
"""Standard deviation of the logarithm by which a picture gets wider, and as much lower."""

AGAIN = 2
"""Times that a square without a fruit is drawn again: most of what is learnt is learnt at fruits."""

LEAST_INSIDE = 0.4
"""A fruit of which the crop's edge leaves less is neither wanted nor punished."""

LEAST_PX = 5.0
"""The same for fruits that are smaller."""


@dataclass(frozen=True, eq=False)
class PictureCrop:
    """A crop and what is wanted of it.

    Attributes
    ----------
    pixels : (S, S, 3) uint8
        BGR.
    boxes_px : (N, 4) float32
        Fruits, cut at the edge of their part of the crop.
    visible : (N,) float32
        NaN where nobody knows.
    ignored_px : (M, 4) float32
    """

    pixels: NDArray[np.uint8]
    boxes_px: NDArray[np.float32]
    visible: NDArray[np.float32]
    ignored_px: NDArray[np.float32]


def drawn_crop(samples: Sequence[Sample], draw: np.random.Generator) -> PictureCrop:
    """Draw a crop out of pictures, of which four are needed at most, the first ones."""
    if draw.random() < FOUR:
        half = SIDE_PX // 2
        parts = [
            _part(sample, half, (x, y), draw)
            for sample, (x, y) in zip(samples, ((0, 0), (half, 0), (0, half), (half, half)), strict=False)
        ]
        rows = [np.hstack([part.pixels for part in parts[:2]]), np.hstack([part.pixels for part in parts[2:]])]
        crop = _joined(np.vstack(rows), parts)
    else:
        crop = _part(samples[0], SIDE_PX, (0, 0), draw)
    return PictureCrop(disturbed(crop.pixels, draw), crop.boxes_px, crop.visible, crop.ignored_px)


def _joined(pixels: NDArray[np.uint8], parts: Sequence[PictureCrop]) -> PictureCrop:
    return PictureCrop(
        pixels,
        np.concatenate([part.boxes_px for part in parts]),
        np.concatenate([part.visible for part in parts]),
        np.concatenate([part.ignored_px for part in parts]),
    )


def _part(sample: Sample, side: int, corner: tuple[int, int], draw: np.random.Generator) -> PictureCrop:
    """Cut a part of a picture, scaled, stretched and turned over at random, to lie at a corner of the crop."""
    size = np.array(sample.pixels.shape[1::-1])
    least, most = side / size.min(), MAX_ENLARGED if side == SIDE_PX else MAX_OF_FOUR
    scale = np.exp(draw.uniform(np.log(least), np.log(max(most, least))))
    stretch = np.exp(draw.normal(0, STRETCHED) * np.array([0.5, -0.5]))
    seen = np.minimum(np.ceil(side / (scale * stretch)).astype(int), size)
    left, top = _corner(sample, seen, draw)
    pixels = _resized(sample.pixels[top : top + seen[1], left : left + seen[0]], side)
    labelled, by = sample.labelled, np.tile(side / seen, 2).astype(np.float32)
    boxes_px, ignored_px = (
        (boxes - np.array([left, top, left, top], np.float32)) * by
        for boxes in (labelled.boxes_px, labelled.ignored_px)
    )
    for axis, chance in ((0, 0.5), (1, 0.1)):
        if draw.random() < chance:
            pixels = np.flip(pixels, 1 - axis)
            boxes_px, ignored_px = (_turned_over(boxes, axis, side) for boxes in (boxes_px, ignored_px))
    return _cut(pixels, boxes_px, labelled.visible, ignored_px, corner)


def _corner(sample: Sample, seen: NDArray[np.int64], draw: np.random.Generator) -> tuple[int, int]:
    """Draw where a part of a picture, (2,) px, lies; mostly again where there is no fruit in it, but not for ever."""
    free = np.array(sample.pixels.shape[1::-1]) - seen + 1
    middles = (sample.labelled.boxes_px[:, :2] + sample.labelled.boxes_px[:, 2:]) / 2
    for _ in range(AGAIN + 1):
        corner = draw.integers(free)
        if ((middles >= corner) & (middles < corner + seen)).all(axis=1).any():
            break
    return int(corner[0]), int(corner[1])


def _resized(pixels: NDArray[np.uint8], side: int) -> NDArray[np.uint8]:
    how = cv2.INTER_AREA if min(pixels.shape[:2]) > side else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(pixels, (side, side), interpolation=how), np.uint8)


def _turned_over(boxes_px: NDArray[np.float32], axis: int, side: int) -> NDArray[np.float32]:
    turned = boxes_px.copy()
    turned[:, axis], turned[:, axis + 2] = side - boxes_px[:, axis + 2], side - boxes_px[:, axis]
    return turned


def _sides(boxes_px: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.sqrt(np.prod(boxes_px[:, 2:] - boxes_px[:, :2], axis=1))


def _cut(
    pixels: NDArray[np.uint8],
    boxes_px: NDArray[np.float32],
    visible: NDArray[np.float32],
    ignored_px: NDArray[np.float32],
    corner: tuple[int, int],
) -> PictureCrop:
    """Cut labels at the edge of their square, and move them to its corner of the crop."""
    side, move = len(pixels), np.array([*corner, *corner], np.float32)
    inside_px = np.clip(boxes_px, 0, side)
    sides, left_over = _sides(inside_px), (_sides(inside_px) / np.maximum(_sides(boxes_px), 1e-3)) ** 2
    wanted = (left_over >= LEAST_INSIDE) & (sides >= LEAST_PX)
    open_px = np.concatenate([inside_px[~wanted & (sides > 0)], np.clip(ignored_px, 0, side)])
    return PictureCrop(
        np.ascontiguousarray(pixels),
        inside_px[wanted] + move,
        visible[wanted],
        open_px[_sides(open_px) > 0] + move,
    )
