"""Physiological limits of parameters: values outside are detection errors and are not reported."""

from __future__ import annotations

from math import radians
from typing import Final

from sagittal.core.parameters.catalogue import CATALOGUE

IMPOSSIBLE: Final = "impossible"
"""Reason of a value that was found and is not told."""

LEAST_KNEE: Final = radians(-20.0)
"""Knee flexion from the anatomical zero: beyond, a knee that walks is torn. From standing it is asked for
where nobody entered the standing angle: who stands with bent knees walks with them bent."""


def is_impossible(name: str, value: float) -> bool:
    """Whether a value of a parameter is physiologically impossible."""
    entry = CATALOGUE.get(name)
    return entry is not None and (value < entry.plausible[0] or value > entry.plausible[1])
