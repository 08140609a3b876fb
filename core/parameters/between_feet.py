"""Parameters measured between the contacts of both feet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sagittal.core.parameters.catalogue import require_entries
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import summarise_values

BETWEEN_FEET: Final = frozenset(
    {
        "cadence_spm",
        "step_time_s",
        "step_length_m",
        "double_support_s",
        "double_support_pct",
        "initial_double_support_s",
        "initial_double_support_pct",
        "terminal_double_support_s",
        "terminal_double_support_pct",
        "single_support_s",
        "single_support_pct",
    }
)
require_entries(BETWEEN_FEET, "core.parameters.between_feet")


def withhold_between_feet(parameters: Sequence[Parameter], reason: str) -> tuple[Parameter, ...]:
    """The same parameters, with the values of those that need the contacts of both feet suppressed."""
    return tuple(
        summarise_values(p.name, p.side, [], p.unit, reason)
        if p.name in BETWEEN_FEET and p.mean is not None
        else p
        for p in parameters
    )
