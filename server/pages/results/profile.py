"""Movement profile of a walk on pages: sagittal score and bars of the curves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sagittal.core.frames import SIDES
from sagittal.server.report.view.model import ReportModel
from sagittal.server.report.view.profile import ProfileBar, bar_svg
from sagittal.server.report.words.change_words import NO_LIMIT, ChangeWords, find_term, format_difference
from sagittal.server.report.words.wording import format_number
from sagittal.server.results import reports
from sagittal.server.results.reviewed import ReviewedAnalyses


def view_profile(
    reviewed: ReviewedAnalyses, model: ReportModel, context: Mapping[str, Any], bar_height: int
) -> tuple[dict[str, Any] | None, list[dict[str, Any]]]:
    """Sagittal score and bars of the curves, with the previous visit; None, [] without curves."""
    if model.profile is None or model.quality.kind == "bad":
        return None, []
    earlier, previous = None, context.get("before")
    if previous is not None and model.since is not None:
        _, old = reports.read(reviewed, previous.found, previous.edits, context["patient"], previous.session)
        earlier = old.profile
    earlier_bars = {} if earlier is None else {b.title: b for b in earlier.bars}
    bars = [
        {"title": b.title, "svg": bar_svg(b, earlier_bars.get(b.title), bar_height), **_print_sides(b)}
        for b in model.profile.bars
    ]
    score = model.profile.score
    if score is None:
        return None, bars
    was = None if earlier is None else earlier.score
    matched = model.profile.score_at_speed
    return {
        **_print_sides(score),
        "title": score.title,
        "at_speed": None if matched is None else _print_sides(matched),
        "healthy": None if score.p95 is None else format_number(score.p95, 1),
        "before": None if was is None else tuple(_print_sides(was).values()),
        "change": () if was is None else _change_score(was, score),
    }, bars


def _print_sides(bar: ProfileBar) -> dict[str, str]:
    return {side: format_number(bar.values[side], 1) if side in bar.values else "–" for side in SIDES}


def _change_score(previous: ProfileBar, now: ProfileBar) -> tuple[ChangeWords, ...]:
    """Both values of each side; not assessed, as no limit has been published."""
    term = find_term("gps_sagittal_deg")
    return tuple(
        ChangeWords(
            side, format_difference(now.values[side] - previous.values[side], term), "none", NO_LIMIT, ()
        )
        for side in SIDES
        if side in now.values and side in previous.values
    )
