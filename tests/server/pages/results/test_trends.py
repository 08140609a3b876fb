"""Trends of a patient: lines per parameter and status messages."""

from __future__ import annotations

import datetime as dt
from types import SimpleNamespace
from typing import Any

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.programmes import PlannedVisit
from sagittal.server.pages.results.trends import _column, _pick_side, _waiting, list_ahead, view_daily_trend
from sagittal.server.report.history.daily_trend import PerformanceDay
from sagittal.server.report.history.trends import Trend, TrendPoint, TrendSeries
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio
DAY = dt.date(2026, 3, 1)


def line(side: Any, *values: float, base: int | None = 0, estimated: tuple[bool, ...] = ()) -> TrendSeries:
    flags = estimated or (False,) * len(values)
    points = [
        TrendPoint(k, v, None, 9, None, None, None, e)
        for k, (v, e) in enumerate(zip(values, flags, strict=True))
    ]
    return TrendSeries(side, tuple(points), base, None, None, None)


def trend(*lines: TrendSeries, norm: float | None = None) -> Any:
    reference: Any = None if norm is None else SimpleNamespace(mean=norm)
    return Trend("stance_pct", SimpleNamespace(), lines, reference)  # type: ignore[arg-type]


def test_the_affected_side_stands_for_a_figure_else_the_one_further_from_the_norm() -> None:
    left, right = line("left", 50.0, 61.0), line("right", 40.0, 65.0)
    assert _pick_side(trend(left, right, norm=62.0), "left") is left
    assert _pick_side(trend(left, right, norm=62.0), None) is right
    assert _pick_side(trend(left, right, norm=64.0), None) is left
    assert _pick_side(trend(left, right), None) is left
    whole = line(None, 1.2)
    assert _pick_side(trend(whole, norm=1.4), "left") is whole


def test_what_is_waited_for_is_said() -> None:
    assert _waiting(line("left", 1.0, base=None)) == "no assessment yet"
    assert _waiting(line("left", 1.0)) == "one assessment so far"
    assert _waiting(line("left", 1.0, estimated=(True,))) == "one estimated assessment so far"
    mixed = line("left", 1.0, 2.0, base=1, estimated=(True, False))
    assert _waiting(mixed) == "one measured assessment so far"


def test_a_visit_says_whether_it_was_a_training() -> None:
    def of(kind: str, *, feedback: bool) -> Any:
        visit = SimpleNamespace(session_id="s", label="T1", performed_on=DAY, kind=kind, feedback=feedback)
        return _column(visit)["training"]  # type: ignore[arg-type]

    assert of("assessment", feedback=False) is None
    assert of("training", feedback=True) == "with feedback"
    assert of("training", feedback=False) == "training"


def test_assessments_ahead_are_of_the_newest_programme() -> None:
    def plan(*visits: tuple[str, Any, Any]) -> Any:
        result = [
            PlannedVisit(label, label, kind, 1, DAY, None, None, state) for label, kind, state in visits
        ]
        return SimpleNamespace(visits=result)

    newest = plan(
        ("PRE", "assessment", "done"), ("MID", "assessment", "missing"), ("T1", "training", "next"),
        ("POST", "assessment", "next"), ("FU", "assessment", "planned"),
    )  # fmt: skip
    history: Any = SimpleNamespace(programmes=(newest, plan(("OLD", "assessment", "planned"))))
    assert [(a.label, a.day) for a in list_ahead(history)] == [("POST", DAY), ("FU", DAY)]
    assert list_ahead(SimpleNamespace(programmes=())) == []  # type: ignore[arg-type]


def test_days_at_home_stand_in_a_table_with_how_long_they_were_worn() -> None:
    first, second = DAY, DAY + dt.timedelta(days=1)
    days = [
        PerformanceDay("b", second, 900, 3.0, 80.4),
        PerformanceDay("a", first, 5200, 23.5, None),
    ]
    view = view_daily_trend(None, days)
    assert [(r["day"], r["where"], r["steps"], r["cadence"], r["speed"]) for r in view["rows"]] == [
        (first, "home", "5200", None, None),
        (second, "home, wear time too short", "900", "80", None),
    ]
    assert (view["has_capacity"], view["condition"]) == (False, None)
    assert view["rows"][0]["href"] == "/sessions/a"


async def test_the_page_shows_what_is_chosen(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="TR-1").id
        session = sessions.create(c, None, patient).id
    async with clinic.client("viewer") as client:
        empty = await client.get(f"/patients/{patient}/trends")
        analysed.finish(clinic, patient, session, analysed.files())
        chosen = (await client.get(f"/patients/{patient}/trends?show=cadence_spm")).text
        usual = (await client.get(f"/patients/{patient}/trends")).text
        assert (await client.get(f"/patients/{patient}/trends?like=x")).status_code == 422
    assert empty.status_code == 200

    assert usual.count("one assessment so far") > chosen.count("one assessment so far") >= 1
