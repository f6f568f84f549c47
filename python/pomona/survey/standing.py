"""Frames that show nothing new: a recorder gave out a picture again, a tractor stood, an eye froze."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection

import numpy as np
from numpy.typing import NDArray

from pomona.detect import Detections
from pomona.recording import Frame
from pomona.recording.checks.readable import is_blank
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.depth import Lifted
from pomona.survey.prefetch import Kind
from pomona.survey.seeing import Look

__all__ = ["Standing"]

STEP_PX = 4
"""Of the pixels that are compared, each way."""

SAME = 0.5
"""Mean difference of two pictures, of 255, up to which they are one. The noise of a camera, seen twice, is more, and
what is left of it in a video may be less; leaves that move by a pixel differ by ten."""

REMEMBERED = 8
"""Frames before: recorders give out pictures of a little before, too."""


class Standing:
    """Looks at frames in their order, but not at those that show again what one before showed: copies are no views.

    A fruit is believed by the frames that show it. Five copies of one picture are one of them.

    Parameters
    ----------
    look_at : callable
        Looks at a frame.
    needs : collection of str
        Pictures that it asks for; `left` and `right` are compared.
    """

    def __init__(self, look_at: Callable[[Frame], Look], needs: Collection[Kind]) -> None:
        self._look_at, self._eyes = look_at, [kind for kind in ("left", "right") if kind in needs]
        self._last = deque[tuple[int, list[NDArray[np.int16]]]](maxlen=REMEMBERED)

    def __call__(self, frame: Frame) -> Look:
        """Look at the next frame; `Look.unusable` where a picture is that of a frame before."""
        try:
            pictures = [read() for read in self._readers(frame)]
        except UnreadablePictureError:
            return self._look_at(frame)
        # Plain pictures are all alike, and whoever looks says so.
        if not pictures or any(is_blank(picture) for picture in pictures):
            return self._look_at(frame)
        seen = [_thinned(picture) for picture in pictures]
        reason = self._nothing_new(seen)
        self._last.appendleft((frame.number, seen))
        if reason is None:
            return self._look_at(frame)
        return Look(frame.number, Detections.none(), Lifted.none(), unusable=f"frame {frame.number}: {reason}")

    def _nothing_new(self, seen: list[NDArray[np.int16]]) -> str | None:
        """Say which picture is that of which frame: all of them, or one that stands still."""
        for number, before in self._last:
            same = [_same(*both) for both in zip(before, seen, strict=True)] if len(before) == len(seen) else []
            if same and all(same):
                return f"the picture is that of frame {number}"
            if any(same):
                return f"the {self._eyes[same.index(True)]} picture alone is that of frame {number}"
        return None

    def _readers(self, frame: Frame) -> list[Callable[[], NDArray[np.uint8]]]:
        readers = {"left": frame.read_left, "right": frame.read_right}
        return [read for eye in self._eyes if (read := readers[eye]) is not None]


def _thinned(picture: NDArray[np.uint8]) -> NDArray[np.int16]:
    return picture[::STEP_PX, ::STEP_PX].astype(np.int16)


def _same(one: NDArray[np.int16], other: NDArray[np.int16]) -> bool:
    return one.shape == other.shape and float(np.abs(one - other).mean()) <= SAME
