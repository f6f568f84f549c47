"""What is said of a date that cannot be one: that it is written otherwise, or that the calendar has no such day."""

from __future__ import annotations

import re
from datetime import date

__all__ = ["expected_day"]

_WRITTEN_AS_DAY = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})(?!\d)")
"""How a date begins that is written as one, whatever time of day comes after it."""


def expected_day(found: object, otherwise: str) -> str:
    """Say what was expected in place of something that is no date.

    Who wrote 2024-02-30 knows how dates are written, and looks for a slip in its form in vain.
    """
    written = _WRITTEN_AS_DAY.match(found.strip()) if isinstance(found, str) else None
    if written is not None:
        try:
            date(*map(int, written.groups()))
        except ValueError:
            return "expected a day of the calendar: there is no such day"
    return f"expected {otherwise}"
