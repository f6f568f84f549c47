"""Two visits to one row as fruit clouds, with the truth: which fruit is which, and the pose between them.

Both visits are drawn from one true row. A visit sees some of its trees, misses fruits, adds false points, disturbs
every position, and lies in a frame of its own.

Readings where the description of the cells is open:

- A branch reaches a point of the ellipse with semi-axes 0.55 spacing (along the row) and 0.5 m (in depth), up to 0.3 m
  above its root; clusters sit at 0.1-1 of it, scattered with a standard deviation of 8-10 cm per axis.
- A further fruit of a cluster hangs 7-10 cm from a random member in a random direction; one that finds no room
  6.8 cm from all others is left out of the cluster.
- False points number `false_rate` times the fruits seen, rounded; the box is that of the fruits seen; half of them
  (rounded up) fall in the box, the others 8-15 cm from a fruit seen, in a random direction.
- Sag moves the fruits of the second visit, the query: down by 0.3-1 x amplitude x t^2, t the fraction of the branch,
  one factor per branch; each tree leans in a random direction by up to half the amplitude at its top, linear in height.
- Of two visits that share some trees, either may be the one farther along the row.
- Rotations are uniform, about z alone when the cell is upright; translations uniform within 20 m per axis. Both visits
  are moved. The map stays in metres; the query's unit is 1 / scale metres.
- Diameters, where known: 70 +- 6 mm on the first visit, 12 mm or a factor more on the second, each measured to 2 mm;
  false points have diameters of the same distribution.
- Drift moves the second visit: its ends by that share of half the row's length, along it, aside and up or down.
- Visits from opposite sides see a fruit with a probability that is a logistic function of its depth in the row, 1/2 in
  the middle. Noise along the line of sight is noise in depth.
- A tree that gave way to another stood at the same place of the row, of the same statistics.
- A row torn apart is moved and turned by 10 degrees about the vertical in the last third of its length. The pose is
  that of the rest.
- Thinning takes whole clusters before the second visit, picking single fruits. A frame holds the fruits nearest to one
  of those that the second visit sees.
- Of the fruits seen the share `doubled` is there twice, 3-5 cm apart, and as many are tried to be one with their
  nearest.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import TYPE_CHECKING, Literal

import numpy as np

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.synth.disturbances import (
    bent,
    in_frame,
    in_sight,
    left_after_picking,
    left_after_thinning,
    merged,
    sagged,
    split,
    torn,
)
from pomona.synth.false_points import false_points
from pomona.synth.named_cells import CELLS, Cell
from pomona.synth.rotations import uniform_rotation
from pomona.synth.scenes import draw_scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["CELLS", "Cell", "ScenePair", "SynthVisit", "scene_pair"]

_TRANSLATION_M = 20.0
_MEAN_DIAMETER_M, _DIAMETER_SIGMA_M = 0.070, 0.006
_GROWTH_M, _DIAMETER_NOISE_M = 0.012, 0.002


@dataclass(frozen=True, eq=False)
class SynthVisit:
    """One visit's cloud and the similarity that took it from the row frame.

    Attributes
    ----------
    cloud : fruits in the session's frame; ids are the truth, false points have ids of their own
    session_from_row : (4, 4), scale folded in
    """

    cloud: FruitCloud
    session_from_row: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ScenePair:
    """Two visits with their truth.

    Attributes
    ----------
    cell, seed
        What was drawn.
    query, map
        The clouds; equal ids are the same fruit.
    map_from_query : (4, 4), scale folded in
    scale
        Metres per unit of the query.
    noise_m
        Relative noise of the visits, one sigma per axis, metres.
    up : (3,) vertical in both clouds, or None where it is unknown
    """

    cell: Cell
    seed: int
    query: FruitCloud
    map: FruitCloud
    map_from_query: NDArray[np.float64]
    scale: float
    noise_m: float
    up: NDArray[np.float64] | None


def scene_pair(cell: str | Cell, seed: int) -> ScenePair:
    """Draw the pair of visits number `seed` of a cell.

    Raises
    ------
    PomonaError
        If no cell has this name or the seed is negative.
    """
    if isinstance(cell, str):
        if cell not in CELLS:
            # More than a hundred names would bury the one that was meant.
            near = get_close_matches(cell, CELLS, n=5, cutoff=0.5) or list(CELLS)
            raise PomonaError(f"no cell is called {cell!r}; expected one of {len(CELLS)}, as {', '.join(near)}")
        cell = CELLS[cell]
    if seed < 0:
        raise PomonaError(f"seed {seed} is negative; expected 0 or more")
    name = cell.seeded_as or cell.name
    key = [zlib.crc32(name.encode()), seed]
    rng = np.random.Generator(np.random.PCG64(key))

    scene = draw_scene(rng, cell)
    labels = rng.permutation(len(scene.row))
    second = torn(rng, bent(rng, sagged(rng, scene.row, cell.sag_m), cell.drift), cell.tear_m)
    left = (
        scene.in_query
        & left_after_thinning(rng, scene.row, cell.thinned)
        & left_after_picking(rng, scene.row, cell.picked)
    )
    low, high = cell.scale_range or (1.0, 1.0)
    scale = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    map_visit = _visit(rng, cell, scene.row.positions, scene.in_map, labels, "m", 1.0)
    query_visit = _visit(rng, cell, second, left, labels, "q", 1.0 / scale)
    query, map_ = query_visit.cloud, map_visit.cloud
    if cell.sizes:
        sizes_rng = np.random.Generator(np.random.PCG64([*key, 1]))
        true_m = sizes_rng.normal(_MEAN_DIAMETER_M, _DIAMETER_SIGMA_M, len(labels))
        map_ = _measured(sizes_rng, map_, true_m, 1.0)
        query = _measured(sizes_rng, query, _grown(sizes_rng, true_m, cell), 1.0 / scale)
    return ScenePair(
        cell=cell,
        seed=seed,
        query=query,
        map=map_,
        map_from_query=map_visit.session_from_row @ np.linalg.inv(query_visit.session_from_row),
        scale=scale,
        noise_m=cell.noise_m,
        up=np.array([0.0, 0.0, 1.0]) if cell.upright else None,
    )


def _visit(
    rng: np.random.Generator,
    cell: Cell,
    positions: NDArray[np.float64],
    in_view: NDArray[np.bool_],
    labels: NDArray[np.int64],
    side: Literal["q", "m"],
    units_per_metre: float,
) -> SynthVisit:
    """See the fruits `in_view`: hide, merge, split, add, disturb, move, shuffle."""
    seen = np.flatnonzero(in_view & (rng.random(len(positions)) >= cell.hidden))
    seen = seen[in_sight(rng, positions[seen], cell.fade_m, 1 if side == "q" else -1)]
    seen = in_frame(rng, positions, seen, cell.frame if side == "q" else 0)
    alone, fruits = merged(rng, positions[seen], cell.doubled)
    seen, fruits = seen[alone], fruits[alone]
    false = [split(rng, fruits, cell.doubled), false_points(rng, fruits, round(cell.false_rate * len(seen)))]
    places = np.concatenate([fruits, *false])
    n_false = len(places) - len(seen)
    # The camera looks across the row: its depth is the row's.
    places = places + rng.normal(0.0, cell.noise_m / np.sqrt(2.0), places.shape) * [1.0, cell.depth_noise, 1.0]
    order = rng.permutation(len(places))
    session_from_row = _random_pose(rng, cell, units_per_metre, mirrored=cell.mirrored and side == "q")
    ids = [f"f{labels[fruit]:05d}" for fruit in seen] + [f"{side}{number:05d}" for number in range(n_false)]
    cloud = FruitCloud(
        (places @ session_from_row[:3, :3].T + session_from_row[:3, 3])[order],
        ids=tuple(ids[at] for at in order),
    )
    return SynthVisit(cloud, session_from_row)


def _random_pose(
    rng: np.random.Generator, cell: Cell, units_per_metre: float, *, mirrored: bool
) -> NDArray[np.float64]:
    """Draw a random `session_from_row`."""
    rotation = uniform_rotation(rng, upright=cell.upright)
    if mirrored:
        rotation = rotation @ np.diag([1.0, -1.0, 1.0])
    pose = np.eye(4)
    pose[:3, :3] = units_per_metre * rotation
    pose[:3, 3] = units_per_metre * rng.uniform(-_TRANSLATION_M, _TRANSLATION_M, 3)
    return pose


def _grown(rng: np.random.Generator, true_m: NDArray[np.float64], cell: Cell) -> NDArray[np.float64]:
    """Diameters on the second visit."""
    if cell.growth is None:
        return true_m + _GROWTH_M
    low, high = np.log(cell.growth)
    return np.asarray(true_m * np.exp(rng.uniform(low, high, len(true_m))))


def _measured(
    rng: np.random.Generator, cloud: FruitCloud, true_m: NDArray[np.float64], units_per_metre: float
) -> FruitCloud:
    """Add measured diameters; `true_m` holds those of the fruits by the number in their id."""
    size = true_m.mean() + _DIAMETER_SIGMA_M * rng.normal(size=len(cloud))
    for at, fruit in enumerate(cloud.ids or ()):
        if fruit.startswith("f"):
            size[at] = true_m[int(fruit[1:])]
    measured = size + rng.normal(0.0, _DIAMETER_NOISE_M, len(cloud))
    return replace(cloud, diameters_m=measured * units_per_metre)
