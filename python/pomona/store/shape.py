"""The whole schema of a file against ours, before anything else is read of it.

SQLite runs what a schema says: a trigger in a map that came by mail would run while we write to it. So everything
that `schema.create` makes must be there, word for word, and what other programs have added must be at rest: it cannot
run because of what Pomona reads or writes.
"""

from __future__ import annotations

import functools
import itertools
import sqlite3
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from pomona import geopackage
from pomona.store import older_layers, schema
from pomona.store.failures import WrongContentError
from pomona.store.sql_text import is_column_list, made, names_in, words_of

__all__ = ["Item", "expected", "items_of", "require_item", "require_ours"]

NOT_OURS_ALONE = frozenset(("gpkg_spatial_ref_sys", "layer_styles"))
"""Pomona does not read them. GDAL makes the one anew where a layer's reference system asks for a new column; the other
is QGIS's."""

EXTENSIBLE = frozenset(name for name, *_ in schema.LAYERS)
"""Layers to which people add columns in QGIS."""


class Item(NamedTuple):
    """A row of `sqlite_master`."""

    kind: str
    name: str
    table: str
    sql: str | None

    def __str__(self) -> str:
        return f"{self.kind} {shown(self.name)}"


def shown(name: str) -> str:
    """Return a name of a stranger for one line of text."""
    return name if name.isidentifier() and len(name) <= 60 else f"{name[:60]!r}"


@functools.cache
def expected(version: int = schema.FORMAT_VERSION) -> Mapping[tuple[str, str], Item]:
    """Return what a file of ours has, by kind and name: made by the code that makes files."""
    connection = sqlite3.connect(":memory:")
    geopackage.add_functions(connection)
    if version == schema.FORMAT_VERSION:
        schema.create(connection, "map")
    else:
        older_layers.create_older(connection, version)
    items = {(item.kind, item.name): item for item in items_of(connection)}
    connection.close()
    return {key: item for key, item in items.items() if item.table not in NOT_OURS_ALONE}


def items_of(connection: sqlite3.Connection) -> list[Item]:
    """Return the schema of a file, names in lower case as SQLite compares them."""
    items = []
    for row in connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_master"):
        if not all(isinstance(cell, str) for cell in row[:3]) or not isinstance(row[3], str | None):
            raise WrongContentError(f"the schema: found {str(row)[:60]!r}, expected texts")
        kind, name, table, sql = row
        items.append(Item(kind, name.lower(), table.lower(), sql))
    return items


def require_item(items: Iterable[Item], wanted: Item) -> None:
    """Refuse a schema in which an object of ours is missing or another one.

    Raises
    ------
    WrongContentError
    """
    named = [item for item in items if item.name == wanted.name and item.kind == wanted.kind]
    if len(named) != 1:
        raise WrongContentError(f"has {len(named) or 'no'} {wanted}, expected one as Pomona makes it")
    if named[0].table != wanted.table or not _is_same(named[0], wanted):
        raise WrongContentError(f"{wanted}: is not as Pomona makes it: {_difference(named[0], wanted)}")


def require_ours(items: list[Item], version: int) -> None:
    """Refuse a schema that is not ours, or that could act on our tables.

    Raises
    ------
    WrongContentError
        With the first object that is wrong.
    """
    for wanted in expected(version).values():
        require_item(items, wanted)
    names = Counter(item.name for item in items if item.kind != "trigger")
    name, count = max(names.items(), key=lambda counted: counted[1])
    if count > 1:
        raise WrongContentError(f"{shown(name)}: found {count} times in the schema, expected each name once")
    for item in items:
        if (item.kind, item.name) not in expected():
            _require_at_rest(item)


def _is_same(found: Item, wanted: Item) -> bool:
    if found.sql == wanted.sql:
        return True
    if found.sql is None or wanted.sql is None:
        return False
    words, ours = words_of(found.sql), words_of(wanted.sql)
    if words == ours:
        return True
    # ALTER TABLE ADD COLUMN puts the new column before the last bracket.
    begin = len(ours) - 1
    grown = found.name in EXTENSIBLE and words[:begin] == ours[:begin] and words[-1:] == ours[-1:]
    return grown and is_column_list(words[begin:-1])


def _difference(found: Item, wanted: Item) -> str:
    words, ours = ((*words_of(item.sql or ""), "the end") for item in (found, wanted))
    at = next((at for at, (one, other) in enumerate(zip(words, ours, strict=False)) if one != other), None)
    if at is None:
        return f"found it on {shown(found.table)}, expected on {wanted.table}"
    return f"found {shown(words[at])}, expected {shown(ours[at])} as word {at + 1} of its SQL"


def _require_at_rest(item: Item) -> None:
    """Refuse an object of others that Pomona's reading and writing could set to work."""
    if item.kind == "index" and item.sql is None and item.name.startswith("sqlite_autoindex_"):
        return
    words = words_of(item.sql or "")
    kind, name, rest = made(words)
    if (kind, name) != (item.kind, item.name):
        raise WrongContentError(f"{item}: found SQL that makes something else ({shown(f'{kind} {name}')})")
    touched = _touched(item, words, rest)
    if touched:
        raise WrongContentError(f"{item}: touches {touched}, expected nothing of others to act on Pomona's tables")
    if words[1] == "virtual" and rest[:2] != ("using", "rtree"):
        raise WrongContentError(f"{item}: is a virtual table, expected none but spatial indexes (rtree)")


def _touched(item: Item, words: tuple[str, ...], rest: tuple[str, ...]) -> str:
    """Return our table that an object of others acts on; nothing where it is at rest.

    A trigger must not name one. A table must not refer to one: that would forbid or pass on what happens there. A
    view acts on nothing, as nobody asks it. An index of plain columns is only kept up.
    """
    ours = {name for kind, name in expected() if kind == "table"}
    if item.kind == "trigger":
        named = names_in(words) | {item.table}
    elif item.kind == "table":
        named = names_in(tuple(after for word, after in itertools.pairwise(words) if word == "references"))
    elif item.kind == "index":
        on, table, opening, *columns, closing = rest if len(rest) > 4 else [""] * 5
        plain = (words[1], on, opening, closing) == ("index", "on", "(", ")") and is_column_list((",", *columns))
        named = set() if plain else {table.strip("'").lower(), item.table}
    else:
        named = set()
    return min(named & ours, default="")
