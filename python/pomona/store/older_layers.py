"""The tables as the programs of then made them, with which an older file is compared before it is brought up."""

from __future__ import annotations

import sqlite3

from pomona import geopackage
from pomona.store.schema import LAYERS, add_format

__all__ = ["INDEXES_OF_VERSION_2", "create_older", "layers_of"]

SINCE = {
    "matches": 2,
    "changes": 2,
    **dict.fromkeys(("crops", "georeference", "control_points", "fruits_wgs84", "trees_wgs84"), 3),
}
"""The version from which a layer is there; the others always were."""

CHANGED = {
    1: {
        "fruits": """state TEXT NOT NULL CHECK (state IN ('seen', 'missed')), last_seen TEXT NOT NULL,
        last_session_id INTEGER NOT NULL REFERENCES sessions(id), n_sessions INTEGER NOT NULL,
        n_missed INTEGER NOT NULL DEFAULT 0, diameter_m REAL, tree_id INTEGER REFERENCES trees(id)""",
    },
    2: {
        "rows": "name TEXT",
        "trees": "name TEXT, row_id INTEGER REFERENCES rows(id)",
        "fruits": """state TEXT NOT NULL CHECK (state IN ('new', 'seen', 'missed', 'gone')), last_seen TEXT NOT NULL,
        last_session_id INTEGER NOT NULL REFERENCES sessions(id), n_sessions INTEGER NOT NULL,
        n_missed INTEGER NOT NULL DEFAULT 0, diameter_m REAL, state_probability REAL, fruit_probability REAL,
        tree_id INTEGER REFERENCES trees(id)""",
        "changes": """cause TEXT NOT NULL CHECK (cause IN ('added', 'removed')), session TEXT NOT NULL,
        event TEXT NOT NULL CHECK (event IN ('joined', 'split', 'moved')), from_fruit_id INTEGER NOT NULL,
        to_fruit_id INTEGER NOT NULL, n_observations INTEGER NOT NULL""",
    },
}
"""The columns of layers up to and with a version, by the version."""

INDEXES_OF_VERSION_2 = """
CREATE INDEX observations_by_fruit ON observations (fruit_id);
CREATE INDEX sightings_by_observation ON sightings (observation_id);
"""


def layers_of(version: int) -> tuple[tuple[str, str, str, str], ...]:
    """Return the layers of a version of the format."""
    older = {name: columns for until in (2, 1) if version <= until for name, columns in CHANGED[until].items()}
    return tuple(
        (name, geometry, older.get(name, columns), description)
        for name, geometry, columns, description in LAYERS
        if SINCE.get(name, 1) <= version
    )


def create_older(connection: sqlite3.Connection, version: int) -> None:
    """Lay out an empty map as the programs of version 1 or 2 did."""
    geopackage.create(connection)
    add_format(connection, "map", version)
    for name, geometry, columns, description in layers_of(version):
        geopackage.add_table(connection, name, columns, description, geometry)
    geopackage.execute_all(connection, INDEXES_OF_VERSION_2)
