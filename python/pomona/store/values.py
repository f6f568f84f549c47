"""What a date and a length may be, in memory as in the files."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date, datetime

from pomona.calendar_days import expected_day
from pomona.errors import PomonaError

__all__ = ["FARTHEST_M", "FREE", "is_scale_free", "iso_date"]

FARTHEST_M = 1e12
"""Nothing that grows is farther from anything than the planets; squares of such numbers can still be added."""


FREE = "free"
"""What `configuration["scan"]["scale"]` of a session says whose scale nobody knows."""


def is_scale_free(configuration: object) -> bool:
    """Tell whether a session of this configuration has no metres."""
    scan = configuration.get("scan") if isinstance(configuration, Mapping) else None
    return isinstance(scan, Mapping) and scan.get("scale") == FREE


def iso_date(day: str | date, source: str = "session") -> str:
    """Return a local date, or date and time, as files hold it; refuse anything else of a source."""
    text = day.isoformat() if isinstance(day, date) else day
    try:
        moment = datetime.fromisoformat(text)
    except (TypeError, ValueError):
        expected = expected_day(text, "ISO 8601 as 2021-09-27 or 2021-09-27T11:40:12")
        raise PomonaError(f"{source}: found the date {text!r}, {expected}") from None
    if moment.tzinfo is not None:
        # Dates are ordered as text, which zones would break; growth is counted in the orchard's days.
        raise PomonaError(f"{source}: found the date {text!r} with a time zone, expected the orchard's local time")
    return moment.date().isoformat() if len(text) <= len("2021-09-27") else moment.isoformat()
