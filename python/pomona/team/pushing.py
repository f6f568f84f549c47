"""A map into the team's store, in one transaction: readers see it as it was, or as it is."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pomona import __version__
from pomona.errors import PomonaError
from pomona.store.cells import COLUMNS
from pomona.store.failures import WrongContentError
from pomona.store.numbering import last_ids
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of
from pomona.store.schema import LAYERS
from pomona.team.database_url import Database, connected
from pomona.team.geometry_bytes import wkb_of
from pomona.team.team_schema import Column, columns_of_layer, prepare

if TYPE_CHECKING:
    import sqlite3

__all__ = ["Pushed", "push_map"]

LOCK = "SELECT pg_{how}advisory_xact_lock(hashtext('pomona'), hashtext(:map))"

INCOMING = "CREATE TEMPORARY TABLE incoming_{layer} ({columns}) ON COMMIT DROP"

ENDED = """
UPDATE pomona.{layer} AS old SET until_push = :push WHERE map = :map AND until_push IS NULL AND NOT EXISTS (
    SELECT 1 FROM incoming_{layer} AS new WHERE new.id = old.id AND ({new}) IS NOT DISTINCT FROM ({old}))
"""

BEGUN = """
INSERT INTO pomona.{layer} (map, since_push, {names}) SELECT :map, :push, {names} FROM incoming_{layer} AS new
WHERE NOT EXISTS (SELECT 1 FROM pomona.{layer} AS old WHERE old.map = :map AND old.id = new.id AND until_push IS NULL)
ORDER BY id
"""


@dataclass(frozen=True)
class Pushed:
    """What became of a map.

    Attributes
    ----------
    name : str
        Of the map in the store.
    n_written, n_ended : int
        Rows that are new or another now; rows that are no more, or were replaced. Both 0: the store had the map
        as it is.
    roles_without_rights : tuple of str
        Roles for the team that are not there, or may not yet see the store, because whoever pushes may not help it.
    """

    name: str
    n_written: int
    n_ended: int
    roles_without_rights: tuple[str, ...] = ()


def push_map(
    path: str | Path,
    database: Database,
    *,
    name: str | None = None,
    drop_sessions: bool = False,
    waits: Callable[[], None] = lambda: None,
) -> Pushed:
    """Bring a map into the team's store; what is there of it and has not changed is left alone.

    Parameters
    ----------
    path : str or Path
        The map (.gpkg).
    database : Database
        The store; it is laid out where there is none.
    name : str, optional
        Of the map in the store; else the file's.
    drop_sessions : bool
        Whether sessions that the store has, and the file has not, go. They stay as older versions of rows.
    waits : callable
        Called when another push of the map is at work, whose end this one awaits.

    Raises
    ------
    PomonaError
        The file is no map; the store has another map of that name, or sessions that the file lacks; or the server
        refuses, or goes away: then the store is as it was.
    """
    path = Path(path)
    name = name or path.stem
    with snapshot(path) as (source, kind), connected(database) as target:
        if kind != "map":
            raise WrongContentError("is a session, expected an orchard map")
        ids = last_ids(source)
        target.run("BEGIN")
        without = prepare(target)
        target.run("SAVEPOINT prepared")
        # One push of a map at a time; readers wait for nobody.
        ((is_free,),) = target.run(LOCK.format(how="try_"), map=name)
        if not is_free:
            waits()
            target.run(LOCK.format(how=""), map=name)
        _require_successor(source, target, name, database, drop_sessions=drop_sessions)
        ((push,),) = target.run(
            "INSERT INTO pomona.pushes (map, program_version, last_ids) VALUES (:map, :version, :ids) "
            "RETURNING push_id",
            map=name,
            version=__version__,
            ids=json.dumps({layer: ids.get(layer, 0) for layer, *_ in LAYERS}),
        )
        counts = [_push_layer(source, target, layer, name, push) for layer, *_ in LAYERS]
        n_ended, n_written = (sum(numbers) for numbers in zip(*counts, strict=True))
        if not n_ended and not n_written:
            target.run("ROLLBACK TO SAVEPOINT prepared")
        target.run("COMMIT")
    return Pushed(name, n_written, n_ended, without)


def _require_successor(
    source: sqlite3.Connection, target: Any, name: str, database: Database, *, drop_sessions: bool
) -> None:
    """Refuse to replace another orchard's map, or a later state of this one by an earlier."""
    ours = set(zip(*columns_of(source, "sessions", ("name", "content_sha256")), strict=True))
    rows = target.run("SELECT name, content_sha256 FROM pomona_now.sessions WHERE map = :map ORDER BY id", map=name)
    theirs = [tuple(row) for row in rows]
    if theirs and not ours.intersection(theirs):
        raise PomonaError(
            f"{database.shown}: has another map {name}, without a session of this one: give another --name"
        )
    missing = [session for session in theirs if session not in ours]
    if missing and not drop_sessions:
        raise PomonaError(
            f"{database.shown}: map {name} has the session {missing[0][0]}, which the file has not: pull and merge it, "
            "or --drop-sessions"
        )


def _push_layer(source: sqlite3.Connection, target: Any, layer: str, name: str, push: int) -> tuple[int, int]:
    """Bring one layer; return how many rows ended and how many began."""
    columns = columns_of_layer(layer)
    incoming = ", ".join(f"{column.name} {column.type}" for column in columns)
    target.run(INCOMING.format(layer=layer, columns=incoming))
    names = ", ".join(column.name for column in columns)
    lines = _lines(source, layer, columns)
    target.run(f"COPY incoming_{layer} ({names}) FROM STDIN", stream=lines)  # names of ours
    new, old = (", ".join(_compared(column, side) for column in columns) for side in ("new", "old"))
    target.run(ENDED.format(layer=layer, new=new, old=old), map=name, push=push)
    n_ended = target.row_count
    target.run(BEGUN.format(layer=layer, names=names), map=name, push=push)
    return n_ended, target.row_count


def _compared(column: Column, side: str) -> str:
    """Compare places bit by bit: PostGIS calls those equal whose boxes are."""
    return f"ST_AsEWKB({side}.geom)" if column.srs_id is not None else f"{side}.{column.name}"


def _lines(source: sqlite3.Connection, layer: str, columns: Sequence[Column]) -> Iterator[bytes]:
    """Write a layer as COPY reads it, in one piece."""
    cells = [_column(source, layer, column.name) for column in columns]
    text = io.StringIO()
    for row in zip(*cells, strict=True):
        text.write("\t".join(_cell(column, cell) for column, cell in zip(columns, row, strict=True)) + "\n")
    yield text.getvalue().encode()


def _column(source: sqlite3.Connection, layer: str, name: str) -> list[Any]:
    """Return a column; what the program itself never reads, as it is."""
    if name in COLUMNS.get(layer, {}):
        return columns_of(source, layer, (name,))[0]
    return [cell for (cell,) in source.execute(f"SELECT {name} FROM {layer} ORDER BY id")]  # names of ours


def _cell(column: Column, cell: Any) -> str:
    if cell is None:
        return r"\N"
    if column.srs_id is not None:
        return wkb_of(cell, column.srs_id).hex()
    if isinstance(cell, bytes):
        return rf"\\x{cell.hex()}"
    if isinstance(cell, float):
        return repr(cell)
    text = str(cell)
    if "\0" in text:
        raise WrongContentError(f"{column.name}: found a NUL in a text, which PostgreSQL cannot hold")
    return text.replace("\\", r"\\").replace("\t", r"\t").replace("\n", r"\n").replace("\r", r"\r")
