"""Wording of daily life: activities and transitions, durations, times of day and days.

Without a clock, hours and days are counted from the first sample.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Final

import numpy as np

from sagittal.core.activity.result import ActivityKind, ActivityResult, TransitionKind, TransitionRefusal
from sagittal.core.message import Message

DAY_S: Final = 86400.0
HOUR_S: Final = 3600.0

DASH: Final = "–"

KIND_LABELS: Final[Mapping[ActivityKind, str]] = {
    "lying": "Lying",
    "sitting": "Sitting",
    "standing": "Standing",
    "walking": "Walking",
    "stairs_up": "Stairs up",
    "stairs_down": "Stairs down",
    "unknown": "Unknown",
    "non_wear": "Not worn",
    "gap": "Not recorded",
}

KIND_WORDS: Final[Mapping[ActivityKind, str]] = {
    "lying": "trunk more than 70° from upright and still",
    "sitting": "after a stand-to-sit or before a sit-to-stand, no steps",
    "standing": "after a sit-to-stand, before a stand-to-sit, or between walks, no steps",
    "walking": "consecutive steps on level ground",
    "stairs_up": "experimental: walking with forward trunk inclination and sway",
    "stairs_down": "experimental: walking with strong trunk sway; most are missed",
    "unknown": "worn, but the signals are contradictory or inconclusive",
    "non_wear": "no movement for at least half an hour, not even breathing",
    "gap": "the device stored no samples",
}
"""Activity → how it is recognized, in the words of its definition (docs/science/activity.md)."""

WALKED: Final[tuple[ActivityKind, ...]] = ("walking", "stairs_up", "stairs_down")

TOTALS: Final[Mapping[str, tuple[ActivityKind, ...]]] = {
    "Lying": ("lying",),
    "Sitting": ("sitting",),
    "Standing": ("standing",),
    "Walking": WALKED,
    "Unknown": ("unknown",),
    "Not worn": ("non_wear",),
    "Not recorded": ("gap",),
}
"""Columns of the totals → activities they sum."""

TRANSITION_LABELS: Final[Mapping[TransitionKind, str]] = {
    "sit_to_stand": "Sit to stand",
    "stand_to_sit": "Stand to sit",
    "sit_to_lie": "Sit to lie",
    "lie_to_sit": "Lie to sit",
}

REFUSALS: Final[Mapping[TransitionRefusal, str]] = {
    "lean_below_limit": "below the limit: trunk inclination less than 20°",
    "chest_did_not_rise": "a bow: insufficient rise or fall of the chest",
    "direction_unclear": "direction unclear",
    "near_lying": "part of lying down or getting up",
    "while_walking": "amid walking",
}


def format_hours(minutes: float) -> str:
    """Format minutes as h:min, "7:40"."""
    whole = round(minutes)
    return f"{whole // 60}:{whole % 60:02d}"


def find_midnight(activity: ActivityResult, at_s: float) -> float:
    """Start of the day that contains a time, s from the first sample (negative on the first day of a
    clock).
    """
    return float(np.floor((at_s + _since_midnight(activity)) / DAY_S) * DAY_S - _since_midnight(activity))


def clock_label(activity: ActivityResult, at_s: float) -> str:
    """Time of day as "14:05", or hours and minutes since the first sample without a clock."""
    minutes = int((at_s + _since_midnight(activity)) // 60)
    return f"{minutes // 60 % 24:02d}:{minutes % 60:02d}"


def find_day_label(activity: ActivityResult, at_s: float) -> str:
    """Name of the day that contains a time, empty outside all days."""
    for i, d in enumerate(activity.days):
        if d.start_s <= at_s < d.end_s:
            return day_label(i, d.date)
    return ""


def day_label(number: int, date: dt.date | None) -> str:
    """Name a day by its date, "Mon 16 Nov", or by its number."""
    return Message("Day {number}", number=number + 1) if date is None else f"{date:%a} {date.day} {date:%b}"


def _since_midnight(activity: ActivityResult) -> float:
    start = activity.started_at
    return (
        0.0
        if start is None
        else start.hour * HOUR_S + start.minute * 60.0 + start.second + start.microsecond * 1e-6
    )
