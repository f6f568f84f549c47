"""Files of ours, opened: what is read or written is known to be a map or a session."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pomona import geopackage
from pomona.errors import PomonaError
from pomona.store import recovery, shape
from pomona.store.failures import DAMAGED, WrongContentError, told
from pomona.store.guard import guard, release, trust
from pomona.store.migration import migrate, migrated_copy
from pomona.store.rows import columns_of
from pomona.store.schema import FORMAT_VERSION, Kind
from pomona.store.waiting import TIMEOUT_S, Waiting, patiently, teller_of

__all__ = ["TIMEOUT_S", "Waiting", "blank", "snapshot", "writing"]

SHORT_TIMEOUT_S = 0.2
"""For a file of which nobody else knows."""


@contextmanager
def snapshot(path: Path) -> Iterator[tuple[sqlite3.Connection, Kind]]:
    """Read a file of ours as it was at one moment, whatever is written meanwhile.

    Raises
    ------
    PomonaError
        When it is not there, not ours, from a newer program or damaged.
    """
    _require_there(path)
    with told(path), _begun(path) as connection:
        kind, version = _about(connection)
        if version == FORMAT_VERSION:
            yield connection, kind
        else:
            with migrated_copy(connection) as copy:
                guard(copy, path.stat().st_size)
                yield copy, kind


@contextmanager
def writing(
    path: Path,
    kind: Kind,
    *,
    create: bool = False,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
    shown: Path | None = None,
) -> Iterator[tuple[sqlite3.Connection, bool]]:
    """Let nobody else write to a file of ours; all of the block is kept, or nothing when it raises.

    Errors name `shown` where the file is not there for good. `waiting` is called where others have to be waited for, to
    begin or to end; else whoever asked by `tell_waits` is told. Gives the connection, and whether the file is empty and
    waits for its tables, which only `create` allows.
    """
    if not create:
        _require_there(path)
    waiting = waiting or teller_of(shown or path)
    with told(shown or path), _connection(path, create=create, timeout_s=timeout_s) as connection:
        patiently(connection, "BEGIN IMMEDIATE", timeout_s, waiting)
        _migrate_older(connection, path, kind, timeout_s, waiting)
        with _transaction(connection, timeout_s, waiting):
            _load_schema(connection)
            if create and _is_blank(connection):
                release(connection)
                yield connection, True
            else:
                _require_kind(_about(connection)[0], kind)
                trust(connection)
                yield connection, False


@contextmanager
def blank(partial: Path, shown: Path) -> Iterator[sqlite3.Connection]:
    """Write a new file whole; nobody else knows it, so no journal is needed to undo what fails."""
    with told(shown), _connection(partial, create=True, timeout_s=SHORT_TIMEOUT_S) as connection:
        release(connection)
        connection.execute("PRAGMA journal_mode = MEMORY")
        connection.execute("BEGIN IMMEDIATE")
        with _transaction(connection, SHORT_TIMEOUT_S, None):
            yield connection


@contextmanager
def _connection(
    path: Path, *, create: bool = False, timeout_s: float = SHORT_TIMEOUT_S
) -> Iterator[sqlite3.Connection]:
    connection = geopackage.connect(path, create=create, timeout_s=timeout_s)
    try:
        guard(connection, path.stat().st_size if path.exists() else 0)
        yield connection
    finally:
        connection.close()


@contextmanager
def _begun(path: Path) -> Iterator[sqlite3.Connection]:
    """Begin to read; in a copy where a killed writer left the file, and it may not be put in order here."""
    with _connection(path, timeout_s=TIMEOUT_S) as connection:
        try:
            _begin_to_read(connection, teller_of(path))
        except sqlite3.Error as error:
            if not recovery.is_needed(error):
                raise
        else:
            yield connection
            return
    with recovery.copied(path) as copy, _connection(copy) as connection:
        _begin_to_read(connection)
        yield connection


def _begin_to_read(connection: sqlite3.Connection, waiting: Waiting | None = None) -> None:
    connection.execute("BEGIN")
    _load_schema(connection, waiting)


def _load_schema(connection: sqlite3.Connection, waiting: Waiting | None = None) -> None:
    """Read the schema, with which a transaction begins to see the file; what SQLite cannot make of it is damage."""
    try:
        patiently(connection, "SELECT 1 FROM sqlite_master", TIMEOUT_S, waiting).fetchone()
    except sqlite3.OperationalError as error:
        if error.sqlite_errorname == "SQLITE_ERROR":
            raise WrongContentError(DAMAGED) from None
        raise


def _migrate_older(connection: sqlite3.Connection, path: Path, kind: Kind, timeout_s: float, waiting: Waiting) -> None:
    """Bring an older file up to date, in a transaction of its own; the one that was begun is there afterwards again."""
    _load_schema(connection)
    if _is_blank(connection):
        return
    found, version = _about(connection)
    if version == FORMAT_VERSION:
        return
    _require_kind(found, kind)
    connection.execute("ROLLBACK")
    # Tables are laid out anew under those that refer to them; SQLite lets nobody say so later than here.
    connection.execute("PRAGMA foreign_keys = OFF")
    patiently(connection, "BEGIN IMMEDIATE", timeout_s, waiting)
    with _transaction(connection, timeout_s, waiting):
        if _about(connection)[1] != FORMAT_VERSION:
            release(connection)
            migrate(connection)
    guard(connection, path.stat().st_size)
    patiently(connection, "BEGIN IMMEDIATE", timeout_s, waiting)


@contextmanager
def _transaction(connection: sqlite3.Connection, timeout_s: float, waiting: Waiting | None) -> Iterator[None]:
    try:
        yield
        # Who reads is waited for here.
        patiently(connection, "COMMIT", timeout_s, waiting)
    except BaseException:
        # A full disk may have ended the transaction already.
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise


def _require_there(path: Path) -> None:
    if not path.is_file():
        found = "is a folder" if path.is_dir() else "is not there"
        raise PomonaError(f"{path}: {found}, expected a session or a map (.gpkg)")


def _require_kind(found: Kind, wanted: Kind) -> None:
    if found != wanted:
        raise WrongContentError("is the file of one session, expected a map; `map add` makes one from it")


def _is_blank(connection: sqlite3.Connection) -> bool:
    """Tell whether nothing was ever committed to the database."""
    return connection.execute("SELECT 1 FROM sqlite_master").fetchone() is None


def _about(connection: sqlite3.Connection) -> tuple[Kind, int]:
    """Return what the file is and its format; refuse one that is not ours or from a newer program."""
    (application_id,) = connection.execute("PRAGMA application_id").fetchone()
    if application_id == 0 and _is_blank(connection):
        raise WrongContentError("is empty: a map that another program is making just now, or never finished; try again")
    if application_id != geopackage.APPLICATION_ID:
        raise WrongContentError(f"is not a GeoPackage: application id {application_id:#x}, expected 'GPKG'")
    items = shape.items_of(connection)
    if not any(item.name == "pomona_format" for item in items):
        raise WrongContentError("is a GeoPackage but not one of pomona: it has no table pomona_format")
    # The table that tells the version has been the same in every version.
    shape.require_item(items, shape.expected()["table", "pomona_format"])
    kind, version = _kind_and_version(connection)
    shape.require_ours(items, version)
    return kind, version


def _kind_and_version(connection: sqlite3.Connection) -> tuple[Kind, int]:
    versions, kinds = columns_of(connection, "pomona_format", ("format_version", "kind"))
    version, kind = (versions[0], kinds[0]) if len(versions) == 1 else (None, None)
    if version is not None and version > FORMAT_VERSION:
        raise WrongContentError(f"has format {version}, this program reads up to {FORMAT_VERSION}: update pomona")
    if version is None or version < 1 or kind not in ("session", "map"):
        raise WrongContentError(
            f"has format {version} and kind {kind!r}, expected 1 to {FORMAT_VERSION} and 'session' or 'map'"
        )
    return "session" if kind == "session" else "map", version
