"""Whether a cloud that is found nowhere fits at another size: then the metres of one of the two are none."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from pomona.amounts import amount
from pomona.cloud import FruitCloud
from pomona.matching import Match
from pomona.settings import Settings

__all__ = ["OtherSize", "other_size", "size_told"]

LEAST = 0.05
"""A size that is off by less is found in metres; what is found with none is found for another reason."""

MOST_FRUITS = 10_000
"""Of both clouds, beyond which nobody waits for it."""

FEET = 0.3048
"""Metres."""

NEAR = 0.02
"""Of rows that bend a size is known to this share."""


class OtherSize(NamedTuple):
    """How a query lies in a map whose metres are not its own.

    Attributes
    ----------
    scale : float
        Metres of the map for one of the query.
    n_pairs : int
    """

    scale: float
    n_pairs: int


def other_size(query: FruitCloud, map: FruitCloud, answer: Match, settings: Settings) -> OtherSize | None:
    """Find a query that was not found in metres at any other size; None where it was, or is at none.

    Parameters
    ----------
    query, map : FruitCloud
    answer : Match
        What they gave.
    settings : Settings
        That they were matched with.
    """
    asked_in_metres = answer.status == "NoMatch" and settings.call["scale"] != "free"
    if not asked_in_metres or max(len(query), len(map)) > MOST_FRUITS:
        return None
    found = replace(settings, call={**settings.call, "scale": "free", "noise_m": None}).match(query, map)
    if found.status != "Found" or found.scale is None or abs(found.scale - 1.0) < LEAST:
        return None
    return OtherSize(found.scale, len(found.pairs))


def size_told(size: OtherSize, query: str, map: str) -> str:
    """Say in a line how a `query` lies in a `map`, and what makes metres wrong."""
    in_feet = {query: FEET, map: 1.0 / FEET}
    feet = next((one for one, scale in in_feet.items() if abs(size.scale / scale - 1.0) < NEAR), None)
    why = "a baseline or focal length that is another camera's?" if feet is None else f"is {feet} in feet?"
    return (
        f"{query} fits {map} at another size, with {amount(size.n_pairs, 'pair')}: a metre of the one is "
        f"{size.scale:.3g} m of the other; {why}"
    )
