"""The one catalogue of parameters: what each is, its unit, words, reference and limits, in the tables' order.

Reports, forms, the API's documentation, files, docs/parameters.md and the live pages read it; nothing else
declares a parameter. docs/contributing.md says how to add one.
"""

from __future__ import annotations

from typing import Final

from core.parameters.catalogue import (
    angles,
    daily,
    distances,
    functional,
    phases,
    squat,
    support,
    times,
    trunk,
    walking,
)
from core.parameters.catalogue.entry import (
    NEEDS,
    Comparison,
    CurveFigure,
    Need,
    NormKey,
    ParameterEntry,
    Scope,
    unit_of,
)

CATALOGUE: Final[dict[str, ParameterEntry]] = {
    entry.name: entry
    for part in (distances, times, phases, angles, walking, trunk, support, squat, functional, daily)
    for entry in part.ENTRIES
}
"""Parameter name → its entry, in the order of the tables. Read at every call, so that a test may add one."""


def list_names(group: str, of: Scope = "stride") -> tuple[str, ...]:
    """Names of one group in the order of the tables: those of every stride, or those of the whole take."""
    return tuple(name for name, entry in CATALOGUE.items() if (entry.group, entry.of) == (group, of))


def list_trainable() -> tuple[str, ...]:
    """Parameters of a single stride that a prescription may train."""
    return tuple(name for name, entry in CATALOGUE.items() if entry.trainable)


def list_curve_figures() -> dict[str, CurveFigure]:
    """Parameters that are read from the cycle curves, and how."""
    return {name: entry.curve for name, entry in CATALOGUE.items() if entry.curve is not None}


def name_counted(name: str) -> str:
    """Name what a parameter is the mean of: "strides" unless the catalogue says otherwise."""
    entry = CATALOGUE.get(name)
    return "strides" if entry is None else entry.counted


__all__ = [
    "CATALOGUE",
    "NEEDS",
    "Comparison",
    "CurveFigure",
    "Need",
    "NormKey",
    "ParameterEntry",
    "Scope",
    "list_curve_figures",
    "list_names",
    "list_trainable",
    "name_counted",
    "unit_of",
]
