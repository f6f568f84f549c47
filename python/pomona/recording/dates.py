"""The date that people put into the name of a recording."""

from __future__ import annotations

import datetime
import re

__all__ = ["date_in_name"]

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
