"""The motion that brings found poses onto true ones.

A pose is taken for a body: its centre, and the tips of its axes, `lever_m` away. The motion is the one that fits
centres and tips best (Umeyama, 1991). Centres alone leave the turn about a straight row free; tips fix it, and on a way
much longer than the lever hardly change the rest. With a lever of nothing, centres alone are fitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError

__all__ = ["LEVER_M", "Align", "TruthFit", "alignment"]

Array = NDArray[np.float64]

Align: TypeAlias = Literal["none", "rigid", "scale"]

LEVER_M = 1.0
"""A camera a metre from a row sees a fruit move as much by its turn as by its way."""

LONGEST_LEVER_M = 1e6
"""Beside which no way counts."""

ROUNDING = 1e-12
"""Of a place, in parts of its coordinates: a camera that moves by no more stands still."""

LEAST_SCALE = 1e-9
"""Metres a unit: below, a way has shrunk to a point, where all errors are 0, or was mirrored."""


@dataclass(frozen=True, eq=False)
class TruthFit:
    """A similarity.

    Attributes
    ----------
    rotation : (3, 3) float64
    translation : (3,) float64
        Metres of the truth.
    scale : float
        Lengths of the truth over those of the estimate.
    """

    rotation: Array
    translation: Array
    scale: float = 1.0

    def of(self, poses: Array) -> Array:
        """Give poses (F, 4, 4) as they lie on the truth; orientations are turned, not stretched."""
        moved = np.array(poses, np.float64)
        moved[:, :3, :3] = self.rotation @ poses[:, :3, :3]
        moved[:, :3, 3] = self.scale * poses[:, :3, 3] @ self.rotation.T + self.translation
        return moved

    @property
    def matrix(self) -> Array:
        """The (4, 4) matrix, scale folded in."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.scale * self.rotation, self.translation
        return matrix


def alignment(found: Array, true: Array, align: Align = "rigid", lever_m: float = LEVER_M) -> TruthFit:
    """Fit found poses to true ones.

    Parameters
    ----------
    found, true : (F, 4, 4) float64
        Poses of the same moments.
    align : {"none", "rigid", "scale"}
        What may be changed: nothing, the frame of reference, or its unit of length too.
    lever_m : float
        How much orientations count.

    Raises
    ------
    PomonaError
        A lever that is no length, or ways that no scale above 0 brings together.
    """
    if not 0.0 <= lever_m <= LONGEST_LEVER_M:
        raise PomonaError(f"--lever: found {lever_m:g}, expected 0 to {LONGEST_LEVER_M:g} m")
    if align == "none":
        return TruthFit(np.eye(3), np.zeros(3))
    middle, true_middle = found[:, :3, 3].mean(axis=0), true[:, :3, 3].mean(axis=0)
    centred, true_centred = found[:, :3, 3] - middle, true[:, :3, 3] - true_middle
    spread, true_spread = _spread(found), _spread(true)
    stretch = np.sqrt(true_spread / spread) if align == "scale" and spread > 0 < true_spread else 1.0
    tips = np.einsum("fij,fkj->ik", true[:, :3, :3], found[:, :3, :3])
    rotation = _nearest_rotation(stretch * true_centred.T @ centred + lever_m**2 * tips)
    scale = 1.0
    if align == "scale" and spread > 0:
        scale = float((true_centred * (centred @ rotation.T)).sum()) / spread
        if not scale > LEAST_SCALE:
            why = "the true way stands still, or runs against the other"
            raise PomonaError(f"--align scale: found {scale:.3g} as the scale, expected one above 0: {why}")
    return TruthFit(rotation, true_middle - scale * rotation @ middle, scale)


def _spread(poses: Array) -> float:
    """Sum of the squared distances from the middle, 0 where only rounding makes one."""
    places = poses[:, :3, 3]
    squared = float(((places - places.mean(axis=0)) ** 2).sum())
    return squared if squared > len(places) * (ROUNDING * float(np.abs(places).max())) ** 2 else 0.0


def _nearest_rotation(matrix: Array) -> Array:
    u, _, vt = np.linalg.svd(matrix)
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    return np.asarray(u @ vt)
