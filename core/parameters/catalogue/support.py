"""Double and single support in seconds (core/parameters/temporal.py)."""

from __future__ import annotations

from typing import Final

from sagittal.core.parameters.catalogue import errors
from sagittal.core.parameters.catalogue.entry import DURATION, SUPPORT, ParameterEntry

ENTRIES: Final = (
    ParameterEntry(
        "double_support_s",
        label="Double support time",
        group=SUPPORT,
        digits=2,
        scale=(0, 0.8),
        comparison=DURATION,
        definition="Time with both feet on the floor in a stride.",
        needs=("other_foot", "foot_off"),
        trainable=True,
        shared=True,
        errors=errors.DOUBLE,
    ),
    ParameterEntry(
        "initial_double_support_s",
        label="Initial double support time",
        group=SUPPORT,
        digits=2,
        scale=(0, 0.4),
        comparison=DURATION,
        definition="From contact to the other foot's foot-off.",
        needs=("other_foot", "foot_off"),
        trainable=True,
        errors=errors.INITIAL,
    ),
    ParameterEntry(
        "terminal_double_support_s",
        label="Terminal double support time",
        group=SUPPORT,
        digits=2,
        scale=(0, 0.4),
        comparison=DURATION,
        definition="From the other foot's contact to foot-off.",
        needs=("other_foot", "foot_off"),
        trainable=True,
        errors=errors.TERMINAL,
    ),
    ParameterEntry(
        "single_support_s",
        label="Single support time",
        group=SUPPORT,
        digits=2,
        scale=(0.2, 0.8),
        comparison=DURATION,
        definition="From the other foot's foot-off to its contact.",
        needs=("other_foot", "foot_off"),
        trainable=True,
        better="higher",
        errors=errors.SINGLE,
    ),
)
