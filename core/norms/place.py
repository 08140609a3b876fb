"""Where a value stands among reference people: z and percentile."""

from __future__ import annotations

from math import erf, sqrt


def percentile_of_z(z: float) -> float:
    """Share in % of a normal population below z standard deviations."""
    return 50.0 * (1.0 + erf(z / sqrt(2.0)))
