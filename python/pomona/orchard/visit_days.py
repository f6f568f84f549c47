"""Which days a visit to a map can have: a slip of a digit would else stay in the map, and growth be counted by it."""

from __future__ import annotations

from datetime import date, datetime, timedelta

from pomona.errors import PomonaError

__all__ = ["require_visit_day"]

FIRST = date(2000, 1, 1)
"""A camera's clock that says less was never set, and `0024-08-09` is a slip."""

SET = date(2026, 1, 1)
"""This computer's clock, too, was never set where it says less, as on a robot without a battery: it asks nothing."""

AHEAD = timedelta(days=1)
"""By so much an orchard's day may be ahead of this computer's, in another time zone."""


def require_visit_day(day: str, source: str) -> None:
    """Refuse a date, as `iso_date` gives it, on which nobody can have been there; `source` says whose it is."""
    today = date.today()
    last = today + AHEAD if today >= SET else date.max
    if not FIRST <= datetime.fromisoformat(day).date() <= last:
        raise PomonaError(
            f"{source}: found the date {day!r}, expected a day from {FIRST} to today, {today} by this computer's clock"
        )
