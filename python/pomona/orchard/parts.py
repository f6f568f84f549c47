"""Which sessions hang together by their matches: what one says of the others ends where the part ends."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.store.failures import WrongContentError
from pomona.store.rows import columns_of

__all__ = ["components", "part_numbers", "parts_of_fruits", "parts_of_map", "parts_with"]


def components(members: Sequence[int], pairs: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Return the members that pairs join, directly or through others, each in the order of `members`."""
    part_of = {member: [member] for member in members}
    for one, other in pairs:
        smaller, larger = sorted((part_of[one], part_of[other]), key=len)
        if smaller is not larger:
            larger.extend(smaller)
            part_of.update(dict.fromkeys(smaller, larger))
    order = {member: number for number, member in enumerate(members)}
    parts = {id(part): part for part in part_of.values()}
    return [sorted(part, key=order.__getitem__) for part in parts.values()]


def parts_of_map(connection: sqlite3.Connection) -> list[list[int]]:
    """Return the sessions of each part of a map."""
    (session_ids,) = columns_of(connection, "sessions", ("id",))
    names = ("id", "first_session_id", "second_session_id")
    matches = list(zip(*columns_of(connection, "matches", names), strict=True))
    known = set(session_ids)
    for match_id, *sessions in matches:
        if not known.issuperset(sessions):
            raise WrongContentError(f"matches {match_id}: points to a row of sessions that is not there")
    return components(session_ids, ((first, second) for _, first, second in matches))


def part_numbers(connection: sqlite3.Connection) -> dict[int, int]:
    """Return the number of the part of each session."""
    return {session_id: number for number, part in enumerate(parts_of_map(connection)) for session_id in part}


def parts_of_fruits(part_of: Mapping[int, int], last_session_ids: Iterable[int]) -> NDArray[np.int64]:
    """Return the number of the part of each fruit, (N,), by the session that saw it last."""
    return np.array([part_of.get(session_id, 0) for session_id in last_session_ids], np.int64)


def parts_with(connection: sqlite3.Connection, session_ids: Iterable[int]) -> list[int]:
    """Return all sessions of the parts that have one of these."""
    wanted = set(session_ids)
    return [member for part in parts_of_map(connection) if not wanted.isdisjoint(part) for member in part]
