"""The tables of the team's store: those of a map, with the map's name and the pushes that a row lived through."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from functools import cache
from typing import Any

from pomona.errors import PomonaError
from pomona.orchard.hanging import LIKELY
from pomona.store.schema import FORMAT_VERSION, LAYERS, create

__all__ = ["LAYER_COLUMNS", "Column", "columns_of_layer", "prepare", "require_store"]

LEAST_SERVER = 130000
"""PostgreSQL 13, as the server counts."""

TYPES = {"TEXT": "text", "INTEGER": "bigint", "REAL": "double precision", "BLOB": "bytea"}

ROLES = {"pomona_reader": ("SELECT",), "pomona_writer": ("SELECT", "INSERT", "UPDATE")}
"""Roles, and what their members may do to the tables: nothing is ever deleted."""

TABLES = """
CREATE SCHEMA pomona;
CREATE SCHEMA pomona_now;
CREATE TABLE pomona.format (format_version integer NOT NULL);
CREATE TABLE pomona.pushes (
    push_id bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, map text NOT NULL,
    pushed_at timestamptz NOT NULL DEFAULT now(), pushed_by text NOT NULL DEFAULT session_user,
    program_version text NOT NULL, last_ids text NOT NULL);
COMMENT ON TABLE pomona.pushes IS 'every time that a map was pushed and had changed';
"""

LAYER_COLUMNS = """
CREATE TABLE pomona.{layer} (
    key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, map text NOT NULL,
    since_push bigint NOT NULL REFERENCES pomona.pushes, until_push bigint REFERENCES pomona.pushes,
    {columns});
CREATE UNIQUE INDEX {layer}_now ON pomona.{layer} (map, id) WHERE until_push IS NULL;
CREATE VIEW pomona_now.{layer} AS SELECT key, map, {names} FROM pomona.{layer} WHERE until_push IS NULL;
COMMENT ON TABLE pomona.{layer} IS '{description}';
"""

VIEWS = """
CREATE VIEW pomona_now.maps AS
SELECT map, max(pushed_at) AS pushed_at, count(*) AS n_pushes FROM pomona.pushes GROUP BY map;
CREATE VIEW pomona_now.row_summary AS
SELECT map, count(*) FILTER (WHERE hangs) AS n_fruits, count(*) FILTER (WHERE state = 'gone') AS n_gone,
    1000 * avg(diameter_m) FILTER (WHERE hangs) AS mean_diameter_mm,
    avg(growth_mm_per_day) FILTER (WHERE hangs) AS growth_mm_per_day, max(last_seen) AS last_seen
FROM (SELECT *, state <> 'gone' AND (state <> 'missed' OR coalesce(fruit_probability, 1) > {likely}) AS hangs
    FROM pomona_now.fruits) AS judged GROUP BY map;
CREATE VIEW pomona_now.session_summary AS
SELECT s.map, s.name, s.date, count(o.id) AS n_fruits, 1000 * avg(o.diameter_m) AS mean_diameter_mm
FROM pomona_now.sessions s LEFT JOIN pomona_now.observations o ON o.map = s.map AND o.session_id = s.id
GROUP BY s.map, s.name, s.date;
CREATE VIEW pomona_now.fruit_series AS
SELECT o.key, o.map, o.fruit_id, s.name AS session, s.date, 1000 * o.diameter_m AS diameter_mm,
    o.match_probability, o.geom
FROM pomona_now.observations o JOIN pomona_now.sessions s ON s.map = o.map AND s.id = o.session_id;
"""
"""For dashboards: a line a map, a line a session, a line a fruit and date."""

NEW_ROLE = "DO $$ BEGIN CREATE ROLE {role} NOLOGIN; EXCEPTION WHEN duplicate_object THEN NULL; END $$"

GRANTS = """
GRANT USAGE ON SCHEMA pomona, pomona_now TO {role};
GRANT SELECT ON ALL TABLES IN SCHEMA pomona_now TO {role};
GRANT {rights} ON ALL TABLES IN SCHEMA pomona TO {role};
"""


@dataclass(frozen=True)
class Column:
    """A column of a layer.

    Attributes
    ----------
    name, type : str
        As PostgreSQL has them.
    srs_id : int or None
        Of a geometry: 0 is a frame of its own, 4326 is WGS 84.
    """

    name: str
    type: str
    srs_id: int | None = None


@cache
def columns_of_layer(layer: str) -> tuple[Column, ...]:
    """Return the columns of a layer, ``id`` first."""
    blank = sqlite3.connect(":memory:", isolation_level=None)
    try:
        create(blank, "map")
        geometries = dict(blank.execute("SELECT table_name, srs_id FROM gpkg_geometry_columns"))
        kinds = dict(blank.execute("SELECT table_name, geometry_type_name FROM gpkg_geometry_columns"))
        rows = blank.execute(f"PRAGMA table_info({layer})").fetchall()
    finally:
        blank.close()
    srs_id = max(0, geometries.get(layer, 0))
    return tuple(
        Column(name, f"geometry({kinds[layer].title().replace('string', 'String')}Z, {srs_id})", srs_id)
        if name == "geom"
        else Column(name, TYPES[kind])
        for _, name, kind, *_ in rows
    )


def prepare(connection: Any) -> tuple[str, ...]:
    """Lay out an empty store, inside the open transaction, unless there is one; return the roles without rights there.

    Raises
    ------
    PomonaError
        The server is too old, has no PostGIS, or holds the store of another format.
    """
    _require_server(connection)
    if not _has_store(connection):
        # Two programs that both find no store would both make one.
        connection.run("SELECT pg_advisory_xact_lock(hashtext('pomona'))")
    if not _has_store(connection):
        _lay_out(connection)
    _require_format(connection)
    return tuple(role for role, rights in ROLES.items() if not _is_granted(connection, role, rights))


def require_store(connection: Any, shown: str) -> None:
    """Refuse a database without a store, or with one of another format.

    Raises
    ------
    PomonaError
        In one line.
    """
    if not _has_store(connection):
        raise PomonaError(f"{shown}: holds no maps of Pomona; `pomona map push` brings them there")
    _require_format(connection)


def _layer(layer: str, description: str) -> str:
    columns = columns_of_layer(layer)
    return LAYER_COLUMNS.format(
        layer=layer,
        columns=", ".join(f"{column.name} {column.type}" for column in columns),
        names=", ".join(column.name for column in columns),
        description=description.replace("'", "''"),
    )


def _require_server(connection: Any) -> None:
    ((version,),) = connection.run("SELECT current_setting('server_version_num')::int")
    if version < LEAST_SERVER:
        raise PomonaError(f"the server: found PostgreSQL {version // 10000}, expected {LEAST_SERVER // 10000} or later")
    if connection.run("SELECT 1 FROM pg_extension WHERE extname = 'postgis'"):
        return
    if not connection.run("SELECT 1 FROM pg_available_extensions WHERE name = 'postgis'"):
        raise PomonaError("the server: has no PostGIS, expected it to be installed there")
    ((may_make,),) = connection.run("SELECT rolsuper FROM pg_roles WHERE rolname = current_user")
    if not may_make:
        raise PomonaError("the database: has no PostGIS yet, ask its administrator for: CREATE EXTENSION postgis")
    connection.run("CREATE EXTENSION postgis")


def _has_store(connection: Any) -> bool:
    return bool(connection.run("SELECT 1 FROM pg_tables WHERE schemaname = 'pomona' AND tablename = 'format'"))


def _lay_out(connection: Any) -> None:
    if connection.run("SELECT 1 FROM pg_namespace WHERE nspname IN ('pomona', 'pomona_now')"):
        raise PomonaError("the database: has a schema pomona or pomona_now that is not Pomona's")
    connection.run(TABLES)
    connection.run("INSERT INTO pomona.format VALUES (:version)", version=FORMAT_VERSION)
    for layer, _, _, description in LAYERS:
        connection.run(_layer(layer, description))
    connection.run(VIEWS.format(likely=LIKELY))


def _require_format(connection: Any) -> None:
    versions = [version for (version,) in connection.run("SELECT format_version FROM pomona.format")]
    if versions != [FORMAT_VERSION]:
        found = ", ".join(map(str, versions)) or "none"
        raise PomonaError(f"the database: holds maps of format {found}, expected {FORMAT_VERSION}")


def _is_granted(connection: Any, role: str, rights: tuple[str, ...]) -> bool:
    """Give a role its rights, and make it, where whoever pushes may; tell whether it has them."""
    if not connection.run("SELECT 1 FROM pg_roles WHERE rolname = :role", role=role):
        ((may,),) = connection.run("SELECT rolsuper OR rolcreaterole FROM pg_roles WHERE rolname = current_user")
        if not may:
            return False
        connection.run(NEW_ROLE.format(role=role))
    asked = "SELECT has_table_privilege(:role, 'pomona.pushes', :right)"
    if not connection.run(asked, role=role, right=rights[-1])[0][0]:
        owned = "SELECT pg_has_role(tableowner, 'USAGE') FROM pg_tables WHERE schemaname = 'pomona' LIMIT 1"
        if not connection.run(owned)[0][0]:
            return False
        connection.run("SELECT pg_advisory_xact_lock(hashtext('pomona'))")
        connection.run(GRANTS.format(role=role, rights=", ".join(rights)))
    return True
