"""Several visits: figures chosen over time, two visits compared, a programme planned and followed."""

from __future__ import annotations

import datetime as dt
import json
import re

import pytest
from playwright.sync_api import Browser, WebSocket, expect

from tests.browser import filling
from tests.browser.conftest import Filled, Opener, RunningServer


def test_the_reader_chooses_the_figures_and_the_address_keeps_them(opened: Opener, filled: Filled) -> None:
    page = opened(f"/patients/{filled.patient}", stays=True)
    page.get_by_role("link", name="All trends").click()
    expect(page.get_by_role("heading", name="Cadence")).to_be_visible()
    page.get_by_text("Choose values").click()
    page.get_by_label("Cadence").uncheck()
    page.get_by_label("Swing time").check()
    page.get_by_role("button", name="Show").click()
    expect(page.get_by_role("heading", name="Swing time, left")).to_be_visible()
    expect(page.get_by_role("heading", name="Cadence")).to_have_count(0)
    assert "show=swing_time_s" in page.url
    charts = page.locator(".trend-plot circle[class^=pl-]")
    # two visits of the same walk: two points on each chart
    assert charts.count() == 2 * page.locator(".trend-plot").count()
    expect(page.locator("#table tbody tr")).to_have_count(page.locator(".trend-plot").count())


def test_the_table_of_a_trend_can_be_saved(opened: Opener, filled: Filled) -> None:
    page = opened(f"/patients/{filled.patient}/trends?show=stride_time_s", stays=True)
    with page.expect_download() as saved:
        page.get_by_role("link", name="CSV").click()
    lines = saved.value.path().read_text().splitlines()
    assert lines[0].startswith("name,side,unit,date")
    assert {line.split(",")[0] for line in lines[1:]} == {"stride_time_s"}
    assert len(lines) == 1 + 2 * 2


@pytest.mark.journey
def test_two_visits_are_ticked_and_compared(opened: Opener, filled: Filled) -> None:
    page = opened(f"/patients/{filled.patient}", stays=True)
    button = page.get_by_role("button", name="Compare two")
    expect(button).to_be_disabled()
    boxes = page.locator("input[name=visit]")
    expect(boxes).to_have_count(2)
    boxes.nth(0).check()
    expect(button).to_be_disabled()
    boxes.nth(1).check()
    button.click()
    page.wait_for_url(re.compile(r"/sessions/\w+/compare/\w+$"))
    expect(page.locator("h1")).to_contain_text("21 Oct 2026 compared with 18 Nov 2026")
    expect(page.get_by_role("heading", name="No real change")).to_be_visible()
    assert page.locator(".chart.cycle .pvl").count() >= 9
    expect(page.locator(".compared").first).to_contain_text("within measurement error")


@pytest.mark.parametrize("width", [1024, 1200, 1280, 1400])
def test_the_results_by_visit_fit_a_window_of_a_laptop(opened: Opener, filled: Filled, width: int) -> None:
    page = opened(f"/patients/{filled.patient}", stays=True)
    page.set_viewport_size({"width": width, "height": 900})
    expect(page.locator(".results").get_by_text("Data", exact=True)).to_be_visible()
    room, needed = page.locator(".scroll:has(> .results)").evaluate("e => [e.clientWidth, e.scrollWidth]")
    assert needed <= room


def test_the_overview_leads_to_the_comparison_with_the_visit_before(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}")
    page.get_by_role("link", name="Since 21 Oct 2026").first.click()
    page.wait_for_url(re.compile(f"/sessions/{filled.done}/compare/{filled.earlier}$"))
    page = opened(f"/sessions/{filled.earlier}")
    expect(page.get_by_role("link", name=re.compile("^Since"))).to_have_count(0)


@pytest.fixture(scope="module")
def newcomer(running: RunningServer) -> tuple[str, str]:
    """A patient with a visit today, and that visit."""
    with running.client() as client:
        patient = filling.add(client, "/patients", code="P-0099")["id"]
        today = dt.datetime.now(dt.UTC).date().isoformat()
        return patient, filling.add_session(client, patient, "First walk", performed_on=today)


def test_a_programme_is_started_linked_to_its_visits_and_ended(
    opened: Opener, newcomer: tuple[str, str]
) -> None:
    patient, session = newcomer
    page = opened(f"/patients/{patient}", stays=True)
    page.get_by_role("link", name="Plan a programme").click()
    page.wait_for_url(re.compile(r"/programme$"))
    page.get_by_role("button", name="Start programme").click()
    today = dt.datetime.now(dt.UTC).date()
    page.get_by_label("Day of the first training").fill(today.isoformat())
    page.locator("dialog[open]").get_by_role("button", name="Start").click()
    expect(page.get_by_role("heading", name="0 of 22 visits completed, 1 missing, next T1")).to_be_visible()
    page.get_by_role("button", name="Change T1", exact=True).click()
    page.locator("dialog[open]").get_by_label("Visit").select_option(session)
    page.locator("dialog[open]").get_by_role("button", name="Save").click()
    expect(page.get_by_role("heading", name="1 of 22 visits completed, 1 missing, next T2")).to_be_visible()
    page.goto(f"/patients/{patient}/sessions/new")
    chosen = page.get_by_label("Visit of the programme").locator("option:checked")
    expect(chosen).to_contain_text("T2, training")
    page.get_by_role("button", name="Upload a recording").click()
    page.wait_for_url(re.compile(r"/upload$"))
    page.goto(f"/patients/{patient}")
    expect(page.locator(".prog .wk.now .dots i.done")).to_have_count(2)
    row = page.locator(".results tbody tr", has_text="First walk")
    expect(row).to_contain_text("T1 · ")
    page.get_by_role("link", name="Plan", exact=True).click()
    page.wait_for_url(re.compile(r"/programme$"))
    page.get_by_role("button", name="End programme").click()
    page.locator("dialog[open]").get_by_role("button", name="End programme").click()
    page.wait_for_url(re.compile(rf"/patients/{patient}$"))
    expect(page.locator(".prog")).to_have_count(0)


def test_the_visit_before_walks_as_a_ghost_with_the_figure(
    opened: Opener, filled: Filled, solid: Browser
) -> None:
    page = opened("/patients", browser=solid)
    names: list[str] = []
    requested_names: list[str] = []

    def listen(socket: WebSocket) -> None:
        requested_names.append(socket.url)
        socket.on("framesent", lambda sent: names.append(str(sent)))

    page.on("websocket", listen)
    page.goto(f"/sessions/{filled.done}/compare/{filled.earlier}")
    page.locator("gait-view[data-state=open]").wait_for(timeout=30_000)
    page.frame_locator("gait-view iframe").locator("canvas[data-engine]").wait_for(timeout=30_000)
    assert any(
        f"/sessions/{filled.done}/replay" in a and f"ghost={filled.earlier}" in a for a in requested_names
    )
    menu = page.get_by_label("Overlay")
    expect(menu.locator("option:checked")).to_have_text("21 Oct 2026")
    expect(page.locator("gait-view")).to_have_attribute("data-ghost-shown", "visit")
    for chosen, view in (("norm", "norm"), ("left", "left"), ("", "")):
        menu.select_option(chosen)
        expect(page.locator("gait-view")).to_have_attribute("data-ghost-shown", view)
    sent = [json.loads(t)["ghost"] for t in names if "ghost" in t]
    assert sent == ["visit", "norm", "left", None]
    # one cursor for the figure and all charts
    chart = page.locator("[data-variable=knee_flexion]")
    chart.hover()
    expect(chart.locator("line.cursor")).to_have_attribute("x1", re.compile(r"^[45]\d\d"))
