"""Across visits: limits of change, and the verdict on a difference (docs/science/change.md)."""

from sagittal.core.change.facts import ChangedFact, SortedChanges, name_fact, sort_changes
from sagittal.core.change.limits import (
    ChangeLimit,
    Repeatability,
    detectable_ratio,
    estimate_repeatability,
    find_detectable_change,
    find_relevant_change,
)
from sagittal.core.change.verdict import (
    NOT_MEASURED_ALIKE,
    UNLIKE,
    Change,
    parameter_changes,
    ratio_changes,
    score_changes,
    score_name,
    withdraw_verdicts,
)

__all__ = [
    "NOT_MEASURED_ALIKE",
    "UNLIKE",
    "Change",
    "ChangeLimit",
    "ChangedFact",
    "Repeatability",
    "SortedChanges",
    "detectable_ratio",
    "estimate_repeatability",
    "find_detectable_change",
    "find_relevant_change",
    "name_fact",
    "parameter_changes",
    "ratio_changes",
    "score_changes",
    "score_name",
    "sort_changes",
    "withdraw_verdicts",
]
