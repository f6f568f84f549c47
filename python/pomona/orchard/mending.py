"""A session that is torn apart, because a camera lost its way, put together as the map has its fruits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pomona.answer import Match
from pomona.orchard.session import Session
from pomona.orchard.tears import tears_of
from pomona.torn_rows import laid_in_parts, part_of_places
from pomona.trajectory import Trajectory

__all__ = ["mended"]


def mended(session: Session, match: Match) -> Session:
    """Return a session whose parts lie to one another as the map has them; the first stays where it is.

    Cameras go with the fruits next to them. The configuration notes in how many parts it was, and how these
    were moved in the map.
    """
    tears = [tear.tolist() for tear in tears_of(match)]
    session_from_map = np.linalg.inv(match.parts[0])
    return replace(
        session,
        cloud=laid_in_parts(match, session.cloud).transformed(session_from_map),
        trajectory=None if session.trajectory is None else _with_fruits(session.trajectory, session, match),
        configuration={**session.configuration, "mended": {"parts": match.n_parts, "tears": tears}},
    )


def _with_fruits(trajectory: Trajectory, session: Session, match: Match) -> Trajectory:
    """Return the way of the cameras, each moved as the fruits next to it were."""
    parts = part_of_places(match, session.cloud, trajectory.session_from_camera[:, :3, 3])
    moved = np.linalg.inv(match.parts[0]) @ np.stack(match.parts)
    return replace(trajectory, session_from_camera=moved[parts] @ trajectory.session_from_camera)
