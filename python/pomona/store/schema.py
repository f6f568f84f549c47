"""The tables of an orchard map and of a session."""

from __future__ import annotations

import sqlite3
from typing import Literal

from pomona import __version__, geopackage
from pomona.store.layer_styles import add_styles

__all__ = ["FORMAT_VERSION", "INDEXES", "LAYERS", "VIEWS", "Kind", "add_format", "create"]

FORMAT_VERSION = 3
"""Counts the changes of the tables below; `older_layers.py` says what they were, `migration.py` brings files up."""

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
    (
        "rows",
        "LINESTRING",
        "name TEXT, number INTEGER, source TEXT, spacing_m REAL, spacing_log_odds REAL",
        "rows of trees; source is 'found' or 'given', null where it was drawn",
    ),
    (
        "trees",
        "POINT",
        """name TEXT, row_id INTEGER REFERENCES rows(id), number INTEGER, along_m REAL, kind TEXT, source TEXT,
        n_fruits INTEGER""",
        "trees, or segments of walls, numbered along their row",
    ),
    (
        "fruits",
        "POINT",
        """state TEXT NOT NULL CHECK (state IN ('new', 'seen', 'missed', 'gone')), last_seen TEXT NOT NULL,
        last_session_id INTEGER NOT NULL REFERENCES sessions(id), n_sessions INTEGER NOT NULL,
        n_missed INTEGER NOT NULL DEFAULT 0, diameter_m REAL, state_probability REAL, fruit_probability REAL,
        tree_id INTEGER REFERENCES trees(id), tree_probability REAL, growth_mm_per_day REAL""",
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
        """cause TEXT NOT NULL CHECK (cause IN ('added', 'removed', 'merged')), session TEXT NOT NULL,
        event TEXT NOT NULL CHECK (event IN ('joined', 'split', 'moved')), from_fruit_id INTEGER NOT NULL,
        to_fruit_id INTEGER NOT NULL, n_observations INTEGER NOT NULL""",
        "observations that later evidence gave to another fruit",
    ),
    (
        "crops",
        "",
        """session_id INTEGER NOT NULL REFERENCES sessions(id),
        observation_id INTEGER NOT NULL UNIQUE REFERENCES observations(id), frame INTEGER NOT NULL,
        picture BLOB NOT NULL""",
        "a small picture (WebP or JPEG) of a fruit as a session saw it",
    ),
    (
        "georeference",
        "",
        """enu_from_map TEXT NOT NULL, longitude_deg REAL NOT NULL, latitude_deg REAL NOT NULL, height_m REAL,
        source TEXT NOT NULL CHECK (source IN ('points', 'trajectory')), n_points INTEGER NOT NULL,
        rms_m REAL NOT NULL""",
        "where on Earth the map lies: east, north, up in metres about an origin in WGS 84; one row or none",
    ),
    (
        "control_points",
        "POINT",
        """name TEXT NOT NULL, longitude_deg REAL NOT NULL, latitude_deg REAL NOT NULL, height_m REAL, session TEXT,
        frame INTEGER, east_off_m REAL NOT NULL, north_off_m REAL NOT NULL, up_off_m REAL""",
        "known points: their place in the map, on Earth, and how far the one is from the other",
    ),
    (
        "fruits_wgs84",
        "POINT WGS84",
        """state TEXT NOT NULL, last_seen TEXT NOT NULL, n_sessions INTEGER NOT NULL, diameter_m REAL,
        growth_mm_per_day REAL, tree_id INTEGER""",
        "the fruits on Earth, where the map has a georeference",
    ),
    (
        "trees_wgs84",
        "POINT WGS84",
        "name TEXT, row_id INTEGER, number INTEGER, kind TEXT, n_fruits INTEGER",
        "the trees on Earth, where the map has a georeference",
    ),
)
"""Name, geometry, columns and description of each layer."""

VIEWS = (
    (
        "fruit_series",
        "POINT",
        """SELECT observations.id AS OGC_FID, observations.geom AS geom, observations.fruit_id AS fruit_id,
        sessions.name AS session, sessions.date AS date, observations.diameter_m AS diameter_m,
        observations.match_probability AS match_probability, fruits.tree_id AS tree_id
        FROM observations JOIN sessions ON sessions.id = observations.session_id
        JOIN fruits ON fruits.id = observations.fruit_id""",
        "every fruit on every date",
    ),
)
"""Name, geometry, query and description. Columns of tables only: of any other, nobody knows the type."""

INDEXES = """
CREATE INDEX observations_by_fruit ON observations (fruit_id);
CREATE INDEX sightings_by_observation ON sightings (observation_id);
CREATE INDEX fruits_by_tree ON fruits (tree_id);
CREATE INDEX fruits_by_last_session ON fruits (last_session_id);
CREATE INDEX crops_by_session ON crops (session_id);
"""


def create(connection: sqlite3.Connection, kind: Kind) -> None:
    """Lay out an empty map in an empty database, inside the open transaction."""
    geopackage.create(connection)
    add_format(connection, kind, FORMAT_VERSION)
    for name, geometry, columns, description in LAYERS:
        geopackage.add_table(connection, name, columns, description, geometry)
    for name, geometry, query, description in VIEWS:
        geopackage.add_view(connection, name, query, description, geometry)
    geopackage.execute_all(connection, INDEXES)
    add_styles(connection)


def add_format(connection: sqlite3.Connection, kind: Kind, version: int) -> None:
    """Add the table that tells the version, the same in every version."""
    geopackage.add_table(
        connection,
        "pomona_format",
        "format_version INTEGER NOT NULL, kind TEXT NOT NULL, program_version TEXT NOT NULL",
        "version of these tables, and whether this is a session or a map",
    )
    connection.execute("INSERT INTO pomona_format VALUES (1, ?, ?, ?)", (version, kind, __version__))
