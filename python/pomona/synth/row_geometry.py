"""What stands in a row on one day: the border between the model that grows it and the renderers that look at it.

Row frame as in `planting`: x along the row, y in depth, z up, metres, the ground at z = 0. Colours are linear RGB,
0 to 1, before any light falls on them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["FruitSolids", "Leaves", "Limbs", "RowGeometry"]


@dataclass(frozen=True, eq=False)
class FruitSolids:
    """Fruits as solids of revolution.

    Attributes
    ----------
    ids : (F,) int64
        From 1 on, the same fruit on every date; 0 for fruit without a label: of rows behind, on the ground.
    trees : (F,) int64
    centres_m : (F, 3) float64
    diameters_m : (F,) float64
        Across the axis at the widest place, as a caliper measures.
    heights_m : (F,) float64
        Along the axis.
    axes : (F, 3) float64
        Unit vectors from the calyx to the stalk.
    ground_colours, blush_colours : (F, 3) float64
    blush_shares : (F,) float64
        How much of the skin the blush covers, 0 to 1.
    blush_directions : (F, 3) float64
        Unit vectors: the side that had the sun.
    """

    ids: NDArray[np.int64]
    trees: NDArray[np.int64]
    centres_m: NDArray[np.float64]
    diameters_m: NDArray[np.float64]
    heights_m: NDArray[np.float64]
    axes: NDArray[np.float64]
    ground_colours: NDArray[np.float64]
    blush_colours: NDArray[np.float64]
    blush_shares: NDArray[np.float64]
    blush_directions: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class Limbs:
    """Trunks, branches, spurs, stalks, posts and wires as tapered rods with round ends.

    Attributes
    ----------
    starts_m, ends_m : (S, 3) float64
    start_radii_m, end_radii_m : (S,) float64
    colours : (S, 3) float64
    """

    starts_m: NDArray[np.float64]
    ends_m: NDArray[np.float64]
    start_radii_m: NDArray[np.float64]
    end_radii_m: NDArray[np.float64]
    colours: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.starts_m)


@dataclass(frozen=True, eq=False)
class Leaves:
    """Leaf blades, each folded along its middle and bent towards its tip.

    Attributes
    ----------
    bases_m : (L, 3) float64
        Where the blade begins.
    tips : (L, 3) float64
        Unit vectors from the base towards the tip.
    normals : (L, 3) float64
        Unit vectors, perpendicular to `tips`: the upper side.
    lengths_m, widths_m : (L,) float64
    folds_rad, bends_rad : (L,) float64
        How far each half rises from the flat; how far the tip turns away from the normal.
    colours : (L, 3) float64
        Of the upper side.
    """

    bases_m: NDArray[np.float64]
    tips: NDArray[np.float64]
    normals: NDArray[np.float64]
    lengths_m: NDArray[np.float64]
    widths_m: NDArray[np.float64]
    folds_rad: NDArray[np.float64]
    bends_rad: NDArray[np.float64]
    colours: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.bases_m)


@dataclass(frozen=True, eq=False)
class RowGeometry:
    """All that stands there. Rows behind are part of it, their fruits without labels; the ground is the renderer's."""

    fruits: FruitSolids
    limbs: Limbs
    leaves: Leaves
