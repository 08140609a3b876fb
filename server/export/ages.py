"""Which ages leave the clinic beside a pseudonym."""

from __future__ import annotations

from typing import Final

OLDEST: Final = 89
"""Who is as old or older is not told apart: there are few of them."""


def coarsen_age(age: int | None) -> int | None:
    """The age in years, at most that of the oldest who are told apart from others; None = not known."""
    return None if age is None else min(age, OLDEST)
