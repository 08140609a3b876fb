"""Template context of daily life for session page, week report and trends page."""

from __future__ import annotations

from typing import Any, Final

from sagittal.core.activity.parameters import WORN_H
from sagittal.core.activity.result import KINDS
from sagittal.server.report.view.daily_charts import (
    bouts_svg,
    inclination_svg,
    kind_swatch,
    ribbon_svg,
    steps_svg,
)
from sagittal.server.report.view.daily_life import EVENTS_SHOWN, DailyLifeView
from sagittal.server.report.words.daily_words import KIND_LABELS, KIND_WORDS, format_hours

DAYS_A_SHEET: Final = 7
"""Days per page of the printed report."""

TEMPLATES: Final = {"session.html": "daily.html", "print.html": "daily-print.html"}
"""Page of a walk → page of daily life."""


def draw_daily(view: DailyLifeView | None) -> dict[str, Any] | None:
    """Template context of daily life, with charts rendered."""
    if view is None:
        return None
    result = view.found
    days = [
        {"totals": d, "ribbon": ribbon_svg(result, d), "lean": inclination_svg(result, d)} for d in view.days
    ]
    kinds_present = [k for k in KINDS if result.minutes(k) > 0.0]
    return {
        "view": view,
        "days": days,
        "sheets": [days[i : i + DAYS_A_SHEET] for i in range(0, len(days), DAYS_A_SHEET)],
        "legend": [(kind_swatch(k), KIND_LABELS[k]) for k in kinds_present],
        "definitions": [
            (KIND_LABELS[k], KIND_WORDS[k], format_hours(result.minutes(k))) for k in kinds_present
        ],
        "bouts": bouts_svg(view.bins),
        "steps": steps_svg(result, view.days),
        "steps_title": "Steps per day" if len(days) > 1 else "Steps per hour",
        "stairs": any(result.minutes(k) for k in ("stairs_up", "stairs_down")),
        "worn_h": f"{WORN_H:.0f}",
        "events_shown": EVENTS_SHOWN,
    }
