"""Capacity in the clinic compared with performance at home."""

from __future__ import annotations

import datetime as dt
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from defusedxml.ElementTree import fromstring

from sagittal.core.activity.parameters import WORN_H
from sagittal.core.activity.result import ActivityBout, ActivityDay, ActivityResult
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.history.daily_trend import (
    LONG_BOUT_S,
    CapacityVisit,
    PerformanceDay,
    TrendPanel,
    draw_daily_trend,
    read_capacity,
    read_performance,
)

DAY = dt.date(2026, 3, 2)


def later(days: int) -> dt.date:
    return DAY + dt.timedelta(days=days)


def parameter(name: str, mean: float | None, side: str | None = None) -> Parameter:
    return Parameter(name, side, 10, mean, None, "")  # type: ignore[arg-type]


def test_a_walk_in_the_clinic_gives_speed_and_cadence_of_the_whole_take() -> None:
    walked = [
        parameter("gait_speed_mps", 1.2),
        parameter("cadence_spm", 99.0, "left"),
        parameter("cadence_spm", 110.0),
    ]
    assert read_capacity("s1", DAY, "PRE", walked) == CapacityVisit("s1", DAY, "PRE", 1.2, 110.0)
    assert read_capacity("s1", DAY, "PRE", walked[:1]) == CapacityVisit("s1", DAY, "PRE", 1.2, None)
    assert read_capacity("s1", DAY, "PRE", [parameter("gait_speed_mps", None), walked[1]]) is None


def bout(start_s: float, duration_s: float, cadence: float, kind: str = "walking") -> ActivityBout:
    return ActivityBout(start_s, start_s + duration_s, kind, 10, 0, 0, cadence)  # type: ignore[arg-type]


def home(*bouts: ActivityBout, worn_h: float = 12.0, date: dt.date | None = None) -> ActivityResult:
    """Two days, the second not worn."""
    first = ActivityDay(date, 0.0, 86400.0, worn_h, 4000, {}, {}, len(bouts), None)
    days = (first, replace(first, start_s=86400.0, end_s=172800.0, worn_h=0.0))
    return ActivityResult(
        segment="chest", device_id="A", source="a", rate_hz=50.0, has_gyro=False, started_at=None,
        duration_s=172800.0, height_m=1.7, spans=(), transitions=(), candidates=(), bouts=bouts,
        steps_s=np.empty(0), turns=(), hours=(), days=days, periods=(), inclination_deg=np.empty(0),
    )  # fmt: skip


def test_the_cadence_of_a_day_is_the_median_of_its_long_walks() -> None:
    result = home(
        bout(0.0, LONG_BOUT_S, 90.0),
        bout(1000.0, 90.0, 100.0),
        bout(2000.0, 90.0, 130.0),
        bout(3000.0, LONG_BOUT_S - 1.0, 10.0),
        bout(4000.0, 90.0, 10.0, "stairs_up"),
        bout(86400.0, 90.0, 10.0),
    )
    assert read_performance("s1", DAY, result) == [PerformanceDay("s1", DAY, 4000, 12.0, 100.0)]


def test_a_day_has_the_date_of_the_device_or_is_counted_from_the_session() -> None:
    assert [d.day for d in read_performance("s1", DAY, home(date=later(5)))] == [later(5)]
    assert [d.cadence_spm for d in read_performance("s1", DAY, home())] == [None]
    second = home(worn_h=0.0)
    days = (second.days[0], replace(second.days[1], worn_h=3.0))
    assert [d.day for d in read_performance("s1", DAY, replace(second, days=days))] == [later(1)]


def test_a_day_counts_when_it_was_worn_long_enough() -> None:
    assert PerformanceDay("s1", DAY, 10, WORN_H, None).counted
    assert not PerformanceDay("s1", DAY, 10, WORN_H - 0.1, None).counted


CLINIC = (CapacityVisit("s1", DAY, "PRE", 1.0, 100.0), CapacityVisit("s3", later(10), "POST", 1.2, None))
AT_HOME = (
    PerformanceDay("s2", later(5), 4000, 14.0, 110.0),
    PerformanceDay("s2", later(6), 1000, 2.0, 90.0),
)


def read(panel: TrendPanel) -> ET.Element:
    root: ET.Element = fromstring(panel.svg)
    return root


def dots(root: ET.Element) -> list[tuple[str, str]]:
    return [(str(c.get("class")), str(e.get("x"))) for e in root.iter("svg") for c in e if c.tag == "circle"]


def test_three_panels_share_one_axis_of_time() -> None:
    speed, steps, cadence = draw_daily_trend(CLINIC, AT_HOME)
    assert [p.unit for p in (speed, steps, cadence)] == ["m/s", "", "steps/min"]
    assert dots(read(speed)) == [("pl-b", "6%"), ("pl-b", "94%")]
    assert dots(read(cadence)) == [("pl-b", "6%"), ("ak-ring", "50%"), ("ak-ring part", "58.8%")]
    bars = list(read(steps).iter("rect"))
    assert [e.get("class") for e in bars] == ["bar", "bar part"]
    middles = [float(e.get("x") or 0) + float(e.get("width") or 0) / 2 for e in bars]
    assert middles == pytest.approx([500.0, 588.0], abs=0.1)
    # the most steps leave a tenth of room above
    assert [float(e.get("height") or 0) for e in bars] == pytest.approx([1000 / 1.1, 250 / 1.1], abs=0.1)


def test_without_daily_life_nothing_is_drawn_and_without_a_walk_steps_alone() -> None:
    assert draw_daily_trend(CLINIC, ()) == ()
    (steps,) = draw_daily_trend((), [replace(d, cadence_spm=None) for d in AT_HOME])
    assert steps.title == "Performance: steps per day at home"


def test_a_single_day_without_a_step_stands_in_the_middle() -> None:
    (steps,) = draw_daily_trend((), [PerformanceDay("s2", DAY, 0, 14.0, None)])
    labels = [(e.get("x"), e.text) for e in read(steps).iter("text") if e.get("text-anchor") == "middle"]
    assert labels == [("50%", "2 Mar")]


def test_days_under_the_axis_keep_their_distance() -> None:
    _, steps, _ = draw_daily_trend(CLINIC, AT_HOME)
    labels = [e.text for e in read(steps).iter("text") if e.get("text-anchor") == "middle"]
    assert labels == ["2 Mar", "4 Mar", "6 Mar", "8 Mar", "10 Mar", "12 Mar"]
