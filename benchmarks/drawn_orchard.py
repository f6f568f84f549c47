"""An orchard of up to a million fruits and more, drawn at once, and what visits and frames see of it.

Rows as in the cells (synth/planting.py), but all trees together: branches, clusters of one to four, and what would hang
nearer than 6.8 cm to another is left out. Rows stand 4 m apart.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pomona.synth.false_points import false_points
from pomona.synth.planting import RowShape, unit_vectors
from pomona.synth.rotations import uniform_rotation

TREES_OF_A_ROW = 228
BETWEEN_ROWS_M = 4.0
HIDDEN = 0.3
FALSE_RATE = 0.05
NOISE_M = 0.02
SHOWN = 0.7 * 1.05
FRUITS_OF_A_TREE = 91.0
"""On average, less than the shape wants for those that are left out."""

Places = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Query:
    """What a robot sees, in a frame of its own, and where that is.

    Attributes
    ----------
    seen : (N, 3) float64
        Metres.
    map_from_query : (4, 4) float64
    up : list of 2 lists
        The vertical in the query and in the map.
    """

    seen: Places
    map_from_query: NDArray[np.float64]
    up: list[list[float]]


def drawn_rows(rng: np.random.Generator, first_row: int, n_trees: int) -> Places:
    """Draw the true fruits of so many trees, in rows from `first_row` on."""
    shape = RowShape()
    number = np.arange(n_trees)
    trunk = np.stack(
        [number % TREES_OF_A_ROW * shape.spacing_m, (number // TREES_OF_A_ROW + first_row) * BETWEEN_ROWS_M], axis=1
    )
    tree = np.repeat(number, rng.integers(shape.branches[0], shape.branches[1] + 1, n_trees))
    first_branch = np.searchsorted(tree, number)
    height = rng.uniform(0.5, shape.height_m - 0.3, len(tree))
    azimuth, rise = rng.uniform(0.0, 2.0 * np.pi, len(tree)), rng.uniform(0.0, 0.3, len(tree))
    wanted = rng.integers(shape.fruits_per_tree[0], shape.fruits_per_tree[1] + 1, n_trees)
    of_tree = np.repeat(number, wanted // 2)
    branch = first_branch[of_tree] + rng.integers(np.bincount(tree, minlength=n_trees)[of_tree])
    along = rng.uniform(0.1, 1.0, len(branch))
    centre = np.stack(
        [
            trunk[of_tree, 0] + along * shape.reach_along_m * np.cos(azimuth[branch]),
            trunk[of_tree, 1] + along * shape.reach_depth_m * np.sin(azimuth[branch]),
            height[branch] + along * rise[branch],
        ],
        axis=1,
    )
    first = centre + rng.normal(size=centre.shape) * rng.uniform(*shape.scatter_m, (len(centre), 1))
    size = 1 + rng.choice(len(shape.cluster_sizes), len(first), p=shape.cluster_sizes)
    beside = np.repeat(first, size - 1, axis=0)
    beside = beside + unit_vectors(rng, (len(beside),)) * rng.uniform(*shape.cluster_gap_m, (len(beside), 1))
    fruits = np.concatenate([first, beside])
    left_out = cKDTree(fruits).query_pairs(shape.least_gap_m, output_type="ndarray").max(axis=1, initial=-1)
    return np.delete(fruits, left_out[left_out >= 0], axis=0)


def visited(rng: np.random.Generator, fruits: Places) -> Places:
    """Return what a visit places of true fruits: some hidden, some false, all off."""
    shown = fruits[rng.random(len(fruits)) >= HIDDEN]
    places = np.concatenate([shown, false_points(rng, shown, round(FALSE_RATE * len(shown)))])
    return np.asarray(places + rng.normal(0.0, NOISE_M / np.sqrt(2.0), places.shape))


def five_trees(rng: np.random.Generator, fruits: Places) -> Query:
    """See five trees somewhere in the rows."""
    shape = RowShape()
    somewhere = fruits[rng.integers(len(fruits))]
    row_m = np.round(somewhere[1] / BETWEEN_ROWS_M) * BETWEEN_ROWS_M
    begin_m = min(somewhere[0], (TREES_OF_A_ROW - 5) * shape.spacing_m) - 0.5 * shape.spacing_m
    near = np.abs(fruits[:, 1] - row_m) < 0.5 * BETWEEN_ROWS_M
    along = (fruits[:, 0] >= begin_m) & (fruits[:, 0] < begin_m + 5 * shape.spacing_m)
    return moved(rng, visited(rng, fruits[near & along]))


def frame(rng: np.random.Generator, fruits: Places, count: int = 40) -> Query:
    """See the 40 fruits, found and false, nearest to one of them."""
    somewhere = fruits[rng.integers(len(fruits))]
    around = fruits[np.abs(fruits - somewhere).max(axis=1) < 2.0]
    seen = visited(rng, around)
    nearest = np.argsort(np.linalg.norm(seen - somewhere, axis=1), kind="stable")[:count]
    return moved(rng, seen[nearest])


def moved(rng: np.random.Generator, seen: Places) -> Query:
    """Put what is seen into a frame of its own."""
    turn, middle = uniform_rotation(rng), seen.mean(axis=0) + rng.uniform(-5.0, 5.0, 3)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, middle
    lean = unit_vectors(rng, (1,))[0] * np.deg2rad(rng.normal(0.0, 2.0))
    up = np.array([0.0, 0.0, 1.0])
    return Query(
        (rng.permutation(seen) - middle) @ turn, pose, [(turn.T @ (up + np.cross(lean, up))).tolist(), up.tolist()]
    )
