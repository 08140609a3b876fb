"""Coarsening of ages in pseudonymized exports."""

from __future__ import annotations

from typing import Final

OLDEST: Final = 89
"""Ages from here on are not distinguished, as there are few such patients."""


def coarsen_age(age: int | None) -> int | None:
    """Age in years, capped at the oldest age exported; None = unknown."""
    return None if age is None else min(age, OLDEST)
