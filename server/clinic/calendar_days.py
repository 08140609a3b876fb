"""Validation of calendar days for programmes, planned visits and notes; catches mistyped years."""

from __future__ import annotations

import datetime as dt
from typing import Final

from sagittal.core.message import Message
from sagittal.server.errors import ServiceError
from sagittal.server.storage.schema.tables import now

FIRST: Final = dt.date(1900, 1, 1)
AHEAD: Final = dt.timedelta(days=3653)
"""Maximum of ten years ahead (our choice)."""


def require_day(day: dt.date) -> dt.date:
    """Return the day; raises ServiceError bad_value if before 1900 or more than ten years ahead."""
    last = now().date() + AHEAD
    if FIRST <= day <= last:
        return day
    raise ServiceError(
        "bad_value",
        Message(
            "The day is {isoformat}. Expected one from {FIRST} to {last}; check the year.",
            isoformat=day.isoformat(),
            FIRST=FIRST,
            last=last,
        ),
    )


def move_years(day: dt.date, years: int) -> dt.date:
    """The same day a number of years later, or earlier if negative; 29 February becomes 28 if necessary."""
    try:
        return day.replace(year=day.year + years)
    except ValueError:
        return day.replace(year=day.year + years, day=28)
