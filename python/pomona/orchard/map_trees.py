"""`map trees`: rows and trees of a map, found from its fruits or given, with numbers that stay."""

from __future__ import annotations

import sqlite3
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.errors import PomonaError, PomonaWarning
from pomona.orchard.camera_ways import camera_ways
from pomona.orchard.given_trees import KnownTree
from pomona.orchard.hanging import tell_trees
from pomona.orchard.parts import part_numbers, parts_of_fruits
from pomona.orchard.past_seasons import sessions_of_past_seasons
from pomona.orchard.tree_tables import DRAWN, FOUND, GIVEN, StoredTree, bear, stored_trees, write_row, write_tree
from pomona.orchard.writing import update_layers
from pomona.store.cells import finite_json
from pomona.store.opening import TIMEOUT_S, Waiting, writing
from pomona.store.rows import columns_of
from pomona.tree_rows import Crowns, Planting, RowLine, planting_at
from pomona.tree_rows.numbering_of_trees import UNNUMBERED, numbers_along, same_trees
from pomona.tree_rows.told_rows import rows_of_parts
from pomona.tree_rows.tree_spacing import SPACINGS_M

__all__ = ["TreeRow", "find_trees"]

BESIDE_ROW_M = 2.0
"""A tree that is given stands no farther from the curve of its row: its foot, or its top."""

TREE_COLUMN = "tree"
"""Where a session says on which tree it saw a fruit."""


@dataclass(frozen=True)
class TreeRow:
    """One row as the map has it now.

    Attributes
    ----------
    number : int
    kind : {"trees", "segments", "none"}
        Trees; lengths of a row in which no trees can be told; or nothing of both.
    source : {"found", "given"}
    n_fruits : int
    spacing_m, log_odds : float
        Between trees, and what speaks for trees rather than a hedge; infinite where they are given.
    trees : tuple of (str, int, int)
        Name, number and fruits of each.
    """

    number: int
    kind: str
    source: str
    n_fruits: int
    spacing_m: float
    log_odds: float
    trees: tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, eq=False)
class _Fruits:
    """All fruits of the map, the tree of each, 0 for none, and where cameras went."""

    ids: NDArray[np.int64]
    tree_ids: NDArray[np.int64]
    positions: NDArray[np.float64]
    believed: NDArray[np.bool_]
    of_last_season: NDArray[np.bool_]
    parts: NDArray[np.int64]
    ways: Mapping[int, Sequence[NDArray[np.float64]]]


def find_trees(
    path: str | Path,
    *,
    given: Sequence[KnownTree] = (),
    spacing_m: float | None = None,
    segment_m: float | None = None,
    renumber: bool = False,
    forget: bool = False,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
) -> list[TreeRow]:
    """Find the rows and trees of a map and write them into it, in one transaction.

    Parameters
    ----------
    path : str or Path
        The map (.gpkg).
    given : sequence of KnownTree
        Trees that are known; in their rows none is looked for. Those that are drawn in the map, and those that the
        sessions name in a column ``tree``, are known too.
    spacing_m : float, optional
        Between trunks, where it is known.
    segment_m : float, optional
        Where no trees can be told, part the row into lengths of this.
    renumber : bool
        Whether to count from 1 again; else trees keep their numbers.
    forget : bool
        Whether to look for trees where some were given before, and to let go of those that fruits told before and
        no longer tell; else those stay.
    timeout_s, waiting
        As for `add_session`.

    Raises
    ------
    PomonaError
        When the file is not a map of ours, a length cannot be, or a tree that is given stands beside no row.

    Warns
    -----
    PomonaWarning
        Where a length has no effect, for the trees of a row are known.
    """
    for name, length_m in (("--spacing", spacing_m), ("--segments", segment_m)):
        low, high = SPACINGS_M
        if length_m is not None and not low <= length_m <= 10.0 * high:
            raise PomonaError(f"{name}: found {length_m:g} m, expected {low:g} to {10.0 * high:g}")
    with writing(Path(path), "map", timeout_s=timeout_s, waiting=waiting) as (connection, _):
        fruits = _fruits(connection)
        known = [*given, *_drawn(connection, replaced=forget or bool(given))]
        known = known or _named(connection, fruits)
        found = _Finding(connection, fruits, known, spacing_m, segment_m, renumber, forget)
        rows = found.rows()
        update_layers(connection)
    _tell_idle({"--spacing": spacing_m, "--segments": segment_m}, rows)
    return rows


def _tell_idle(lengths_m: Mapping[str, float | None], rows: Sequence[TreeRow]) -> None:
    """Say which lengths told nothing: where trees are known, none is looked for."""
    known = [f"row {row.number}" for row in rows if row.source == GIVEN]
    idle = [name for name, length_m in lengths_m.items() if length_m is not None]
    if known and idle:
        message = f"{' and '.join(idle)}: no effect in {', '.join(known)}, whose trees were given or drawn"
        warnings.warn(f"{message}; --forget looks for trees where some were given", PomonaWarning, stacklevel=3)


class _Finding:
    """One run over all rows."""

    def __init__(
        self,
        connection: sqlite3.Connection,
        fruits: _Fruits,
        known: Sequence[KnownTree],
        spacing_m: float | None,
        segment_m: float | None,
        renumber: bool,
        forget: bool,
    ) -> None:
        self.connection, self.fruits, self.known = connection, fruits, list(known)
        self.spacing_m, self.segment_m = spacing_m, segment_m
        self.renumber, self.forget = renumber, forget
        self.before = [tree for tree in stored_trees(connection) if tree.source != DRAWN]
        self.taken_rows: set[int] = set()
        self.used: set[int] = set()

    def rows(self) -> list[TreeRow]:
        believed = np.flatnonzero(self.fruits.believed)
        fruits = self.fruits
        rows = rows_of_parts(fruits.positions[believed], fruits.parts[believed], fruits.ways, self.spacing_m)
        self._require_beside([line for line, _ in rows])
        bear(self.connection, self.fruits.ids, np.zeros(len(self.fruits.ids), np.int64), None)
        told = [self._row(line, planting, believed[line.members]) for line, planting in rows]
        gone = [(tree.tree_id,) for tree in self.before if tree.tree_id not in self.used]
        self.connection.executemany("DELETE FROM trees WHERE id = ?", gone)
        self.connection.execute(
            "DELETE FROM rows WHERE source IS NOT NULL AND id NOT IN (SELECT row_id FROM trees WHERE row_id NOTNULL)"
        )
        return sorted(told, key=lambda row: row.number)

    def _row(self, line: RowLine, planting: Planting, members: NDArray[np.int64]) -> TreeRow:
        positions = self.fruits.positions[members]
        given = sorted(
            (float(line.along_of(tree.place_in_map[None])[0]), number)
            for number, tree in enumerate(self.known)
            if _is_beside(line, tree.place_in_map)
        )
        kind, source = "trees", FOUND
        if given:
            source = GIVEN
            places = np.array([along for along, _ in given])
            planting = planting_at(positions, line.along_m, line.beside_m, places)
        elif planting.crowns is None and self.segment_m is not None:
            kind, planting = "segments", _segments(line, self.segment_m)
        elif planting.crowns is None and len(places := self._told_before(line, members)) > 1:
            # What fruits come to may tell less of the trees than those before did, but takes none of them away.
            planting = planting_at(positions, line.along_m, line.beside_m, places)
        if planting.crowns is None:
            return TreeRow(0, "none", FOUND, self._count(members), planting.spacing_m, planting.log_odds, ())
        return self._written(line, members, planting, kind, source, [self.known[number] for _, number in given])

    def _written(
        self,
        line: RowLine,
        members: NDArray[np.int64],
        planting: Planting,
        kind: str,
        source: str,
        given: Sequence[KnownTree],
    ) -> TreeRow:
        assert planting.crowns is not None
        places_m = planting.crowns.places_m
        points = np.array([tree.place_in_map for tree in given]) if given else line.places(places_m)
        same = self._same(line, places_m, planting.spacing_m)
        row_before = self._row_before(same)
        numbers = self._numbers(places_m, planting.spacing_m, same, row_before)
        row_id, row_number = write_row(
            self.connection, row_before, self.taken_rows, source, planting, line.knots_m[:, 1:]
        )
        self.taken_rows.add(row_id)
        bearers, chances = (
            planting.bearers(line.along_m, line.beside_m) if kind == "trees" else _in_segments(line, planting.crowns)
        )
        counts = [self._count(members[bearers == tree]) for tree in range(len(places_m))]
        told, tree_ids = [], np.zeros(len(places_m), np.int64)
        for tree in range(len(places_m)):
            name = (given[tree].name if given else "") or f"{row_number}-{numbers[tree]}"
            before = given[tree].tree_id if given and given[tree].tree_id else 0
            before = before or (self.before[same[tree]].tree_id if same[tree] >= 0 else 0)
            tree_ids[tree] = write_tree(
                self.connection,
                StoredTree(
                    before, name, row_id, int(numbers[tree]), float(places_m[tree]), points[tree],
                    "tree" if kind == "trees" else "segment", source, counts[tree],
                ),
                is_drawn=bool(given and given[tree].tree_id),
            )  # fmt: skip
            self.used.add(int(tree_ids[tree]))
            told.append((name, int(numbers[tree]), counts[tree]))
        bear(self.connection, self.fruits.ids[members], np.where(bearers >= 0, tree_ids[bearers], 0), chances)
        log_odds = planting.log_odds
        return TreeRow(row_number, kind, source, self._count(members), planting.spacing_m, log_odds, tuple(told))

    def _told_before(self, line: RowLine, members: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return where along a row the trees stand that fruits told before and its own hung on, ascending."""
        hung_on = set() if self.forget else set(self.fruits.tree_ids[members].tolist())
        told = [
            tree for tree in self.before if tree.tree_id in hung_on and tree.kind == "tree" and tree.source == FOUND
        ]
        return np.sort(line.along_of(np.array([tree.place_in_map for tree in told]))) if told else np.empty(0)

    def _count(self, members: NDArray[np.int64]) -> int:
        """Count fruits of the last season: trees are told by those of all."""
        return int(self.fruits.of_last_season[members].sum())

    def _same(self, line: RowLine, places_m: NDArray[np.float64], spacing_m: float) -> NDArray[np.int64]:
        """Return which tree of before each tree is, (K,), -1 for none."""
        beside = [
            number
            for number, tree in enumerate(self.before)
            if tree.tree_id not in self.used and _is_beside(line, tree.place_in_map)
        ]
        if not beside:
            return np.full(len(places_m), -1)
        known_m = line.along_of(np.array([self.before[number].place_in_map for number in beside]))
        same = same_trees(places_m, known_m, spacing_m)
        return np.where(same >= 0, np.array(beside)[same], -1)

    def _numbers(
        self, places_m: NDArray[np.float64], spacing_m: float, same: NDArray[np.int64], row_before: int
    ) -> NDArray[np.int64]:
        if self.renumber:
            return numbers_along(places_m, spacing_m)
        known = np.full(len(same), UNNUMBERED)
        for tree in np.flatnonzero(same >= 0).tolist():
            before = self.before[same[tree]]
            # Trees of a row that came to this one count from its numbers on.
            if before.number is not None and before.row_id in (row_before, 0):
                known[tree] = before.number
        return numbers_along(places_m, spacing_m, known)

    def _row_before(self, same: NDArray[np.int64]) -> int:
        """Return the row of most of the trees of before, 0 for none."""
        rows = Counter(self.before[number].row_id for number in same.tolist() if number >= 0)
        return next((row for row, _ in rows.most_common() if row), 0)

    def _require_beside(self, lines: Sequence[RowLine]) -> None:
        for tree in self.known:
            if not any(_is_beside(line, tree.place_in_map) for line in lines):
                place = ", ".join(f"{metres:g}" for metres in tree.place_in_map)
                raise PomonaError(
                    f"tree {tree.name or 'without name'}: found it at {place}, where no row of fruits is within "
                    f"{BESIDE_ROW_M:g} m, expected the map's own metres"
                )


def _is_beside(line: RowLine, place: NDArray[np.float64]) -> bool:
    on = line.places(line.along_of(place[None]))[0]
    along = float(line.along_of(place[None])[0])
    reach = -BESIDE_ROW_M <= along <= line.knots_m[-1, 0] + BESIDE_ROW_M
    return bool(reach and np.linalg.norm(place - on) <= BESIDE_ROW_M)


def _segments(line: RowLine, length_m: float) -> Planting:
    count = max(1, round(float(line.along_m.max()) / length_m))
    places = (np.arange(count) + 0.5) * length_m
    crowns = Crowns(length_m, places.astype(np.float64), np.full(count, 1.0 / count), np.array([length_m]))
    return Planting(crowns, length_m, -np.inf, np.empty(0))


def _in_segments(line: RowLine, crowns: Crowns) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the segment of each fruit; of that there is no doubt."""
    numbers = np.clip((line.along_m / crowns.spacing_m).astype(np.int64), 0, len(crowns.places_m) - 1)
    return numbers, np.ones(len(numbers))


def _fruits(connection: sqlite3.Connection) -> _Fruits:
    names = ("id", "tree_id", "geom", "state", "fruit_probability", "last_session_id")
    ids, tree_ids, geoms, states, chances, last_sessions = columns_of(connection, "fruits", names)
    part_of = part_numbers(connection)
    return _Fruits(
        ids=np.array(ids, np.int64),
        tree_ids=np.array([tree_id or 0 for tree_id in tree_ids], np.int64),
        positions=geopackage.points_of(geoms),
        believed=tell_trees(states, chances),
        of_last_season=~np.isin(last_sessions, sessions_of_past_seasons(connection)),
        parts=parts_of_fruits(part_of, last_sessions),
        ways=camera_ways(connection, part_of),
    )


def _drawn(connection: sqlite3.Connection, *, replaced: bool) -> list[KnownTree]:
    """Return the trees that people have drawn, and those that were given before, unless others are given now."""
    kept = (DRAWN,) if replaced else (DRAWN, GIVEN)
    return [
        KnownTree(tree.name, tree.place_in_map, tree.tree_id)
        for tree in stored_trees(connection)
        if tree.source in kept
    ]


def _named(connection: sqlite3.Connection, fruits: _Fruits) -> list[KnownTree]:
    """Return the trees that sessions name, each amid its fruits."""
    fruit_ids, others = columns_of(connection, "observations", ("fruit_id", "other_columns"))
    names: dict[str, set[int]] = {}
    for fruit_id, text in zip(fruit_ids, others, strict=True):
        name = (finite_json(text) or {}).get(TREE_COLUMN, "").strip() if text else ""
        if name:
            names.setdefault(name, set()).add(fruit_id)
    return [
        KnownTree(name, fruits.positions[np.isin(fruits.ids, list(of_tree))].mean(axis=0))
        for name, of_tree in sorted(names.items())
    ]
