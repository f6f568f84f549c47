"""What the verbs of maps share: the map that they are given, and changes in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from pomona.amounts import amount

if TYPE_CHECKING:
    from pomona.orchard import Change

EVENTS = {"joined": "joined", "split": "split off as", "moved": "moved to"}

orchard_argument = typer.Argument(metavar="ORCHARD", help="The map (.gpkg).")


def change_as_text(change: Change) -> str:
    """Say which observations went from one fruit to another."""
    count = amount(change.n_observations, "observation")
    return f"  fruit {change.from_fruit_id}: {count} {EVENTS[change.event]} fruit {change.to_fruit_id}"
