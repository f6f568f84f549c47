"""The living row: grown once from a seed, looked at on any day."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from pomona.errors import PomonaError
from pomona.synth.living.bending import Bent, bend
from pomona.synth.living.contact import WoodPoints, rods_as_points
from pomona.synth.living.crop import FULL_GROWN_DAYS, Crop, set_fruits
from pomona.synth.living.foliage import Foliage, grow_leaves
from pomona.synth.living.fruit_lives import ALIVE
from pomona.synth.living.fruits_of_day import fallen_fruits, hanging_fruits
from pomona.synth.living.grass import grow_grass
from pomona.synth.living.leaf_room import beside_fruits
from pomona.synth.living.leaves_of_day import leaves_of_day, unfolded
from pomona.synth.living.limbs_of_day import all_limbs, spur_limbs, stalk_limbs, wood_limbs
from pomona.synth.living.spurs import Spurs, grow_spurs
from pomona.synth.living.streams_of_chance import chance
from pomona.synth.living.supports import posts_and_wires
from pomona.synth.living.training_systems import grow_wood
from pomona.synth.living.wind import Wind, wind_forces
from pomona.synth.living.wood import WoodAxes
from pomona.synth.row_geometry import FruitSolids, Leaves, Limbs, RowGeometry

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import date

    from numpy.typing import NDArray

    from pomona.synth.living.design import RowDesign

__all__ = ["LivingRow", "grow"]

Part = TypeVar("Part", FruitSolids, Leaves)

_GRAVITY_M_PER_S2 = 9.81
_TREES_MORE_BEHIND = 2
"""At each end: the row behind shows beside the row in front."""

_PIECES_IN_ONE_BEHIND = 3
_DAYS_BEFORE, _DAYS_AFTER = 115, 250
"""Days about bloom on which a row can stand: the year, where it blooms in April."""

_SPURS_BEHIND = 0.6


@dataclass(frozen=True, eq=False)
class LivingRow:
    """A row over one season. What differs from day to day follows from what was drawn when it was grown."""

    design: RowDesign
    wood: WoodAxes
    spurs: Spurs
    crop: Crop
    foliage: Foliage
    supports: Limbs
    grass: Leaves
    behind: LivingRow | None

    def on(self, day: date, wind: Wind | None = None) -> RowGeometry:
        """Give all that stands there on a day.

        Parameters
        ----------
        day : date
        wind : Wind, optional
            Sways branches with their leaves and fruits; none for still air.
        """
        geometry = self._on(day, wind, labelled=True)
        if self.behind is None:
            return geometry
        far = _moved(self.behind._on(day, wind, labelled=False), self._place_behind())
        return RowGeometry(
            _joined(FruitSolids, [geometry.fruits, far.fruits]),
            all_limbs([geometry.limbs, far.limbs]),
            _joined(Leaves, [geometry.leaves, far.leaves]),
        )

    def fruits_on(self, day: date, wind: Wind | None = None) -> FruitSolids:
        """Give the labelled fruits that hang on a day, and nothing else."""
        days = self.days_after_bloom(day)
        return self._hanging(self._bent(days, wind), days, labelled=True)

    def states_on(self, day: date) -> NDArray[np.int64]:
        """State of each fruit on a day, (F,): a number of `STATES`; row i is of the fruit with the id i + 1."""
        return self.crop.lives.states(self.days_after_bloom(day))

    def days_after_bloom(self, day: date) -> float:
        """Days from bloom to a day.

        Raises
        ------
        PomonaError
            The day is of another year: nothing of the model holds there.
        """
        days = (day - self.design.bloom).days
        if not -_DAYS_BEFORE <= days <= _DAYS_AFTER:
            expected = f"one from {_DAYS_BEFORE} days before bloom on {self.design.bloom} to {_DAYS_AFTER} after it"
            raise PomonaError(f"date: found {day}, expected {expected}")
        return float(days)

    def _on(self, day: date, wind: Wind | None, *, labelled: bool) -> RowGeometry:
        days = self.days_after_bloom(day)
        bent = self._bent(days, wind)
        tips = self._spur_tips(bent)
        hanging = self._hanging(bent, days, labelled=labelled)
        alive = np.flatnonzero(self.crop.lives.states(days) == ALIVE)
        limbs = [
            self.supports,
            wood_limbs(self.wood, bent, every=1 if labelled else _PIECES_IN_ONE_BEHIND),
            spur_limbs(self.spurs, bent, tips),
            stalk_limbs(tips[self.crop.spurs[alive]], hanging),
        ]
        leaves = [leaves_of_day(self.foliage, self.wood, bent, days), self.grass]
        fruits = [hanging, fallen_fruits(self.crop, self.spurs.roots(self.wood.nodes_m), days)]
        return RowGeometry(_joined(FruitSolids, fruits), all_limbs(limbs), _joined(Leaves, leaves))

    def _bent(self, days: float, wind: Wind | None) -> Bent:
        """Bend the wood under the fruits that hang, and the wind on the leaves."""
        alive = np.flatnonzero(self.crop.lives.states(days) == ALIVE)
        spurs = self.crop.spurs[alive]
        weights = self.crop.curves.masses_kg(days)[alive, None] * [0.0, 0.0, -_GRAVITY_M_PER_S2]
        loads = [(self.spurs.axes[spurs], self.spurs.places[spurs], weights)]
        if wind is not None:
            leaves = self.foliage
            areas = 0.65 * leaves.lengths_m * leaves.widths_m * unfolded(days) ** 2 * (leaves.falling_days > days)
            loads.append((leaves.axes, leaves.places, wind_forces(wind, leaves.axes, areas)))
        axes, places, forces = (np.concatenate(part) for part in zip(*loads, strict=True))
        return bend(self.wood, self.design.softness, axes, places, forces)

    def _hanging(self, bent: Bent, days: float, *, labelled: bool) -> FruitSolids:
        in_the_way = [WoodPoints(bent.nodes_m, self.wood.radii_m)]
        if self.design.clear_of_posts:
            in_the_way += rods_as_points(self.supports)
        return hanging_fruits(self.crop, self._spur_tips(bent), in_the_way, days, labelled=labelled)

    def _spur_tips(self, bent: Bent) -> NDArray[np.float64]:
        spurs = self.spurs
        at_rest = spurs.roots(self.wood.nodes_m) + spurs.offsets_m
        return np.asarray(at_rest + bent.shifts(spurs.axes, spurs.places, spurs.offsets_m))

    def _place_behind(self) -> NDArray[np.float64]:
        return np.array([-_TREES_MORE_BEHIND * self.design.training.spacing_m, self.design.row_spacing_m, 0.0])


def grow(design: RowDesign, seed: int) -> LivingRow:
    """Grow a row; the same design and seed give the same row, on every day.

    Raises
    ------
    PomonaError
        When the seed is negative, or a tree has no room for its fruits.
    """
    if seed < 0:
        raise PomonaError(f"seed {seed} is negative; expected 0 or more")
    system = design.training
    feet = np.arange(design.n_trees)[:, None] * [system.spacing_m, 0.0, 0.0]
    feet = feet + chance(seed, "feet").normal(0.0, 0.02, feet.shape) * [1.0, 1.0, 0.0]
    wood = grow_wood(chance(seed, "wood"), feet, system)
    spurs = grow_spurs(chance(seed, "spurs"), wood, design.spurs_per_tree)
    supports = posts_and_wires(design.n_trees, system)
    crop = set_fruits(seed, design, wood, spurs, supports)
    centres = crop.centres_m(spurs.roots(wood.nodes_m) + spurs.offsets_m, FULL_GROWN_DAYS)
    foliage = grow_leaves(chance(seed, "leaves"), design, wood, spurs)
    return LivingRow(
        design,
        wood,
        spurs,
        crop,
        beside_fruits(foliage, wood, centres, crop.curves.diameters_m(FULL_GROWN_DAYS) / 2.0),
        supports,
        grow_grass(chance(seed, "grass"), design),
        grow(_behind(design), seed + 1_000_003) if design.row_behind else None,
    )


def _behind(design: RowDesign) -> RowDesign:
    """Plan the row behind: a few trees more, a quarter of the leaves, twice their size, fewer spurs."""
    return replace(
        design,
        n_trees=design.n_trees + 2 * _TREES_MORE_BEHIND,
        leaves_per_tree=design.leaves_per_tree // 4,
        spurs_per_tree=max(1, round(_SPURS_BEHIND * design.spurs_per_tree)),
        leaf_length_m=2.0 * design.leaf_length_m,
        grass_blades_per_m2=0.0,
        row_behind=False,
    )


def _moved(geometry: RowGeometry, by_m: NDArray[np.float64]) -> RowGeometry:
    fruits, limbs, leaves = geometry.fruits, geometry.limbs, geometry.leaves
    return RowGeometry(
        replace(fruits, centres_m=fruits.centres_m + by_m),
        replace(limbs, starts_m=limbs.starts_m + by_m, ends_m=limbs.ends_m + by_m),
        replace(leaves, bases_m=leaves.bases_m + by_m),
    )


def _joined(kind: type[Part], parts: Sequence[Part]) -> Part:
    return kind(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(kind)))
