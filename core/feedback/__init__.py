"""Biofeedback: a prescription and strides → cues (spec/clinic.md §4, field.md §1n, fusion.md §7)."""

from __future__ import annotations

from core.feedback.cue import Cue, FeedbackState, GuardState, SideEffect, Summary, Tone
from core.feedback.prescription import (
    PARAMETERS,
    Baseline,
    Guard,
    Prescription,
    Progression,
    Schedule,
    StopRule,
    Target,
)

__all__ = [
    "PARAMETERS",
    "Baseline",
    "Cue",
    "FeedbackState",
    "Guard",
    "GuardState",
    "Prescription",
    "Progression",
    "Schedule",
    "SideEffect",
    "StopRule",
    "Summary",
    "Target",
    "Tone",
]
