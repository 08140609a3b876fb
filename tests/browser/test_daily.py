"""A recording of daily life from its upload to its page, on every screen and on paper."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from sagittal.core.simulate import mt_files, simulate_day
from sagittal.core.simulate.chest import PostureHold
from sagittal.core.simulate.setup import RecordingSetup
from tests.browser import filling
from tests.browser.conftest import Opener, RunningServer
from tests.browser.design import all_faults
from tests.helpers.kept import keep

LIVED = (
    PostureHold("stand", 20.0),
    PostureHold("walk", 80.0),
    PostureHold("stand", 20.0),
    PostureHold("sit", 60.0),
    PostureHold("lie", 60.0),
    PostureHold("sit", 30.0),
    PostureHold("stand", 10.0),
    PostureHold("walk", 30.0),
)


@keep
def lived_files() -> tuple[dict[str, bytes], dict[str, str | None]]:
    """Five minutes with one sensor on the chest."""
    day = simulate_day(LIVED, setup=RecordingSetup(rate_hz=50.0))
    return dict(mt_files(day.recording, "day")), dict(day.recording.segments)


@pytest.fixture(scope="module")
def lived(running: RunningServer) -> tuple[str, str]:
    """Patient and session of daily life, read and analysed by the worker."""
    files, sensors = lived_files()
    with running.client() as client:
        patient = filling.add(client, "/patients", code="P-0130", height_m=1.75)["id"]
        session = filling.add_session(client, patient, "At home", protocol="activity")
        filling.upload(client, session, files)
        assert filling.analyse(client, session, sensors)["state"] == "done"
    return patient, session


def test_the_page_of_daily_life_shows_what_was_lived(opened: Opener, lived: tuple[str, str]) -> None:
    page = opened(f"/sessions/{lived[1]}", stays=True)
    days = page.get_by_role("region", name="Days")
    expect(days.get_by_role("img", name="hours and minutes")).to_have_count(1)
    for word in ("Lying", "Sitting", "Standing", "Walking"):
        expect(days.locator(".legend")).to_contain_text(word)
    bouts = page.get_by_role("region", name="Walks by length")
    bouts.get_by_text("As a table").click()
    row = bouts.get_by_role("row", name="1–2")
    assert int(row.get_by_role("cell").nth(1).inner_text()) == pytest.approx(147, abs=8)
    for more in (
        "Every hour as a table",
        "Glossary",
        "All transitions, including rejected trunk leans",
    ):
        page.get_by_text(more).click()
    faults = all_faults(page)
    assert not faults, "\n".join(faults)


def test_trends_and_paper_of_daily_life_obey_the_design_system(
    opened: Opener, lived: tuple[str, str]
) -> None:
    page = opened(f"/patients/{lived[0]}/trends", stays=True)
    expect(page.get_by_role("region", name="Capacity and performance")).to_contain_text("unknown")
    faults = all_faults(page)
    page.goto(f"/sessions/{lived[1]}/print")
    faults += all_faults(page)
    assert not faults, "\n".join(faults)
    pdf = page.pdf(prefer_css_page_size=True)
    assert pdf.count(b"/Type /Page\n") + pdf.count(b"/Type /Page ") == 3
