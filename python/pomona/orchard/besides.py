"""What a map knows besides its sessions, read to be merged: its trees, where on Earth it lies, its history."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pomona.earth import Anchor
from pomona.orchard.earth_layers import stored_anchor
from pomona.orchard.fruit_ids import Change
from pomona.orchard.tree_tables import StoredTree, stored_trees
from pomona.store.rows import columns_of

__all__ = ["POINT_NAMES", "Besides", "KnownRow", "read_besides"]


@dataclass(frozen=True)
class KnownRow:
    """A row of trees as its table has it."""

    name: str | None
    number: int | None
    source: str | None
    spacing_m: float | None
    spacing_log_odds: float | None


@dataclass(frozen=True, eq=False)
class Besides:
    """All of it, in the frame and by the ids of that map.

    Attributes
    ----------
    rows : mapping of int to KnownRow
    trees : sequence of StoredTree
    tree_of : mapping of int to (int, float)
        Tree of each fruit that has one, and how likely it is that one.
    anchor : Anchor, optional
    fit : tuple of (str, int, float), optional
        How the anchor was found, of how many points, and their distance from it.
    control_points : sequence of tuple
        Columns of the table without the id.
    history : sequence of (str, str, Change)
        Cause and session of each change.
    """

    rows: Mapping[int, KnownRow]
    trees: Sequence[StoredTree]
    tree_of: Mapping[int, tuple[int, float]]
    anchor: Anchor | None
    fit: tuple[str, int, float] | None
    control_points: Sequence[tuple[Any, ...]]
    history: Sequence[tuple[str, str, Change]]

    def renamed(self, names: Mapping[str, str]) -> Besides:
        """Return it with other names for some sessions."""
        own = POINT_NAMES.index("session")
        points = [(*point[:own], names.get(point[own], point[own]), *point[own + 1 :]) for point in self.control_points]
        history = [(cause, names.get(session, session), change) for cause, session, change in self.history]
        return replace(self, control_points=points, history=history)


POINT_NAMES = (
    "geom", "name", "longitude_deg", "latitude_deg", "height_m", "session", "frame", "east_off_m", "north_off_m",
    "up_off_m",
)  # fmt: skip


def read_besides(connection: sqlite3.Connection) -> Besides:
    """Read it from an open map."""
    ids, *cells = columns_of(connection, "rows", ("id", "name", "number", "source", "spacing_m", "spacing_log_odds"))
    bearing = columns_of(connection, "fruits", ("id", "tree_id", "tree_probability"))
    fits = list(zip(*columns_of(connection, "georeference", ("source", "n_points", "rms_m")), strict=True))
    names = ("cause", "session", "event", "from_fruit_id", "to_fruit_id", "n_observations")
    return Besides(
        rows={row_id: KnownRow(*about) for row_id, *about in zip(ids, *cells, strict=True)},
        trees=stored_trees(connection),
        tree_of={fruit: (tree, chance or 0.0) for fruit, tree, chance in zip(*bearing, strict=True) if tree},
        anchor=stored_anchor(connection),
        fit=fits[0] if fits else None,
        control_points=list(zip(*columns_of(connection, "control_points", POINT_NAMES), strict=True)),
        history=[
            (cause, session, Change(*change))
            for cause, session, *change in zip(*columns_of(connection, "changes", names), strict=True)
        ],
    )
