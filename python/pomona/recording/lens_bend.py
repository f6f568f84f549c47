"""Whether a lens still bends the pictures, or one is turned about the vertical: rows part towards the corners.

A lens with Brown's coefficient k1 shows what should be at (x, y), from the principal point in focal lengths, at
(x, y) (1 + k1 r^2), in both eyes alike; a camera that is turned by a about its vertical axis shows it at
(x + a (1 + x^2), y + a x y). A pinhole pair has a point in one row; here, with x_l and x_r in the two pictures,

    y_right - y_left = k1 y (x_r^2 - x_l^2)   or   a x_r y ,

which no shift, turn or size of a picture makes: it changes sign across both axes. Before a row, where all is about as
far, both are the same but for a factor, so both are told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.recording.row_fit import row_fit

__all__ = ["Bend", "bend_of", "distinct"]

Array = NDArray[np.float64]

ENOUGH = 60
"""Corners found in both pictures without which nothing is said."""

TOLD_RAD, SIGMAS = np.radians(0.15), 5.0
"""Turn from which on it is told, lengths are 3 % off then at 1.5 m with a baseline of 12 cm, and how sure it must be:
good pairs are measured within 0.07 degrees and 2.2 standard deviations in two dozen frames."""

HALF_SIGMAS = 1.0
"""How sure each half of the film and of the picture must be of the same: a few far corners alone may make a bend that
is none, and are in one of them."""

SUSPECTED_RAD, SUSPECTED_SIGMAS, LIKELY_SIGMAS = TOLD_RAD / 2, 2.0, 3.0
"""Turn, and how sure, from which on more frames are worth their time: half a degree is measured in six as 0.3 and more
by 3.5 standard deviations. And how sure a bend must be so that what else is measured is measured beside it."""

CELL_PX = 4
"""Corners as near as this, with disparities as alike, are one that was seen again, by a camera that stood."""


@dataclass(frozen=True, eq=False)
class Bend:
    """What parts the rows towards the corners, by either cause.

    Attributes
    ----------
    k1 : float
        Brown's first coefficient of both lenses; below 0 straight lines bulge outwards.
    turned_rad : float
        By how much the right camera is turned about its vertical axis instead, to the left.
    rows_px : (N,) float64
        By how much either parts the rows of each corner.
    sigmas : float
        Standard deviations of the turn by which it is not none.
    is_sure : bool
        Whether it is to be told: all of the film and of the picture says it.
    """

    k1: float
    turned_rad: float
    rows_px: Array
    sigmas: float
    is_sure: bool

    @property
    def is_suspected(self) -> bool:
        """Whether more frames may make it sure."""
        return abs(self.turned_rad) >= SUSPECTED_RAD and self.sigmas >= SUSPECTED_SIGMAS

    @property
    def is_likely(self) -> bool:
        """Whether what else is measured is measured beside it."""
        return self.sigmas >= LIKELY_SIGMAS

    def taken_out_of(self, corners: Array) -> Array:
        """Give the corners as they would be without it."""
        straight = corners.copy()
        straight[:, 2] -= self.rows_px
        return straight

    def __str__(self) -> str:
        lens = f"a lens that is not taken out (k1 about {self.k1:.2f})"
        turn = f"an eye that is turned about the vertical (by {abs(np.degrees(self.turned_rad)):.1f} degrees)"
        return f"rows of left and right part towards the corners, as by {lens} or {turn}"


def bend_of(corners: Array, centre_px: tuple[float, float], focal_px: float) -> Bend | None:
    """Fit a bend beside shift, turn and size of the right picture; None where the corners do not fix it.

    Parameters
    ----------
    corners : (N, 4) float64
        As `row_errors` gives them, in the order of the film.
    centre_px : tuple of float
        Principal point of both.
    focal_px : float
        Focal length of both.
    """
    if len(corners) < ENOUGH:
        return None
    right, left = corners[:, 0] - centre_px[0], corners[:, 3] - centre_px[0]
    below, off = corners[:, 1] - centre_px[1], corners[:, 2]
    both = np.stack([np.ones(len(corners)), right, below], axis=1)
    by_lens = _fitted(both, below * (right**2 - left**2) / focal_px**2, off)
    by_turn = _fitted(both, turned := below * right / focal_px, off)
    if by_lens is None or by_turn is None:
        return None
    (k1, _, rows_px), (turned_rad, sigma, _) = by_lens, by_turn
    later = np.arange(len(corners)) >= len(corners) // 2
    parted = (later, right >= np.median(right), below >= np.median(below))
    is_sure = abs(turned_rad) >= max(TOLD_RAD, SIGMAS * sigma) and all(
        _says(_fitted(both[half], turned[half], off[half]), turned_rad) for one in parted for half in (one, ~one)
    )
    return Bend(k1, turned_rad, rows_px, abs(turned_rad) / sigma, bool(is_sure))


def _says(fitted: tuple[float, float, Array] | None, turned_rad: float) -> bool:
    """Tell whether a half bears out the turn that the whole says."""
    return fitted is not None and bool(fitted[0] * np.sign(turned_rad) >= HALF_SIGMAS * fitted[1])


def distinct(corners: Array) -> Array:
    """Give those of the corners that were not seen there before: many frames of a camera that stands are one."""
    column, row, _, column_left = corners.T
    cells = np.floor(np.stack([column_left, row, column_left - column], axis=1) / CELL_PX)
    return corners[np.sort(np.unique(cells, axis=0, return_index=True)[1])]


def _fitted(terms: Array, bent: Array, off: Array) -> tuple[float, float, Array] | None:
    """Give the factor of the last term, its standard deviation and what it says of each; None where it is not fixed."""
    fit = row_fit(np.column_stack([terms, bent]), off)
    if fit is None:
        return None
    variance = float((fit.weights * fit.left_over**2).sum() / fit.weights.sum())
    return float(fit.factors[3]), float(np.sqrt(variance * fit.inverse[3, 3])), fit.factors[3] * bent
