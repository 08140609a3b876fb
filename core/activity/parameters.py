"""Daily-life parameters: means over the days with sufficient wear time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sagittal.core.activity.result import ActivityDay, ActivityResult
from sagittal.core.parameters.catalogue import list_names, unit_of
from sagittal.core.parameters.catalogue.entry import DAILY
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import summarise_values

MEASURES: Final = list_names(DAILY, "take")
"""Names in the order of the table."""

WORN_H: Final = 10.0
"""A day counts when the sensor was worn for so long: customary for accelerometers [our choice]."""


def measure_day(activity: ActivityResult) -> tuple[Parameter, ...]:
    """Steps, times and transitions per day; without a day of sufficient wear time the reason is
    `no_whole_day`.
    """
    days = [d for d in activity.days if d.worn_h >= WORN_H]
    values = _measure(days)
    return tuple(
        summarise_values(name, None, values[name], unit_of(name), "no_whole_day") for name in MEASURES
    )


def _measure(days: Sequence[ActivityDay]) -> dict[str, list[float]]:
    walked = [d.minutes["walking"] + d.minutes["stairs_up"] + d.minutes["stairs_down"] for d in days]
    return {
        "daily_step_count": [float(d.steps) for d in days],
        "daily_walking_min": walked,
        "daily_standing_min": [d.minutes["standing"] for d in days],
        "daily_sitting_min": [d.minutes["sitting"] for d in days],
        "daily_lying_min": [d.minutes["lying"] for d in days],
        "daily_rise_count": [float(d.transitions["sit_to_stand"]) for d in days],
        "daily_bout_count": [float(d.bouts) for d in days],
        "daily_longest_bout_min": [(d.longest_bout_s or 0.0) / 60.0 for d in days],
    }
