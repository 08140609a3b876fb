"""Trends compare assessments with the first one; trainings are shown without a verdict."""

from __future__ import annotations

import csv
import datetime as dt
import io
import json
import re
from dataclasses import asdict, replace

import pytest
from defusedxml import ElementTree

from sagittal.core.norms import look_up_norms, temporal_values
from sagittal.core.parameters.result import Parameter
from sagittal.core.subject.condition import USUAL
from sagittal.server.report.history.numbers import Numbers, read_numbers
from sagittal.server.report.history.trend_chart import PlannedAssessment, trend_svg, value_range
from sagittal.server.report.history.trend_strip import trend_strip
from sagittal.server.report.history.trends import AnalysedVisit, Trend, VisitKind, follow_figures, names_in
from sagittal.server.report.tables import trends_csv
from sagittal.server.report.words.change_words import change_words

DAY = dt.date(2026, 3, 2)


def speed(value: float | None, half: float = 0.01) -> Parameter:
    ends = (None, None) if value is None else (value - half, value + half)
    return Parameter("gait_speed_mps", None, 40, value, 0.05, "m/s", ci_low=ends[0], ci_high=ends[1])


def step(side: str, value: float) -> Parameter:
    return Parameter("step_length_m", side, 40, value, 0.02, "m", ci_low=value, ci_high=value)  # type: ignore[arg-type]


def visit(
    days: int,
    *parameters: Parameter,
    label: str | None = None,
    kind: VisitKind = "assessment",
    feedback: bool = False,
) -> AnalysedVisit:
    day = DAY + dt.timedelta(days=days)
    walked = replace(USUAL, feedback=feedback)
    return AnalysedVisit(
        f"s{days}", day, "Walk", label, kind, walked, Numbers(parameters, (), ("ok", "Good data"))
    )


def one(*visits: AnalysedVisit, name: str = "gait_speed_mps") -> Trend:
    (result,) = follow_figures(visits, [name])
    return result


@pytest.mark.parametrize(
    ("after", "verdict"),
    [(0.70, "within_measurement_error"), (0.775, "real_change"), (0.90, "clinically_relevant")],
)
def test_the_last_assessment_is_judged_against_the_first(after: float, verdict: str) -> None:
    # 0.62 m/s: MDC 0.15 (Lewek 2019); MCID 0.16 (Tilson 2010)
    line = one(visit(0, speed(0.62)), visit(28, speed(0.75)), visit(60, speed(after))).lines[0]
    assert (line.mdc, line.mcid) == (0.15, 0.16)
    assert line.change is not None
    assert (line.change.before, line.change.after) == (0.62, after)
    assert line.change.verdict == verdict


def test_a_training_is_never_judged() -> None:
    line = one(visit(0, speed(0.62)), visit(2, speed(1.2), kind="training", label="T1")).lines[0]
    assert line.latest is None
    assert line.change is None
    assert len(line.points) == 2


def test_trainings_alone_are_no_base() -> None:
    visits = [visit(d, speed(v), kind="training", label=f"T{d}") for d, v in ((0, 0.62), (2, 1.2))]
    trend = one(*visits)
    line = trend.lines[0]
    assert (line.base, line.latest, line.mdc, line.mcid) == (None, None, None, None)
    assert [p.change for p in line.points] == [None, None]
    assert 'class="mdc"' not in trend_svg(trend, line, visits)


def test_a_walk_with_feedback_is_a_small_mark_without_a_change() -> None:
    visits = visit(0, speed(0.62)), visit(2, speed(1.2), kind="training", feedback=True), visit(9, speed(0.7))
    trend = one(*visits)
    line = trend.lines[0]
    assert (line.base, line.latest) == (0, 2)
    assert line.points[1].change is None
    assert line.change is not None
    assert line.change.after == 0.7
    chart = trend_svg(trend, line, visits)
    assert (chart.count('class="pl-b"'), chart.count('class="ps-b"')) == (2, 1)


def test_the_band_stands_before_there_is_anything_to_compare() -> None:
    line = one(visit(0, speed(0.62))).lines[0]
    assert (line.mdc, line.mcid, line.change) == (0.15, 0.16, None)


def test_a_base_without_a_value_is_the_next_assessment_that_has_one() -> None:
    line = one(visit(0, speed(None)), visit(7, speed(0.5)), visit(14, speed(0.9))).lines[0]
    assert [p.visit for p in line.points] == [1, 2]
    assert line.base == 0
    assert line.change is not None
    assert line.change.before == 0.5


def knee(value: float, *, estimated: bool = False) -> Parameter:
    return Parameter("knee_flexion_rom_deg", "left", 40, value, 1.0, "deg", estimated=estimated)


def test_an_estimated_angle_is_on_no_line_with_measured_ones() -> None:
    visits = (
        visit(0, knee(52.4, estimated=True)),
        visit(7, knee(79.2)),
        visit(14, knee(60.0, estimated=True)),
        visit(21, knee(70.0)),
    )
    trend = one(*visits, name="knee_flexion_rom_deg")
    (line,) = trend.lines
    assert [p.estimated for p in line.points] == [True, False, True, False]
    # the first that was measured is the base
    assert (line.base, line.latest) == (1, 3)
    assert line.change is not None
    assert line.change.difference == pytest.approx(-9.2)
    for k in (0, 2):
        notices = line.points[k].change
        assert notices is not None
        assert (notices.difference, notices.reason) == (None, "not_measured_alike")
        assert change_words(notices).verdict == "not compared: one is measured, the other estimated"
    drawn = trend_svg(trend, line, visits)
    assert drawn.count('class="pl-l est"') == 2
    assert drawn.count('class="tr-l"') == 1
    rows = list(csv.DictReader(io.StringIO(trends_csv(visits, [trend]).decode())))
    assert [r["estimated"] for r in rows] == ["1", "0", "1", "0"]
    assert [r["change"] for r in rows] == ["", "", "", "-9.2"]


def test_where_the_last_is_estimated_nothing_is_compared() -> None:
    line = one(visit(0, knee(79.2)), visit(7, knee(52.4, estimated=True)), name="knee_flexion_rom_deg").lines[
        0
    ]
    assert (line.base, line.latest) == (0, 1)
    assert line.change is not None
    assert (line.change.verdict, line.change.reason) == (None, "not_measured_alike")


@pytest.mark.parametrize("stored", ["with", "without"])
def test_numbers_of_a_file_say_which_angles_are_estimated(stored: str) -> None:
    rows = [asdict(knee(52.4, estimated=True)), asdict(speed(1.0))]
    if stored == "without":
        rows = [{k: v for k, v in row.items() if k != "estimated"} for row in rows]
    data = {
        "quality": {"level": "good", "reasons": []},
        "estimator": {"estimated_angles": ["knee_flexion_l", "knee_flexion_r"], "verdict": "good"},
        "parameters": rows,
        "scores": [],
        "warnings": [],
    }
    numbers = read_numbers(json.dumps(data).encode())
    assert numbers is not None
    assert [p.estimated for p in numbers.parameters] == [True, False]


def test_few_strides_widen_the_band_to_what_they_leave_open() -> None:
    line = one(visit(0, speed(0.62, half=0.2)), visit(14, speed(0.9, half=0.2))).lines[0]
    assert line.mdc == pytest.approx(0.2828, abs=1e-3)
    assert line.change is not None
    assert line.change.verdict == "within_measurement_error"


def test_sides_are_judged_apart() -> None:
    trend = one(
        visit(0, step("left", 0.40), step("right", 0.52)),
        visit(30, step("left", 0.55), step("right", 0.53)),
        name="step_length_m",
    )
    verdicts = {line.side: line.change.verdict for line in trend.lines if line.change}
    assert verdicts == {"left": "real_change", "right": "within_measurement_error"}


def test_speed_is_compared_with_people_at_their_own_pace_whatever_the_persons() -> None:
    slow = [visit(0, speed(0.5))]
    norms, usual = [look_up_norms(75, "male", 0.5)], temporal_values(75, "male").values
    (trend,) = follow_figures(slow, ["gait_speed_mps"], norms, usual)
    assert trend.norm is not None
    assert trend.norm.mean > 1.0


def test_what_was_measured_is_offered_in_the_order_of_the_table() -> None:
    visits = [visit(0, step("left", 0.4), speed(0.6)), visit(1, speed(None))]
    assert names_in(visits) == ("gait_speed_mps", "step_length_m")
    assert names_in([visit(0, speed(None))]) == ()


def test_words_say_size_verdict_and_source() -> None:
    change = one(visit(0, speed(0.62)), visit(28, speed(0.90))).lines[0].change
    assert change is not None
    words = change_words(change)
    assert (words.size, words.mark, words.verdict) == ("+0.28", "up", "real change, clinically relevant")
    assert "Lewek 2019" in words.limits[0]
    assert "Tilson" in words.limits[1]


def test_the_chart_shows_every_visit_and_every_limit() -> None:
    visits = [
        visit(0, speed(0.62), label="PRE"),
        visit(7, speed(0.66), label="T1", kind="training"),
        visit(30, speed(0.90), label="MID"),
    ]
    trend = one(*visits)
    svg = trend_svg(trend, trend.lines[0], visits, [PlannedAssessment("POST1", DAY + dt.timedelta(days=60))])
    root = ElementTree.fromstring(svg)
    classes = [e.get("class") for e in root.iter() if e.get("class")]
    assert classes.count("pl-b") == 2
    assert classes.count("ps-b") == 1
    assert classes.count("mdcl") == 2
    assert classes.count("mcid") == 2
    texts = {e.text for e in root.iter() if e.tag.endswith("text")}
    assert {"PRE", "MID", "POST1", "0.62", "0.90"} <= texts
    assert "nan" not in svg.lower()


def test_both_sides_of_a_figure_share_their_axis() -> None:
    visits = [visit(0, step("left", 0.40), step("right", 0.60))]
    trend = one(*visits, name="step_length_m")
    low, high = value_range(trend)
    assert low < 0.40 - 0.067
    assert high > 0.60 + 0.067
    ticks = [
        re.findall(r'text-anchor="end">([0-9.]+)<', trend_svg(trend, line, visits)) for line in trend.lines
    ]
    assert ticks[0] == ticks[1]
    assert len(ticks[0]) >= 3


def test_one_visit_of_one_value_is_drawn_without_a_range_to_divide_by() -> None:
    flat = Parameter("harmonic_ratio_v", None, 5, 0.0, None, "", ci_low=None, ci_high=None)
    visits = [visit(0, flat)]
    trend = one(*visits, name="harmonic_ratio_v")
    assert "nan" not in trend_svg(trend, trend.lines[0], visits)


@pytest.mark.parametrize(
    ("kinds", "feedback", "why"),
    [
        (("training", "training", "training"), False, "not compared: only trainings, no assessment"),
        (("training", "training", "assessment"), False, "first value to compare with"),
        (("assessment", "training", "training"), True, "not compared: walked with feedback"),
        (("assessment", "training", "assessment"), False, ""),
    ],
)
def test_paper_says_why_it_says_no_change(kinds: tuple[VisitKind, ...], feedback: bool, why: str) -> None:
    visits = [visit(7 * i, speed(0.6 + i / 10), kind=kind) for i, kind in enumerate(kinds)]
    visits[-1] = replace(visits[-1], condition=replace(USUAL, feedback=feedback))
    strip = trend_strip(visits)
    assert strip is not None
    assert [(line.why_none, line.change is None) for line in strip.lines] == [(why, bool(why))]
