"""Across visits: limits of change with their sources, and the verdict on a difference (spec/clinic.md §2)."""

from core.change.limits import (
    ChangeLimit,
    Repeatability,
    detectable,
    detectable_ratio,
    relevant,
    repeatability,
)
from core.change.verdict import Change, parameter_changes, ratio_changes, score_changes, score_name

__all__ = [
    "Change",
    "ChangeLimit",
    "Repeatability",
    "detectable",
    "detectable_ratio",
    "parameter_changes",
    "ratio_changes",
    "relevant",
    "repeatability",
    "score_changes",
    "score_name",
]
