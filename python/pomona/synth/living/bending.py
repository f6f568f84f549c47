r"""Mechanics: wood bends under the fruits and in the wind.

Euler and Bernoulli's beam with small turns, in space. With the forces $F_i$ beyond a point $r$, at rest positions
$r_i$, the moment is $M(r) = \sum_i (r_i - r) \times F_i$; the wood turns by $d\theta/ds = M / (E I)$ with
$I = \pi a^4 / 4$, and moves by $du/ds = \theta \times t$. An axis carries what grows out of it, and takes it along.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.wood import NODES, along_axes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.wood import WoodAxes

__all__ = ["Bent", "bend"]

_ELASTICITY_PA = 1.0e9
"""Of wood that has carried fruits for weeks: green apple wood has some 6 GPa, and creeps to several times its bend."""

_MOST_TURN_RAD = 0.6
"""An axis comes near to this turn and not beyond: wood that bends further has been propped, or has grown thicker."""


@dataclass(frozen=True, eq=False)
class Bent:
    """Where the wood is under its load: shifts and turns of the nodes, (A, NODES, 3) each, metres and radians."""

    nodes_m: NDArray[np.float64]
    shifts_m: NDArray[np.float64]
    turns_rad: NDArray[np.float64]

    def shifts(
        self, axes: NDArray[np.int64], places: NDArray[np.float64], offsets_m: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Shifts of points that stand off their axis, (N, 3)."""
        return np.asarray(along_axes(self.shifts_m, axes, places) + np.cross(self.turns(axes, places), offsets_m))

    def turns(self, axes: NDArray[np.int64], places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give the turns of places, (N, 3)."""
        return along_axes(self.turns_rad, axes, places)


def bend(
    wood: WoodAxes, softness: float, axes: NDArray[np.int64], places: NDArray[np.float64], forces_n: NDArray[np.float64]
) -> Bent:
    """Load wood with forces, (N, 3), at places of axes; `softness` is a factor of how far it gives way."""
    force = np.zeros_like(wood.nodes_m)
    moment = np.zeros_like(wood.nodes_m)
    points = along_axes(wood.nodes_m, axes, places)
    _put(force, moment, axes, places, forces_n, np.cross(points, forces_n))
    _carry_down(wood, force, moment)
    turns = _own_turns(wood, softness * force, softness * moment)
    shifts = _own_shifts(wood, turns)
    _take_along(wood, turns, shifts)
    return Bent(wood.nodes_m + shifts, shifts, turns)


def _put(
    force: NDArray[np.float64],
    moment: NDArray[np.float64],
    axes: NDArray[np.int64],
    places: NDArray[np.float64],
    forces: NDArray[np.float64],
    moments: NDArray[np.float64],
) -> None:
    """Add loads at the next node towards the tip's side or the root's, whichever is nearer."""
    node = np.rint(places * (NODES - 1)).astype(np.int64)
    np.add.at(force, (axes, node), forces)
    np.add.at(moment, (axes, node), moments)


def _carry_down(wood: WoodAxes, force: NDArray[np.float64], moment: NDArray[np.float64]) -> None:
    """Give every axis the loads, and their moments about the origin, of all that grows out of it."""
    for order in range(int(wood.orders.max()), 0, -1):
        these = np.flatnonzero(wood.orders == order)
        loads, moments = force[these].sum(axis=1), moment[these].sum(axis=1)
        _put(force, moment, wood.parents[these], wood.parent_places[these], loads, moments)


def _own_turns(wood: WoodAxes, force: NDArray[np.float64], moment: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn of each node against its axis's root."""
    beyond = np.cumsum(force[:, ::-1], axis=1)[:, ::-1]
    about_origin = np.cumsum(moment[:, ::-1], axis=1)[:, ::-1]
    about_node = about_origin - np.cross(wood.nodes_m, beyond)
    about_node[:, -1] = 0.0
    stiffness = _ELASTICITY_PA * np.pi / 4.0 * wood.radii_m**4 * wood.stiffness[:, None]
    curvature = about_node / stiffness[:, :, None]
    steps = np.linalg.norm(np.diff(wood.nodes_m, axis=1), axis=2, keepdims=True)
    turns = np.zeros_like(wood.nodes_m)
    turns[:, 1:] = np.cumsum((curvature[:, 1:] + curvature[:, :-1]) / 2.0 * steps, axis=1)
    most = np.linalg.norm(turns, axis=2).max(axis=1)
    return np.asarray(turns / (1.0 + most / _MOST_TURN_RAD)[:, None, None])


def _own_shifts(wood: WoodAxes, turns: NDArray[np.float64]) -> NDArray[np.float64]:
    middle = (turns[:, 1:] + turns[:, :-1]) / 2.0
    shifts = np.zeros_like(wood.nodes_m)
    shifts[:, 1:] = np.cumsum(np.cross(middle, np.diff(wood.nodes_m, axis=1)), axis=1)
    return shifts


def _take_along(wood: WoodAxes, turns: NDArray[np.float64], shifts: NDArray[np.float64]) -> None:
    """Add to every axis how the place moved that it grows out of."""
    for order in range(1, int(wood.orders.max()) + 1):
        these = np.flatnonzero(wood.orders == order)
        parents, places = wood.parents[these], wood.parent_places[these]
        turn = along_axes(turns, parents, places)[:, None, :]
        arms = wood.nodes_m[these] - wood.nodes_m[these, :1]
        shifts[these] += along_axes(shifts, parents, places)[:, None, :] + np.cross(turn, arms)
        turns[these] += turn
