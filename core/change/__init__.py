"""Across visits: limits of change, and the verdict on a difference (docs/science/change.md)."""

from core.change.limits import (
    ChangeLimit,
    Repeatability,
    detectable,
    detectable_ratio,
    relevant,
    repeatability,
)
from core.change.verdict import (
    UNLIKE,
    Change,
    parameter_changes,
    ratio_changes,
    score_changes,
    score_name,
    unjudged,
)

__all__ = [
    "UNLIKE",
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
    "unjudged",
]
