"""The single catalogue of parameters: definition, unit, texts, reference and limits, in the order of the
tables.

Used by reports, forms, API documentation, files, docs/reference/parameters.md and the live pages; parameters
are declared nowhere else. docs/how-to/contributing.md explains how to add one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from sagittal.core.parameters.catalogue import (
    angles,
    daily,
    distances,
    functional,
    limit_figures,
    phases,
    squat,
    support,
    times,
    trunk,
    walking,
)
from sagittal.core.parameters.catalogue.entry import (
    NEEDS,
    Comparison,
    CurveFigure,
    Need,
    NormKey,
    ParameterEntry,
    Scope,
    unit_of,
)


def index_entries(entries: Iterable[ParameterEntry]) -> dict[str, ParameterEntry]:
    """Index entries by name; ValueError for a duplicate name."""
    index: dict[str, ParameterEntry] = {}
    for entry in entries:
        if entry.name in index:
            raise ValueError(f"The catalogue has two entries of the name {entry.name}.")
        index[entry.name] = entry
    return index


CATALOGUE: Final[dict[str, ParameterEntry]] = index_entries(
    entry
    for part in (distances, times, phases, angles, walking, trunk, support, squat, functional, daily)
    for entry in part.ENTRIES
)
"""Parameter name → its entry, in the order of the tables. Read at every call, so that a test may add one."""

LIMIT_FIGURES: Final[dict[str, ParameterEntry]] = index_entries(limit_figures.ENTRIES)
"""Figures without a row in the tables: the rules of core/flags compare them with limits."""

index_entries((*CATALOGUE.values(), *LIMIT_FIGURES.values()))


def find_entry(name: str) -> ParameterEntry | None:
    """The entry of a parameter or of a value used only in a rule; None for an unknown name."""
    return CATALOGUE.get(name) or LIMIT_FIGURES.get(name)


def require_entries(names: Iterable[str], user: str) -> None:
    """Check that a registry uses only names of the catalogue.

    Called where the registry is built, so that an unknown name fails at import and not on a page.

    Parameters
    ----------
    user : name of the registry, for the message.

    Raises
    ------
    ValueError With the registry and every name without an entry.
    """
    unknown = sorted({name for name in names if find_entry(name) is None})
    if unknown:
        raise ValueError(
            f"{user} uses figures that core/parameters/catalogue does not have: {', '.join(unknown)}."
        )


def list_names(group: str, scope: Scope = "stride") -> tuple[str, ...]:
    """Names of one group in the order of the tables: per stride, or for the whole recording."""
    return tuple(name for name, entry in CATALOGUE.items() if (entry.group, entry.of) == (group, scope))


def list_trainable() -> tuple[str, ...]:
    """Parameters of a single stride that can be trained."""
    return tuple(name for name, entry in CATALOGUE.items() if entry.trainable)


def list_curve_figures() -> dict[str, CurveFigure]:
    """Parameters read from the cycle curves, and how."""
    return {name: entry.curve for name, entry in CATALOGUE.items() if entry.curve is not None}


def name_counted(name: str) -> str:
    """The unit of counting for a parameter's mean: "strides" unless the catalogue defines another."""
    entry = CATALOGUE.get(name)
    return "strides" if entry is None else entry.counted


__all__ = [
    "CATALOGUE",
    "LIMIT_FIGURES",
    "NEEDS",
    "Comparison",
    "CurveFigure",
    "Need",
    "NormKey",
    "ParameterEntry",
    "Scope",
    "find_entry",
    "index_entries",
    "list_curve_figures",
    "list_names",
    "list_trainable",
    "name_counted",
    "require_entries",
    "unit_of",
]
