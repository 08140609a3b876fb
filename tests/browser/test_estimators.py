"""Estimator name and health, another estimator on request, and measured lengths."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser import filling
from tests.browser.conftest import Filled, Opener, RunningServer

pytestmark = pytest.mark.usefixtures("unknown_sensors")


@pytest.fixture(scope="module")
def walk(running: RunningServer, filled: Filled) -> str:
    """Separate analysed session."""
    files, sensors = filling.simulated_files()
    with running.client() as client:
        patient = filling.add(client, "/patients", code="ESTIMATED", height_m=1.75)["id"]
        session = filling.add_session(client, patient, "Walk")
        filling.upload(client, session, files)
        filling.analyse(client, session, sensors)
    return session


def find_row(page: Page, name: str) -> Locator:
    """Row of a parameter outside the first ten, by its name."""
    page.get_by_label("Find a value").fill(name)
    return page.locator("all-values tbody tr", has_text=name)


def test_the_overview_names_the_estimator_and_leads_to_its_health(opened: Opener, walk: str) -> None:
    page = opened(f"/sessions/{walk}", stays=True)
    page.get_by_role("link", name="How it was measured").click()
    quality = page.locator(".quality")
    expect(quality).to_contain_text("ErKF, smoothed")
    quality.get_by_role("link", name="ErKF, smoothed").click()
    page.wait_for_url(re.compile(r"/data$"))
    health = page.locator("table", has_text="Self-check")
    expect(health).to_contain_text("Joint separation")
    expect(health.locator("tbody tr")).not_to_have_count(0)


def test_another_estimator_runs_and_its_angles_are_marked(opened: Opener, walk: str) -> None:
    page = opened(f"/sessions/{walk}/data", stays=True)
    page.get_by_label("Run another estimator on this trial").select_option("l7s_3i")
    page.get_by_role("button", name="Run it").click()
    page.wait_for_url(re.compile(rf"/sessions/{walk}$"), wait_until="commit")
    expect(page.locator(".quality")).to_contain_text("L7S-3I", timeout=60_000)
    expect(find_row(page, "Knee flexion range")).to_contain_text("low confidence")
    page.goto(f"/sessions/{walk}/data")
    expect(page.get_by_role("heading", name="Earlier analyses")).to_be_visible()
    page.get_by_label("Run another estimator on this trial").select_option(
        label="Automatic: best for the sensors in use"
    )
    page.get_by_role("button", name="Run it").click()
    page.wait_for_url(re.compile(rf"/sessions/{walk}$"), wait_until="commit")
    expect(page.locator(".quality")).to_contain_text("ErKF, smoothed", timeout=60_000)


def test_the_ankles_distance_gives_step_width(opened: Opener, walk: str) -> None:
    page = opened(f"/sessions/{walk}", stays=True)
    expect(find_row(page, "Step width")).to_contain_text("enter the distance between the ankles")
    page.goto(f"/sessions/{walk}/upload")
    ankles = page.get_by_label("Distance between the ankles while standing")
    ankles.fill("3")
    page.get_by_role("button", name="Analyse").click()
    assert page.locator("main input:invalid").count() == 1, "three metres must not pass"
    ankles.fill("0.2")
    page.get_by_role("button", name="Analyse").click()
    page.wait_for_url(re.compile(rf"/sessions/{walk}$"), wait_until="commit")
    _wait_for_results(page)
    width = find_row(page, "Step width")
    expect(width.locator("td.n .num").first).to_have_text(re.compile(r"^\s*0\.\d\d(\s*± [\d.]+)?\s*$"))
    page.goto(f"/sessions/{walk}/upload")
    expect(ankles).to_have_value("0.2")


def test_the_belts_speed_is_asked_for_on_a_treadmill_only(
    opened: Opener, walk: str, running: RunningServer
) -> None:
    page = opened(f"/sessions/{walk}/upload", stays=True)
    expect(page.get_by_label("Speed of the belt")).to_be_hidden()
    files, _ = filling.simulated_files()
    with running.client() as client:
        patient = filling.add(client, "/patients", code="BELT")["id"]
        session = filling.add_session(client, patient, "On the belt", protocol="treadmill")
        filling.upload(client, session, files)
    page.goto(f"/sessions/{session}/upload")
    page.locator("[data-sides=keep]").click()
    page.get_by_label("Speed of the belt").fill("1.1")
    page.get_by_role("button", name="Analyse").click()
    page.wait_for_url(re.compile(rf"/sessions/{session}$"), wait_until="commit")
    expect(page.locator("#rows")).to_contain_text("1.10", timeout=60_000)
    expect(find_row(page, "Step length")).to_contain_text("on a treadmill")


def test_goniometer_and_shoe_go_into_the_manifest_and_leave_it(
    opened: Opener, walk: str, running: RunningServer
) -> None:
    page = opened(f"/sessions/{walk}/upload", stays=True)
    page.get_by_text("Standing angles by goniometer").click()
    page.get_by_label("Knee flexion, left").fill("8")
    page.get_by_label("Knee flexion, right").fill("-2")
    page.get_by_text("Shoe sole by tape").click()
    page.get_by_label("To the rear end").fill("0.16")
    page.get_by_label("To the tip").fill("0.12")
    page.get_by_role("button", name="Analyse").click()
    page.wait_for_url(re.compile(rf"/sessions/{walk}$"), wait_until="commit")
    _wait_for_results(page)
    clearance = find_row(page, "Minimum toe clearance")
    expect(clearance.locator("td.n .num").first).to_have_text(re.compile(r"^\s*−?0\.\d+(\s*± [\d.]+)?\s*$"))
    with running.client() as client:
        body = client.get(f"/api/v1/sessions/{walk}/recording").json()["manifest"]["subject"]
    assert body["standing_angles_deg"] == {"knee_flexion_l": 8, "knee_flexion_r": -2}
    page.goto(f"/sessions/{walk}/upload")
    page.get_by_text("Shoe sole by tape").click()
    page.get_by_label("To the rear end").fill("")
    page.get_by_label("To the tip").fill("")
    page.get_by_role("button", name="Analyse").click()
    page.wait_for_url(re.compile(rf"/sessions/{walk}$"), wait_until="commit")
    with running.client() as client:
        assert "shoe" not in client.get(f"/api/v1/sessions/{walk}/recording").json()["manifest"]["subject"]


def _wait_for_results(page: Page) -> None:
    """Wait until the page has loaded itself with new results; before it has come it shows no progress too."""
    page.wait_for_load_state("domcontentloaded")
    expect(page.locator("job-progress")).to_have_count(0, timeout=60_000)
