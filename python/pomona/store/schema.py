"""The tables of an orchard map and of a session."""

from __future__ import annotations

import sqlite3
from typing import Literal

from pomona import __version__, geopackage

__all__ = ["FORMAT_VERSION", "LAYERS", "Kind", "create", "layers_of"]

FORMAT_VERSION = 2
"""Counts the changes of the tables below; `migration.py` brings older files up to date."""

Kind = Literal["session", "map"]

LAYERS = (
    (
        "sessions",
        "",
        """name TEXT NOT NULL UNIQUE, date TEXT NOT NULL, recording TEXT NOT NULL, content_sha256 TEXT NOT NULL UNIQUE,
        map_from_session TEXT NOT NULL, program_version TEXT NOT NULL, configuration TEXT NOT NULL,
        input_hashes TEXT NOT NULL, method TEXT, settings TEXT, log_odds REAL, noise_m REAL""",
        "visits: date, recording, 4x4 transform into the map, provenance",
    ),
    ("rows", "LINESTRING", "name TEXT", "rows of trees"),
    ("trees", "POINT", "name TEXT, row_id INTEGER REFERENCES rows(id)", "trees"),
    (
        "fruits",
        "POINT",
        """state TEXT NOT NULL CHECK (state IN ('new', 'seen', 'missed', 'gone')), last_seen TEXT NOT NULL,
        last_session_id INTEGER NOT NULL REFERENCES sessions(id), n_sessions INTEGER NOT NULL,
        n_missed INTEGER NOT NULL DEFAULT 0, diameter_m REAL, state_probability REAL, fruit_probability REAL,
        tree_id INTEGER REFERENCES trees(id)""",
        "fruits where they were last seen; id is the fruit's for good",
    ),
    (
        "observations",
        "POINT",
        """session_id INTEGER NOT NULL REFERENCES sessions(id), fruit_id INTEGER NOT NULL REFERENCES fruits(id),
        label TEXT, diameter_m REAL, cxx REAL, cyy REAL, czz REAL, cxy REAL, cxz REAL, cyz REAL, n_views INTEGER,
        match_probability REAL, match_distance_m REAL, other_columns TEXT, UNIQUE (session_id, fruit_id)""",
        "what each session saw of each fruit, in the map's frame",
    ),
    (
        "sightings",
        "",
        "observation_id INTEGER NOT NULL REFERENCES observations(id), frame INTEGER NOT NULL",
        "which frame saw which fruit",
    ),
    (
        "poses",
        "POINT",
        """session_id INTEGER NOT NULL REFERENCES sessions(id), frame INTEGER NOT NULL, time_s REAL NOT NULL,
        qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, qw REAL NOT NULL, UNIQUE (session_id, frame)""",
        "cameras of each session in the map's frame: position and orientation (map_from_camera)",
    ),
    (
        "matches",
        "",
        """first_session_id INTEGER NOT NULL REFERENCES sessions(id),
        second_session_id INTEGER NOT NULL REFERENCES sessions(id), first_from_second TEXT NOT NULL,
        log_odds REAL NOT NULL, pairs TEXT NOT NULL, UNIQUE (first_session_id, second_session_id)""",
        "how every two sessions match: what identities follow from",
    ),
    (
        "changes",
        "",
        """cause TEXT NOT NULL CHECK (cause IN ('added', 'removed')), session TEXT NOT NULL,
        event TEXT NOT NULL CHECK (event IN ('joined', 'split', 'moved')), from_fruit_id INTEGER NOT NULL,
        to_fruit_id INTEGER NOT NULL, n_observations INTEGER NOT NULL""",
        "observations that later evidence gave to another fruit",
    ),
)
"""Name, geometry, columns and description of each layer."""

FRUITS_OF_VERSION_1 = """state TEXT NOT NULL CHECK (state IN ('seen', 'missed')), last_seen TEXT NOT NULL,
        last_session_id INTEGER NOT NULL REFERENCES sessions(id), n_sessions INTEGER NOT NULL,
        n_missed INTEGER NOT NULL DEFAULT 0, diameter_m REAL, tree_id INTEGER REFERENCES trees(id)"""

SINCE_VERSION_2 = ("matches", "changes")

INDEXES = """
CREATE INDEX observations_by_fruit ON observations (fruit_id);
CREATE INDEX sightings_by_observation ON sightings (observation_id);
"""


def layers_of(version: int) -> tuple[tuple[str, str, str, str], ...]:
    """Return the layers of a version of the format."""
    if version == FORMAT_VERSION:
        return LAYERS
    return tuple(
        (name, geometry, FRUITS_OF_VERSION_1 if name == "fruits" else columns, description)
        for name, geometry, columns, description in LAYERS
        if name not in SINCE_VERSION_2
    )


def create(connection: sqlite3.Connection, kind: Kind, version: int = FORMAT_VERSION) -> None:
    """Lay out an empty map in an empty database, inside the open transaction."""
    geopackage.create(connection)
    geopackage.add_table(
        connection,
        "pomona_format",
        "format_version INTEGER NOT NULL, kind TEXT NOT NULL, program_version TEXT NOT NULL",
        "version of these tables, and whether this is a session or a map",
    )
    connection.execute("INSERT INTO pomona_format VALUES (1, ?, ?, ?)", (version, kind, __version__))
    for name, geometry, columns, description in layers_of(version):
        geopackage.add_table(connection, name, columns, description, geometry)
    geopackage.execute_all(connection, INDEXES)
