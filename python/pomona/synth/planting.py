"""A row of fruit trees as a statistical model: where its fruits hang.

Row frame: x along the row, y in depth (across it), z up, metres; tree i stands at x = i * spacing. Five kinds
of wood bear the fruits: free branches of a tree, branches in tiers of a cone (slender spindle), arms tied along wires
(trellis, vine), the same on two walls that lean apart (V trellis), and canes laid over a roof (pergola, kiwifruit).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Wood = Literal["branches", "tiers", "arms", "leaning", "roof"]

# Candidate places tried for one fruit before it is left out of its cluster.
_TRIES = 16


@dataclass(frozen=True)
class RowShape:
    """What a row looks like; the defaults are the apple row that the benchmark cells share.

    Attributes
    ----------
    spacing_m, height_m
        Distance between trunks; height of a tree.
    branches
        Fewest and most branches of a tree.
    reach_along_m, reach_depth_m
        Semi-axes of the ellipse on which the branch tips lie, seen from above.
    fruits_per_tree
        Fewest and most fruits of a tree.
    cluster_sizes
        Probability of a cluster of 1, 2, ... fruits.
    cluster_gap_m
        Shortest and longest distance of a fruit to the cluster member it hangs beside.
    least_gap_m
        No two fruits of the row are closer.
    scatter_m
        Smallest and largest standard deviation, per axis, of a cluster about its branch.
    flatness
        Factors of the scatter along the row, in depth and upwards.
    wood
        Free branches; branches in tiers, shorter towards the top; arms along wires, both ways from the trunk, on one
        wall or on two that lean apart; canes over a roof, both ways across the row.
    wires_m
        Heights of the wires, of the tiers, or of the roof.
    lean_rad
        By how much each of two walls leans.
    below_m
        How far clusters hang below arms and canes, at least and at most.
    """

    spacing_m: float = 1.2
    height_m: float = 3.5
    branches: tuple[int, int] = (8, 12)
    reach_along_m: float = 0.66
    reach_depth_m: float = 0.5
    fruits_per_tree: tuple[int, int] = (60, 150)
    cluster_sizes: tuple[float, ...] = (0.4, 0.3, 0.2, 0.1)
    cluster_gap_m: tuple[float, float] = (0.07, 0.10)
    least_gap_m: float = 0.068
    scatter_m: tuple[float, float] = (0.08, 0.10)
    flatness: tuple[float, float, float] = (1.0, 1.0, 1.0)
    wood: Wood = "branches"
    wires_m: tuple[float, ...] = ()
    lean_rad: float = 0.0
    below_m: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Row:
    """The true fruits of a row.

    Attributes
    ----------
    positions : (N, 3) metres, row frame
    tree : (N,) tree of each fruit
    branch : (N,) branch of each fruit, numbered over the whole row
    along_branch : (N,) 0 at the trunk, 1 at the tip
    height_m : height of the trees
    """

    positions: NDArray[np.float64]
    tree: NDArray[np.int64]
    branch: NDArray[np.int64]
    along_branch: NDArray[np.float64]
    height_m: float

    def __len__(self) -> int:
        return len(self.positions)


def unit_vectors(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Directions uniform on the sphere, `shape + (3,)`."""
    directions = rng.normal(size=(*shape, 3))
    return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True))


def grow_row(rng: np.random.Generator, n_trees: int, shape: RowShape | None = None) -> Row:
    """Draw a row of `n_trees` trees."""
    shape = shape or RowShape()
    positions: list[NDArray[np.float64]] = []
    tree: list[NDArray[np.int64]] = []
    branch: list[NDArray[np.int64]] = []
    along: list[NDArray[np.float64]] = []
    first_branch = 0
    for number in range(n_trees):
        roots, tips = _branches(rng, number, shape)
        neighbours = positions[-1] if positions else np.empty((0, 3))
        fruits, fruit_branch, fruit_along = _hang_fruits(rng, roots, tips, neighbours, shape)
        positions.append(fruits)
        tree.append(np.full(len(fruits), number, np.int64))
        branch.append(fruit_branch + first_branch)
        along.append(fruit_along)
        first_branch += len(roots)
    return Row(
        np.concatenate(positions),
        np.concatenate(tree),
        np.concatenate(branch),
        np.concatenate(along),
        shape.height_m,
    )


def _branches(
    rng: np.random.Generator, number: int, shape: RowShape
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Roots on the trunk at random heights, tips on the ellipse of the reach, up to 0.3 m higher."""
    if shape.wood in ("arms", "leaning"):
        return _arms(number, shape)
    if shape.wood == "tiers":
        return _tiers(rng, number, shape)
    if shape.wood == "roof":
        return _canes(rng, number, shape)
    count = int(rng.integers(shape.branches[0], shape.branches[1] + 1))
    roots = np.zeros((count, 3))
    roots[:, 0] = number * shape.spacing_m
    roots[:, 2] = rng.uniform(0.5, shape.height_m - 0.3, count)
    azimuth = rng.uniform(0.0, 2.0 * np.pi, count)
    reach = np.stack(
        [shape.reach_along_m * np.cos(azimuth), shape.reach_depth_m * np.sin(azimuth), rng.uniform(0.0, 0.3, count)],
        axis=1,
    )
    return roots, roots + reach


def _arms(number: int, shape: RowShape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two arms along every wire, from the trunk to halfway to the next; of two walls, `reach_depth_m` apart below."""
    sides = (-1.0, 1.0) if shape.wood == "leaning" else (0.0,)
    heights = np.repeat(np.tile(shape.wires_m, len(sides)), 2)
    away = shape.reach_depth_m / 2.0 + np.tan(shape.lean_rad) * heights
    across = np.repeat(sides, 2 * len(shape.wires_m)) * away
    roots = np.stack([np.full(len(heights), number * shape.spacing_m), across, heights], axis=1)
    along = np.tile([-shape.reach_along_m, shape.reach_along_m], len(heights) // 2)
    return roots, roots + along[:, None] * [1.0, 0.0, 0.0]


def _tiers(rng: np.random.Generator, number: int, shape: RowShape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Branches all around at the height of each tier, the shorter the higher."""
    count = int(rng.integers(shape.branches[0], shape.branches[1] + 1))
    heights = np.tile(shape.wires_m, -(-count // len(shape.wires_m)))[:count]
    roots = np.stack([np.full(count, number * shape.spacing_m), np.zeros(count), heights], axis=1)
    azimuth = rng.uniform(0.0, 2.0 * np.pi, count)
    reach = [shape.reach_along_m, shape.reach_depth_m] * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    tips = roots.copy()
    tips[:, :2] += reach * (1.0 - heights / (shape.height_m + 0.4))[:, None]
    return roots, tips


def _canes(rng: np.random.Generator, number: int, shape: RowShape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Canes side by side, from the middle of the roof to either side."""
    count = int(rng.integers(shape.branches[0], shape.branches[1] + 1))
    roots = np.zeros((count, 3))
    roots[:, 0] = number * shape.spacing_m + rng.uniform(-shape.reach_along_m, shape.reach_along_m, count)
    roots[:, 2] = rng.choice(shape.wires_m, count)
    tips = roots.copy()
    tips[:, 0] += rng.normal(0.0, 0.1, count)
    tips[:, 1] = rng.choice([-1.0, 1.0], count) * rng.uniform(0.6, 1.0, count) * shape.reach_depth_m
    return roots, tips


def _hang_fruits(
    rng: np.random.Generator,
    roots: NDArray[np.float64],
    tips: NDArray[np.float64],
    neighbours: NDArray[np.float64],
    shape: RowShape,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Clusters along the branches until the tree's number of fruits is reached; no two closer than `least_gap_m`."""
    wanted = int(rng.integers(shape.fruits_per_tree[0], shape.fruits_per_tree[1] + 1))
    taken = np.empty((len(neighbours) + wanted, 3))
    taken[: len(neighbours)] = neighbours
    count, start = len(neighbours), len(neighbours)
    branch = np.empty(wanted, np.int64)
    along = np.empty(wanted)
    while count - start < wanted:
        on = int(rng.integers(len(roots)))
        fraction = float(rng.uniform(0.1, 1.0))
        size = 1 + int(rng.choice(len(shape.cluster_sizes), p=shape.cluster_sizes))
        first = count
        for _ in range(min(size, wanted - (count - start))):
            if count == first:
                centre = roots[on] + fraction * (tips[on] - roots[on])
                if shape.below_m[1] > 0.0:
                    centre = centre - [0.0, 0.0, rng.uniform(*shape.below_m)]
                sigma = rng.uniform(*shape.scatter_m)
                places = centre + _flatten(rng.normal(0.0, sigma, (_TRIES, 3)), shape)
            else:
                beside = taken[rng.integers(first, count)]
                places = beside + unit_vectors(rng, (_TRIES,)) * rng.uniform(*shape.cluster_gap_m, (_TRIES, 1))
            gaps = np.linalg.norm(places[:, None] - taken[None, :count], axis=2).min(axis=1, initial=np.inf)
            free = np.flatnonzero(gaps >= shape.least_gap_m)
            if len(free) == 0:
                break
            taken[count] = places[free[0]]
            branch[count - start], along[count - start] = on, fraction
            count += 1
    return taken[start:], branch, along


def _flatten(offsets: NDArray[np.float64], shape: RowShape) -> NDArray[np.float64]:
    """Keep the scatter in depth of a walled tree within the reach of its branches, and of tied wood to its flatness."""
    if shape.wood == "branches":
        offsets[:, 1] *= min(1.0, shape.reach_depth_m / max(shape.scatter_m))
    return np.asarray(offsets * shape.flatness)
