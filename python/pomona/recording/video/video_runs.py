"""Which stretches of a video to decode for the pictures that are wanted."""

from __future__ import annotations

import bisect
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.recording.pictures import UnreadablePictureError

if TYPE_CHECKING:
    from av.video.frame import VideoFrame

__all__ = ["VideoPicture", "key_row", "wanted_pictures"]

JUMP_FRAMES = 50
"""Fewer pictures than these are decoded for nothing rather than jumped over: a jump opens the file anew."""


@dataclass(eq=False)
class VideoPicture:
    """A picture of a video, turned into BGR once, when it is first asked for."""

    where: str
    frame: VideoFrame | None
    size_px: tuple[int, int]
    _bgr: NDArray[np.uint8] | None = None

    def read(self) -> NDArray[np.uint8]:
        """Give (H, W, 3) uint8, BGR."""
        if self.frame is None:
            raise UnreadablePictureError(f"{self.where}: the picture is corrupt")
        found_px = (self.frame.width, self.frame.height)
        if found_px != self.size_px:
            found, expected = ("{}x{}".format(*each) for each in (found_px, self.size_px))
            raise UnreadablePictureError(f"{self.where}: found {found} pixels, expected {expected} as the header says")
        if self._bgr is None:
            self._bgr = np.asarray(self.frame.to_ndarray(format="bgr24"), np.uint8)
        return self._bgr


def key_row(keys: Sequence[int], row: int) -> int:
    """Give the row of the last picture, up to this one, that needs no other to be decoded; the first where unknown."""
    place = bisect.bisect_right(keys, row)
    return keys[place - 1] if place else 0


def wanted_pictures(
    rows: Sequence[int],
    keys: Sequence[int],
    decoded: Callable[[Sequence[int]], Iterable[tuple[int, VideoFrame]]],
    where: Callable[[int], str],
    size_px: tuple[int, int],
) -> Iterator[VideoPicture]:
    """Give one picture for each row; those that were not decoded, or are corrupt, raise when they are read.

    Parameters
    ----------
    rows : sequence of int
        Ascending.
    keys : sequence of int
        Rows of pictures that need no other, ascending.
    decoded : callable
        Decodes from the key picture of the first of some rows on, (row, picture) in ascending order.
    where : callable
        Names the picture of a row.
    size_px : (width, height)
        What pictures must be.
    """
    for run in _runs(rows, keys):
        upcoming = 0
        for row, frame in decoded(run):
            while upcoming < len(run) and run[upcoming] < row:
                yield VideoPicture(where(run[upcoming]), None, size_px)
                upcoming += 1
            if upcoming < len(run) and run[upcoming] == row:
                yield VideoPicture(where(row), None if frame.is_corrupt else frame, size_px)
                upcoming += 1
            if upcoming == len(run):
                break
        yield from (VideoPicture(where(missing), None, size_px) for missing in run[upcoming:])


def _runs(rows: Sequence[int], keys: Sequence[int]) -> Iterator[Sequence[int]]:
    """Cut rows where going on to a later key picture saves more than `JUMP_FRAMES`."""
    cuts = [place for place in range(1, len(rows)) if key_row(keys, rows[place]) - rows[place - 1] > JUMP_FRAMES]
    return (rows[start:end] for start, end in itertools.pairwise([0, *cuts, len(rows)]) if start < end)
