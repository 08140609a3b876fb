"""Warnings for unsaved input, line breaks of long words, updated visit names."""

from __future__ import annotations

import pytest
from playwright.sync_api import Dialog, Page, expect

from tests.browser import filling
from tests.browser.conftest import Filled, Opener, RunningServer


@pytest.fixture(scope="module")
def patient(running: RunningServer) -> str:
    """A patient without a visit."""
    with running.client() as client:
        return str(filling.add(client, "/patients", code="P-0777")["id"])


def leave(page: Page) -> list[str]:
    """Reload, stay if asked; the questions that were asked."""
    requested_names: list[str] = []

    def stay(dialog: Dialog) -> None:
        requested_names.append(dialog.type)
        dialog.dismiss()

    page.on("dialog", stay)
    page.evaluate("setTimeout(() => location.reload(), 0)")
    page.wait_for_timeout(800)
    page.remove_listener("dialog", stay)
    return requested_names


def test_a_note_that_is_being_written_is_asked_for_before_the_page_goes(opened: Opener, patient: str) -> None:
    page = opened(f"/patients/{patient}", stays=True)
    assert leave(page) == []
    page.get_by_role("region", name="Notes").get_by_role("button", name="Add", exact=True).click()
    text = page.locator("dialog[open] textarea")
    text.press_sequentially("Walks better")
    assert leave(page) == ["beforeunload"]
    expect(text).to_have_value("Walks better")
    page.keyboard.press("Escape")
    assert leave(page) == []


def test_a_visit_being_made_is_asked_for_and_goes_when_it_is_sent(opened: Opener, patient: str) -> None:
    page = opened(f"/patients/{patient}/sessions/new")
    page.get_by_label("Note").press_sequentially("Tired today")
    assert leave(page) == ["beforeunload"]
    requested_names: list[str] = []

    def go(dialog: Dialog) -> None:
        requested_names.append(dialog.type)
        dialog.accept()

    page.on("dialog", go)
    page.get_by_role("button", name="Upload a recording").click()
    page.wait_for_url("**/upload")
    assert requested_names == []


def test_the_name_of_a_visit_follows_its_protocol_until_somebody_writes_one(
    opened: Opener, patient: str
) -> None:
    page = opened(f"/patients/{patient}/sessions/new", stays=True)
    name = page.get_by_label("Name of the visit")
    expect(name).to_have_value("Walk")
    page.get_by_role("radio", name="Timed up and go").check()
    expect(name).to_have_value("Timed up and go")
    page.get_by_role("radio", name="Squats").check()
    expect(name).to_have_value("Squats")
    name.fill("After six weeks")
    page.get_by_role("radio", name="Treadmill").check()
    expect(name).to_have_value("After six weeks")


def test_a_note_of_one_long_word_breaks_no_page(opened: Opener, running: RunningServer, patient: str) -> None:
    with running.client() as client:
        filling.add(client, f"/patients/{patient}/notes", content="x" * 9000)
    page = opened(f"/patients/{patient}", stays=True)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_a_page_that_follows_a_job_waits_for_the_dialog_that_is_in_use(
    opened: Opener, running: RunningServer, filled: Filled
) -> None:
    with running.client() as client:
        (job, *_) = [j["id"] for j in client.get("/api/v1/jobs").json() if j["state"] == "done"]
    page = opened("/patients", stays=True)
    page.get_by_role("button", name="New patient").click()
    code = page.locator("dialog[open]").get_by_label("Code")
    code.press_sequentially("P-0778")
    page.evaluate(
        "(job) => document.querySelector('h1').insertAdjacentHTML('beforeend',"
        " `<job-progress job='${job}' done='reload'><span data-message></span></job-progress>`)",
        job,
    )
    expect(page.locator("h1")).to_contain_text("Done")
    expect(code).to_have_value("P-0778")
    page.keyboard.press("Escape")
    page.evaluate("document.activeElement.blur()")
    expect(page.locator("job-progress")).to_have_count(0)  # now it has loaded itself anew
    expect(page.locator("h1")).to_have_text("Patients")
