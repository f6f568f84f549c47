"""The date that people put into the name of a recording."""

from __future__ import annotations

import datetime
import re

__all__ = ["date_in_name", "date_of_ns"]

EARLIEST_NS = 946_684_800 * 10**9
"""The year 2000: a clock that says less was never set."""

_ISO_DATE = re.compile(r"(\d{4}-\d{2}-\d{2})(?:[T_ ](\d{2})[:-]?(\d{2})(?:[:-]?(\d{2}))?)?")


def date_in_name(name: str) -> str | None:
    """Find an ISO 8601 date, with or without a time, as in `row 3 2024-08-09_141530`; None where there is none."""
    found = _ISO_DATE.search(name)
    if found is None:
        return None
    day, hour, minute, second = found.groups()
    text = day if hour is None else f"{day}T{hour}:{minute}:{second or '00'}"
    try:
        datetime.datetime.fromisoformat(text)
    except ValueError:
        return None
    return text


def date_of_ns(stamp_ns: int) -> str | None:
    """Give the day and time (UTC) of nanoseconds since 1970; None for a clock that began when the machine did."""
    if stamp_ns < EARLIEST_NS:
        return None
    return datetime.datetime.fromtimestamp(stamp_ns // 10**9, datetime.UTC).replace(tzinfo=None).isoformat()
