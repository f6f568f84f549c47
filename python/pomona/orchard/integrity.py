"""What must be true of a map, asked of the file."""

from __future__ import annotations

from pathlib import Path

from pomona.orchard import schema

__all__ = ["problems"]

# Each query gives one line of text per violation.
INVARIANTS = (
    "SELECT 'fruit ' || id || ' was never observed' FROM fruits WHERE id NOT IN (SELECT fruit_id FROM observations)",
    """SELECT 'fruit ' || fruit_id || ' is there ' || count(*) || ' times in session ' || session_id FROM observations
    GROUP BY fruit_id, session_id HAVING count(*) > 1""",
    """SELECT 'fruit ' || f.id || ' counts ' || n_sessions || ' sessions, observed in ' || count(o.id) FROM fruits f
    JOIN observations o ON o.fruit_id = f.id GROUP BY f.id HAVING count(o.id) != n_sessions""",
    """SELECT 'fruit ' || f.id || ' is not where session ' || s.name || ' saw it last' FROM fruits f
    JOIN sessions s ON s.id = f.last_session_id
    LEFT JOIN observations o ON o.fruit_id = f.id AND o.session_id = s.id
    WHERE o.geom IS NOT f.geom OR s.date != f.last_seen""",
    """SELECT 'fruit ' || f.id || ' was last seen on ' || f.last_seen || ', session ' || s.name || ' saw it later'
    FROM fruits f JOIN observations o ON o.fruit_id = f.id JOIN sessions s ON s.id = o.session_id
    WHERE s.date > f.last_seen""",
    """SELECT 'observation ' || id || ' has the match probability ' || match_probability FROM observations
    WHERE match_probability NOT BETWEEN 0 AND 1""",
    """SELECT 'fruit ' || id || ' is not in the spatial index' FROM fruits
    WHERE id NOT IN (SELECT id FROM rtree_fruits_geom)""",
    """SELECT 'the file of a session holds ' || (SELECT count(*) FROM sessions) || ' sessions' FROM pomona_format
    WHERE kind = 'session' AND (SELECT count(*) FROM sessions) != 1""",
)


def problems(path: str | Path) -> list[str]:
    """Return what is wrong with a session or a map, a line each; nothing when all is well.

    Raises
    ------
    PomonaError
        When the file is not ours, from a newer program or so damaged that it cannot be read.
    """
    with schema.snapshot(Path(path)) as (connection, _):
        damage = [line for (line,) in connection.execute("PRAGMA integrity_check") if line != "ok"]
        dangling = [
            f"{table} {row} points to a row of {parent} that is not there"
            for table, row, parent, _ in connection.execute("PRAGMA foreign_key_check")
        ]
        broken = [line for query in INVARIANTS for (line,) in connection.execute(query)]
        return damage + dangling + broken
