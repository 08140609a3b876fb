"""Clicks before the scripts of a page are loaded are replayed afterwards."""

from __future__ import annotations

import re
from uuid import uuid4

from playwright.sync_api import Route, expect

from tests.browser import filling
from tests.browser.conftest import Opener, RunningServer

SCRIPT = "**/static/js/forms.js*"
KEEP_THEME = """() => addEventListener('pagehide', () => {
  localStorage.pressed = document.documentElement.dataset.theme;
})"""


def test_a_form_and_a_button_pressed_before_their_scripts_are_there_are_pressed_again(
    opened: Opener, running: RunningServer
) -> None:
    with running.client() as client:
        patient = filling.add(client, "/patients", code=f"EARLY-{uuid4().hex[:6]}")["id"]
    page, held = opened("/account"), list[Route]()
    page.route(SCRIPT, lambda route: held.append(route), times=1)
    form = f"/patients/{patient}/sessions/new"
    page.goto(form, wait_until="commit")
    page.locator(".rail [data-theme-toggle]").click()
    page.get_by_label("Name of the visit").fill("Before the scripts")
    record = page.get_by_role("button", name="Record live")
    for _ in range(2):  # impatient people press twice: one visit is made
        record.click(no_wait_after=True)
    assert page.url.endswith(form), "the browser sent the form by itself"
    assert page.locator("html").get_attribute("data-theme") is None
    page.evaluate(KEEP_THEME)
    held[0].continue_()
    page.wait_for_url(re.compile(r"/live$"))
    assert page.evaluate("localStorage.pressed") == "dark"
    expect(page.locator("h1")).to_contain_text("Before the scripts")
    with running.client() as client:
        visits = client.get(f"/api/v1/patients/{patient}/sessions").raise_for_status().json()
    assert [visit["title"] for visit in visits] == ["Before the scripts"]
