"""Parameters that are suppressed if a consistency law is violated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sagittal.core.consistency.doubt import Doubt
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


def withhold_doubtful(parameters: Sequence[Parameter], doubts: Sequence[Doubt]) -> tuple[Parameter, ...]:
    """The same parameters, with the values that a violated law makes unreliable suppressed."""
    for doubt in doubts:
        parameters = tuple(
            summarise_values(p.name, p.side, [], p.unit, doubt.notice.code)
            if p.mean is not None and _concerns(doubt, p.name)
            else p
            for p in parameters
        )
    return tuple(parameters)


def _concerns(doubt: Doubt, name: str) -> bool:
    return doubt.scope == "all" or (doubt.scope == "between_feet" and name in BETWEEN_FEET)
