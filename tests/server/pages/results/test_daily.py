"""Daily-life pages: session, week report, trends compared with clinic walks."""

from __future__ import annotations

import re

import pytest

from tests.helpers.clinic import Clinic
from tests.server import analysed, daily

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="module")
async def visits(clinic: Clinic) -> dict[str, str]:
    """A patient with a walk in the clinic and eight days at home; the ids of patient and visits."""
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": "HOME"})).json()["id"]
        requests = {"title": "Clinic", "protocol": "walk", "performed_on": "2026-11-10"}
        walk = (await client.post(f"/api/v1/patients/{patient}/sessions", json=requests)).json()["id"]
        requests = {"title": "Week at home", "protocol": "activity", "performed_on": "2026-11-24"}
        week = (await client.post(f"/api/v1/patients/{patient}/sessions", json=requests)).json()["id"]
    analysed.finish(clinic, patient, walk, analysed.files())
    analysed.finish(clinic, patient, week, daily.files(daily.live(7.5)))
    return {"patient": patient, "walk": walk, "week": week}


async def page(clinic: Clinic, path: str) -> str:
    async with clinic.client("admin") as client:
        answer = await client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.text


def cut_card(html: str, name: str) -> str:
    """The card under a heading."""
    remainder = html[html.index(f'id="{name}"') :]
    return remainder[: remainder.index("</section>")]


@pytest.mark.slow
async def test_the_session_shows_its_days_in_place_of_a_walk(clinic: Clinic, visits: dict[str, str]) -> None:
    html = await page(clinic, f"/sessions/{visits['week']}")
    days = cut_card(html, "h-days")
    assert days.count('class="chart ribbon"') == 9
    assert "Mean of 7 days" in days
    for word in ("Lying", "Sitting", "Standing", "Walking", "Unknown", "Not worn", "Stairs up"):
        assert word in days
    assert "experimental" in days
    assert "sensor on the chest" in days
    for gone in ("No strides", "gait-view", "replay-data", "/kinematics", "/timeline"):
        assert gone not in html
    assert "No strides" not in cut_card(html, "h-bouts")
    assert "Good data" in html
    assert "7 of 9" in html
    assert "Calibration" not in html


async def test_every_chart_has_its_numbers_in_a_table(clinic: Clinic, visits: dict[str, str]) -> None:
    html = await page(clinic, f"/sessions/{visits['week']}")
    assert cut_card(html, "h-days").count("<table") == 2
    for name in ("h-bouts", "h-trans", "h-lean"):
        assert "<table" in cut_card(html, name)
    for chart in re.findall(r'<svg width="100%"[^>]*>', html):
        assert 'role="img"' in chart
    used = set(re.findall(r"url\(#([\w-]+)\)", html))
    assert used
    assert used <= set(re.findall(r'<pattern id="([\w-]+)"', html))


async def test_the_report_for_paper_has_a_sheet_a_week(clinic: Clinic, visits: dict[str, str]) -> None:
    html = await page(clinic, f"/sessions/{visits['week']}/print")
    assert html.count('<article class="sheet paper">') == 4
    assert "Daily life, week 2" in html
    assert html.count('class="chart ribbon"') == 9
    assert "Gait report" not in html


@pytest.mark.parametrize("part", ["data", "parameters/daily_step_count"])
async def test_the_other_pages_of_the_session_open(clinic: Clinic, visits: dict[str, str], part: str) -> None:
    html = await page(clinic, f"/sessions/{visits['week']}/{part}")
    assert "HOME" in html
    if part == "data":
        assert "activity_spans.csv" in html


@pytest.mark.parametrize("part", ["kinematics", "timeline", "calibration", "algorithms"])
async def test_pages_of_a_walk_lead_to_the_days(clinic: Clinic, visits: dict[str, str], part: str) -> None:
    async with clinic.client("admin") as client:
        answer = await client.get(f"/sessions/{visits['week']}/{part}", follow_redirects=False)
    assert answer.status_code == 303
    assert answer.headers["location"] == f"/sessions/{visits['week']}#h-days"
    assert 'id="h-days"' in await page(clinic, f"/sessions/{visits['week']}")


async def test_the_api_tells_the_days(clinic: Clinic, visits: dict[str, str]) -> None:
    async with clinic.client("admin") as client:
        body = (await client.get(f"/api/v1/sessions/{visits['week']}/report")).json()
        walk = (await client.get(f"/api/v1/sessions/{visits['walk']}/report")).json()
    assert walk["daily"] is None
    assert len(body["daily"]["days"]) == 9
    assert body["daily"]["days"][1]["minutes"]["lying"] == pytest.approx(480.0)
    assert body["daily"]["sub_threshold"] == 1
    assert "daily_step_count" in {p["name"] for p in body["parameters"]}


async def test_trends_show_the_clinic_beside_home(clinic: Clinic, visits: dict[str, str]) -> None:
    html = await page(clinic, f"/patients/{visits['patient']}/trends")
    card = cut_card(html, "h-daily")
    assert card.count('class="chart trend-plot"') == 3
    assert "Capacity: gait speed in the clinic" in card
    assert card.count('class="bar part"') == 2  # the first evening, the last night
    rows = re.findall(r"<tr>\s*<td.*?</tr>", card, re.DOTALL)
    assert len(rows) == 10
    assert ">clinic<" in rows[0]
    assert "wear time too short" in rows[1]
    cells = re.findall(r'<td class="n">(.*?)</td>', rows[2])
    assert cells == ["–", "3690", "100", "23:00"]
    # the visit in the clinic stays what is followed, though daily life is newer
    assert "1 visit in another condition" in html


async def test_trends_of_daily_life_alone_say_that_capacity_is_unknown(clinic: Clinic) -> None:
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": "ALONE"})).json()["id"]
        requests = {"title": "At home", "protocol": "activity"}
        body = (await client.post(f"/api/v1/patients/{patient}/sessions", json=requests)).json()
    analysed.finish(clinic, patient, body["id"], daily.files(daily.live(2.0)))
    html = await page(clinic, f"/patients/{patient}/trends")
    card = cut_card(html, "h-daily")
    assert "capacity is unknown" in card
    assert "Steps per day" in html
