"""The fruits of a map as the page is told of them: where, on which tree, in which state, and every sight of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.growth.bearing_trees import BearingTrees
from pomona.orchard import Observations
from pomona.orchard.hanging import hang_chances
from pomona.viewer.packed_columns import packed, packed_texts
from pomona.viewer.row_frame import page_from_map

__all__ = ["STATES", "FruitsTold", "trees_told"]

STATES = ("new", "seen", "missed", "gone")

MM, TENTH_MM, SHARE = 0.001, 0.1, 0.001
"""Steps of places in metres, of sizes in mm, and of probabilities."""


@dataclass(frozen=True, eq=False)
class FruitsTold:
    """N fruits in the order of the page: by tree, then by id.

    Attributes
    ----------
    cloud : FruitCloud
        In that order, in the map's frame.
    ids : (N,) int64
    trees : (N,) int64
    page_from_map : (4, 4) float64
    """

    cloud: FruitCloud
    ids: NDArray[np.int64]
    trees: NDArray[np.int64]
    page_from_map: NDArray[np.float64]

    @classmethod
    def of(cls, cloud: FruitCloud, trees: NDArray[np.int64], up: NDArray[np.float64]) -> FruitsTold:
        """Put the fruits of a map in order; `up` is its vertical, of length 1."""
        ids = np.array(list(map(int, cloud.ids or ())), dtype=np.int64)
        order = np.lexsort((ids, trees))
        return cls(cloud.select(order), ids[order], trees[order], page_from_map(cloud.positions, up))

    def rows_of(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the page for ids of the map."""
        order = np.argsort(self.ids)
        return np.asarray(order[np.searchsorted(self.ids, ids, sorter=order)])

    def placed(self, positions_in_map: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions in the page's frame, (K, 3)."""
        return positions_in_map @ self.page_from_map[:3, :3].T + self.page_from_map[:3, 3]

    def as_columns(self) -> dict[str, Any]:
        """Tell what the map says of each fruit."""
        extras = self.cloud.extras
        states = [STATES.index(state) for state in extras["state"]]
        return {
            "ids": packed_texts([str(one) for one in self.ids.tolist()]),
            "tree": packed(self.trees),
            "state": packed(states),
            "state_probability": packed(_numbers(extras["state_probability"]), SHARE),
            "fruit_probability": packed(_numbers(extras["fruit_probability"]), SHARE),
        }

    def sights(self, seen: Observations, visits: Sequence[str]) -> dict[str, Any]:
        """Tell every sight, in order of fruits and visits."""
        number_of = {name: number for number, name in enumerate(visits)}
        numbers = np.array([number_of[name] for name in seen.sessions], dtype=np.int64)
        rows = self.rows_of(seen.fruit_ids)
        order = np.lexsort((numbers, rows))
        x, y, z = self.placed(seen.positions_in_map[order]).T
        return {
            "fruit": packed(rows[order]),
            "visit": packed(numbers[order]),
            **{name: packed(column, MM) for name, column in (("x", x), ("y", y), ("z", z))},
            "diameter_mm": packed(1000.0 * seen.diameters_m[order], TENTH_MM),
            "probability": packed(seen.probabilities[order], SHARE),
        }


def trees_told(fruits: FruitsTold, trees: BearingTrees) -> list[dict[str, Any]]:
    """Tell name, row and middle of each tree, and how many fruits are expected to hang on it.

    A single blank name where no trees are known.
    """
    placed = fruits.placed(fruits.cloud.positions)
    middles = [placed[fruits.trees == number].mean(axis=0).round(3).tolist() for number in range(len(trees.names))]
    hang = np.bincount(fruits.trees, weights=hang_chances(fruits.cloud), minlength=len(trees.names)).tolist()
    told = zip(trees.names, trees.rows, middles, hang, strict=True)
    return [{"name": name, "row": row, "middle": middle, "n_hang": n_hang} for name, row, middle, n_hang in told]


def _numbers(cells: Sequence[str]) -> NDArray[np.float64]:
    return np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
