"""The day of the harvest, as a user says it."""

from __future__ import annotations

from datetime import date, datetime

from pomona.calendar_days import expected_day
from pomona.errors import PomonaError
from pomona.identity import SEASON_DAYS
from pomona.reading import shown

__all__ = ["harvest_after", "harvest_day"]


def harvest_day(told: date | str | None) -> date | None:
    """Read a day, or take one; None stays none.

    Raises
    ------
    PomonaError
        When it is no day of the calendar.
    """
    if told is None:
        return None
    if isinstance(told, date):
        return told.date() if isinstance(told, datetime) else told
    try:
        return date.fromisoformat(told)
    except (TypeError, ValueError):
        raise PomonaError(f"--harvest: found {shown(told)}, {expected_day(told, 'a day as 2024-09-10')}") from None


def harvest_after(last_visit: date, told: date | str | None) -> date | None:
    """Read a day of the season of a last visit; None stays none.

    Raises
    ------
    PomonaError
        When it is no day, lies before the visit, or in another season.
    """
    harvest = harvest_day(told)
    if harvest is not None and harvest < last_visit:
        raise PomonaError(f"--harvest: found {harvest}, expected the last visit's day or later: {last_visit}")
    if harvest is not None and (harvest - last_visit).days > SEASON_DAYS:
        raise PomonaError(
            f"--harvest: found {harvest}, expected a day of the same season, at most {SEASON_DAYS} days after the last "
            f"visit: {last_visit}"
        )
    return harvest
