"""What the pictures of one frame answer when the core's odometry asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.odometry.disparity import halvings
from pomona.odometry.patches import rematch
from pomona.odometry.picture_settings import PictureSettings
from pomona.stereo.exposure import like

__all__ = ["Eyes", "Measure", "View"]

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]

Measure = Callable[[Array, Array], Array]
"""Gives the disparities (N,) of picture points (N, 2), from what is expected (N,), NaN for unknown; NaN for none."""


@dataclass(frozen=True, eq=False)
class View:
    """The left picture of a frame, with its halvings, finest first, and what gives disparities in it."""

    pictures: tuple[Picture, ...]
    measure: Measure

    @property
    def picture(self) -> Picture:
        """The whole one."""
        return self.pictures[0]

    def seen(self, known_px: Array, disparities_px: Array, new_px: Array) -> Array:
        """Give u, v, disparity (N + M, 3) of points with expected disparities (N,) and of new ones."""
        everything = np.concatenate([known_px, new_px])
        expected = np.concatenate([disparities_px, np.full(len(new_px), np.nan)])
        return np.column_stack([everything, self.measure(everything, expected)])


@dataclass(frozen=True, eq=False)
class Eyes:
    """A frame beside the newest keyframe, if there is one; the core calls the methods."""

    view: View
    newest: View | None
    settings: PictureSettings
    looking: _core.Looking

    def follow(self, from_px: Array, expected_px: Array) -> tuple[Array, Mask]:
        """Find points (N, 2) of the keyframe in the picture: places (N, 2), and which were found."""
        return self.looking.follow(self._keyframe.pictures, self._compared, from_px, expected_px)

    def find_again(self) -> tuple[Array, Array]:
        """Match the keyframe's points, u, v, disparity (M, 3), with the picture's (M, 2), wherever they are."""
        none, dense = np.zeros((0, 2)), self.settings.dense_per_cell
        keyframe, compared = self._keyframe, self._compared
        seen = keyframe.seen(none, np.zeros(0), self.looking.corners(keyframe.pictures, none, dense))
        seen = seen[np.isfinite(seen[:, 2])]
        candidates = self.looking.corners(compared, none, dense)
        there, matched = rematch(keyframe.picture, compared[0], seen[:, :2], candidates, self.settings)
        return seen[matched], there[matched]

    def measure(self, known_px: Array, disparities_px: Array, per_cell: int) -> Array:
        """Give u, v, disparity of known points (N, 2), then of new corners, as many as the cells have room for."""
        new = self.looking.corners(self.view.pictures, known_px, per_cell)
        return self.view.seen(known_px, disparities_px, new)

    @property
    def _keyframe(self) -> View:
        assert self.newest is not None, "the core compares with a keyframe only after it made one"
        return self.newest

    @cached_property
    def _compared(self) -> tuple[Picture, ...]:
        """The pictures as exposed as the keyframe."""
        compared = like(self.view.picture, self._keyframe.picture)
        return self.view.pictures if compared is self.view.picture else halvings(compared, self.settings.levels)
