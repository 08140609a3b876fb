"""What no person can do: a number beyond is an error of detection and reaches no table."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, radians
from typing import Final

IMPOSSIBLE: Final = "impossible"
"""Reason of a value that was found and is not told."""

LIMITS: Final[Mapping[str, tuple[float, float]]] = {
    "step_time_s": (0.2, inf),
    "cadence_spm": (0.0, 240.0),
}
"""Parameter → least and greatest value. Sprinters take up to 290 steps a minute, nobody walks at 240."""

LEAST_KNEE: Final = radians(-20.0)
"""Knee flexion from the anatomical zero: beyond, a knee that walks is torn. From standing it is asked for
where nobody entered the standing angle: who stands with bent knees walks with them bent."""


def impossible(name: str, value: float) -> bool:
    """Tell whether no person can have this value of a parameter."""
    low, high = LIMITS.get(name, (-inf, inf))
    return value < low or value > high
