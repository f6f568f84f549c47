"""The true fruits of a cell and who sees them: rows, and scenes made to mislead."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.planting import Row, grow_row

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.named_cells import Cell

_GRID_SHAPE = (10, 5, 8)
_GRID_PITCH_M = 0.25


@dataclass(frozen=True, eq=False)
class SceneTruth:
    """True fruits, and which of them each visit could see: (N,) booleans."""

    row: Row
    in_query: NDArray[np.bool_]
    in_map: NDArray[np.bool_]


def draw_scene(rng: np.random.Generator, cell: Cell) -> SceneTruth:
    """Draw the true fruits of a cell."""
    if cell.scene == "grid":
        return _seen_by_both(_grid())
    if cell.scene == "six":
        row = grow_row(rng, 1, cell.row)
        chosen = rng.choice(len(row), 6, replace=False)
        return _seen_by_both(_take(row, np.isin(np.arange(len(row)), chosen)))
    if cell.scene == "twins":
        row = _with_twin(grow_row(rng, cell.seen, cell.row), original=1, copy=3, spacing_m=cell.row.spacing_m)
        in_query = row.tree == 1 if cell.shared == 1 else np.ones(len(row), bool)
        return SceneTruth(row, in_query, np.ones(len(row), bool))
    return _row(rng, cell)


def _row(rng: np.random.Generator, cell: Cell) -> SceneTruth:
    """Each visit sees `seen` neighbouring trees of a row; `shared` of them are the same."""
    row = grow_row(rng, 2 * cell.seen - cell.shared, cell.row)
    if cell.scene == "plane":
        row = replace(row, positions=row.positions * [1.0, 0.0, 1.0])
    first = row.tree < cell.seen
    second = row.tree >= cell.seen - cell.shared
    truth = SceneTruth(row, first, second) if rng.random() < 0.5 else SceneTruth(row, second, first)
    return _replanted(rng, truth, cell) if cell.replanted > 0.0 else truth


def _replanted(rng: np.random.Generator, truth: SceneTruth, cell: Cell) -> SceneTruth:
    """Before the second visit, the query, other trees were planted in the place of some."""
    n_trees = int(truth.row.tree.max()) + 1
    gone = rng.random(n_trees) < cell.replanted
    gone[rng.integers(n_trees)] = False
    new = grow_row(rng, n_trees, cell.row)
    new = _take(new, gone[new.tree])
    seen = np.zeros(n_trees, bool)
    seen[truth.row.tree[truth.in_query]] = True
    return SceneTruth(
        _together(truth.row, new),
        np.concatenate([truth.in_query & ~gone[truth.row.tree], seen[new.tree]]),
        np.concatenate([truth.in_map, np.zeros(len(new), bool)]),
    )


def _seen_by_both(row: Row) -> SceneTruth:
    everything = np.ones(len(row), bool)
    return SceneTruth(row, everything, everything)


def _take(row: Row, keep: NDArray[np.bool_]) -> Row:
    return Row(row.positions[keep], row.tree[keep], row.branch[keep], row.along_branch[keep], row.height_m)


def _with_twin(row: Row, *, original: int, copy: int, spacing_m: float) -> Row:
    """Tree `copy` becomes a copy of tree `original`."""
    others = _take(row, row.tree != copy)
    twin = _take(row, row.tree == original)
    shift = np.array([(copy - original) * spacing_m, 0.0, 0.0])
    return _together(others, replace(twin, positions=twin.positions + shift, tree=np.full(len(twin), copy)))


def _together(one: Row, other: Row) -> Row:
    """Put the fruits of two rows into one."""
    return Row(
        np.concatenate([one.positions, other.positions]),
        np.concatenate([one.tree, other.tree]),
        np.concatenate([one.branch, other.branch + one.branch.max(initial=-1) + 1]),
        np.concatenate([one.along_branch, other.along_branch]),
        one.height_m,
    )


def _grid() -> Row:
    """Lay a regular grid: every place looks like every other."""
    places = np.indices(_GRID_SHAPE)
    positions = _GRID_PITCH_M * places.reshape(3, -1).T.astype(np.float64)
    none = np.zeros(len(positions), np.int64)
    return Row(positions, none, none, np.zeros(len(positions)), _GRID_PITCH_M * _GRID_SHAPE[2])
