"""The day of the harvest, as a user says it."""

from __future__ import annotations

from datetime import date

from pomona.errors import PomonaError
from pomona.reading import shown

__all__ = ["harvest_day"]


def harvest_day(text: str | None) -> date | None:
    """Read a day; None stays none.

    Raises
    ------
    PomonaError
        When it is no day of the calendar.
    """
    try:
        return None if text is None else date.fromisoformat(text)
    except ValueError:
        raise PomonaError(f"--harvest: found {shown(text)}, expected a day as 2024-09-10") from None
