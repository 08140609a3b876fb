"""Daily life in words and drawings, against a day whose every minute is known."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.activity.result import ActivityBout, ActivityKind
from sagittal.server.report.files.activity_files import read_activity, write_activity
from sagittal.server.report.view.daily_charts import CSS, inclination_svg, ribbon_svg, steps_svg
from sagittal.server.report.view.daily_life import (
    DailyLifeView,
    bin_bouts,
    daily_life_view,
    inclination_course,
)
from tests.server import daily


def view(days: float = 2.0, *, clock: bool = True) -> DailyLifeView:
    result = daily_life_view(daily.live(days, clock=clock))
    assert result is not None
    return result


def test_totals_of_every_day_are_those_that_were_lived() -> None:
    result = view(2.0)
    first, whole, last = result.days
    assert [d.label for d in result.days] == ["Mon 16 Nov", "Tue 17 Nov", "Wed 18 Nov"]
    assert (first.part, whole.part, last.part) == ("18:00–24:00", "", "00:00–18:00")
    assert whole.times == {
        "Lying": "8:00", "Sitting": "7:54", "Standing": "5:59", "Walking": "0:37", "Unknown": "0:30",
        "Not worn": "1:00", "Not recorded": "0:00",
    }  # fmt: skip
    assert (whole.worn, whole.steps, whole.bouts, whole.longest) == ("23:00", "3690", "4", "30.0")
    # six hours of the first day are below ten, so the mean is of the two others
    assert [d.counted for d in result.days] == [False, True, True]
    assert result.mean is not None
    assert result.mean.label == "Mean of 2 days"
    assert result.columns == ("Lying", "Sitting", "Standing", "Walking", "Unknown", "Not worn")


def test_without_a_day_worn_long_enough_there_is_no_mean() -> None:
    assert view(0.3).mean is None


def test_a_day_that_was_not_worn_has_no_steps_not_nought() -> None:
    live_result = daily.live(2.0)
    off = replace(live_result.days[1], worn_h=0.0, steps=0, bouts=0, longest_bout_s=None)
    visible_rows = daily_life_view(replace(live_result, days=(live_result.days[0], off, live_result.days[2])))
    assert visible_rows is not None
    assert (visible_rows.days[1].steps, visible_rows.days[1].bouts, visible_rows.days[1].longest) == (
        "–",
        "–",
        "–",
    )
    assert ">–</text>" in steps_svg(visible_rows.found, visible_rows.days)


def test_without_a_clock_days_count_from_the_first_sample() -> None:
    result = view(1.5, clock=False)
    assert [d.label for d in result.days] == ["Day 1", "Day 2"]
    assert [d.midnight_s for d in result.days] == [0.0, 86400.0]
    assert result.days[1].part == "first 12:00 h"
    assert [h.label for h in result.hours[:3]] == ["00:00", "01:00", "02:00"]


def test_hours_add_up_to_their_length() -> None:
    for h in view(1.0).hours:
        assert sum(int(minutes) for minutes in h.times.values()) == pytest.approx(60, abs=2)


@pytest.mark.parametrize(
    ("seconds", "label"),
    [
        (5, "below 10\u202fs"),
        (10, "10–20\u202fs"),
        (45, "30–60\u202fs"),
        (60, "1–2\u202fmin"),
        (700, "10\u202fmin or longer"),
    ],
)
def test_a_walk_falls_into_the_bin_of_its_length(seconds: float, label: str) -> None:
    steps = round(2 * seconds)
    bins = bin_bouts([ActivityBout(100.0, 100.0 + seconds, "walking", steps, 0, 0, 120.0)])
    assert [(b.label, b.steps, b.cadence) for b in bins if b.bouts] == [(label, steps, "120")]
    assert sum(b.minutes for b in bins) == pytest.approx(seconds / 60.0)


def test_transitions_are_counted_and_candidates_say_why_not() -> None:
    result = view(2.0)
    rising = result.transitions[0]
    assert (rising.label, rising.total, rising.lean, rising.rise) == (
        "Sit to stand",
        sum(rising.per_day),
        "36",
        "0.40",
    )
    assert rising.per_day[1] == 4
    lying = result.transitions[2]
    assert (lying.total, lying.lean, lying.rise) == (0, "–", "–")
    first = next(e for e in result.events if not e.counts)
    assert (first.when, first.label) == ("Mon 16 Nov 18:50", "Sit to stand?")
    assert "less than 20°" in first.status


def test_inclination_of_each_posture_is_what_was_held() -> None:
    visible_by_label = {row.label: row.median for row in view(1.0).leans}
    assert visible_by_label == {"Sitting": "6", "Standing": "1", "Walking": "3", "Stairs up": "12"}


def test_unknown_inclination_is_a_reason_not_nought() -> None:
    live_result = daily.live(1.0)
    blind = replace(live_result, inclination_deg=np.full(len(live_result.inclination_deg), np.nan))
    visible_rows = daily_life_view(blind)
    assert visible_rows is not None
    assert visible_rows.leans == ()
    assert "the forward direction" in (visible_rows.lean_reason or "")
    assert 'class="mb"' not in inclination_svg(blind, visible_rows.days[0])


def test_the_course_of_inclination_is_the_middle_of_its_window() -> None:
    live_result = daily.live(0.1)
    values = live_result.inclination_deg.copy()
    values[:600] = np.linspace(-10.0, 30.0, 600)
    values[600:1200] = np.nan
    t_s, course = inclination_course(
        replace(live_result, inclination_deg=values), 0.0, live_result.duration_s
    )
    assert t_s[:2].tolist() == [0.0, 600.0]
    assert course[0] == pytest.approx([-6.0, 10.0, 26.0], abs=0.1)
    assert np.isnan(course[1]).all()


def drawn_hours(svg: str, kind: ActivityKind) -> float:
    """How many hours of the ribbon have the fill of this kind."""
    path = re.search(rf'<path class="{CSS[kind]}" d="([^"]*)"', svg)
    return 0.0 if path is None else sum(map(float, re.findall(r"h([\d.]+)", path[1]))) * 24 / 1000


def test_the_ribbon_draws_every_kind_for_as_long_as_it_lasted() -> None:
    live_result = daily.live(2.0)
    visible_days = view(2.0).days[1]
    svg = ribbon_svg(live_result, visible_days)
    lived: dict[ActivityKind, float] = {"lying": 8.0, "sitting": 7.895, "standing": 5.99, "walking": 0.605}
    for kind, hours in lived.items():
        assert drawn_hours(svg, kind) == pytest.approx(hours, abs=0.02)
    wide = {p: float(w) for p, w in re.findall(r'fill="url\(#(ap-\w+)\)" x="[\d.]+%" width="([\d.]+)%"', svg)}
    assert wide == pytest.approx({"ap-unknown": 50 / 24, "ap-off": 100 / 24, "ap-up": 0.0347}, abs=0.04)
    # heights tell the kinds apart without their colours
    tops = {
        k: re.search(rf'class="{CSS[k]}" d="M[\d.]+ 1000V(\d+)', svg)
        for k in ("lying", "sitting", "standing", "walking")
    }
    assert [int(m[1]) for m in tops.values() if m] == [750, 500, 250, 0]


def test_the_first_day_begins_where_the_recording_begins() -> None:
    svg = ribbon_svg(daily.live(2.0), view(2.0).days[0])
    standing = re.search(rf'class="{CSS["standing"]}" d="M([\d.]+) ', svg)
    assert standing is not None
    assert float(standing[1]) == pytest.approx(750.0, abs=0.5)


def test_short_days_are_dashed_among_steps() -> None:
    live_result = daily.live(2.0)
    assert steps_svg(live_result, view(2.0).days).count('class="bar part"') == 1
    assert "Steps per hour" in steps_svg(daily.live(0.2), view(0.2).days)


def test_what_is_stored_reads_back_to_the_same_view() -> None:
    live_result = daily.live(1.0)
    back = daily_life_view(read_activity(write_activity(live_result)))
    now = daily_life_view(live_result)
    assert back is not None
    assert now is not None
    assert back.to_json() == now.to_json()
    assert back.days == now.days
    assert back.leans == now.leans
