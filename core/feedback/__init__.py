"""Biofeedback: a prescription and strides → cues (docs/science/feedback.md)."""

from __future__ import annotations

from sagittal.core.feedback.baseline import Baseline
from sagittal.core.feedback.cue import Cue, FeedbackState, GuardState, SideEffect, Summary, Tone
from sagittal.core.feedback.engine import Command, FeedbackEngine
from sagittal.core.feedback.prescription import (
    Prescription,
    Progression,
    Schedule,
    SideEffectGuard,
    StopRule,
    Target,
)
from sagittal.core.feedback.stride import StrideLike
from sagittal.core.feedback.summary import AnalysedStride, FeedbackSplit, split

__all__ = [
    "AnalysedStride",
    "Baseline",
    "Command",
    "Cue",
    "FeedbackEngine",
    "FeedbackSplit",
    "FeedbackState",
    "GuardState",
    "Prescription",
    "Progression",
    "Schedule",
    "SideEffect",
    "SideEffectGuard",
    "StopRule",
    "StrideLike",
    "Summary",
    "Target",
    "Tone",
    "split",
]
