"""Everyday tasks: sign in and out, add, rename and delete, repeat an analysis, stop, refusals."""

from __future__ import annotations

import contextlib
import re

import pytest
from playwright.sync_api import Page, expect
from sqlalchemy import delete

from sagittal.server.auth.tokens import token_hash
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import login_session
from tests.browser import filling
from tests.browser.conftest import NAME, PASSWORD, Filled, Opener, RunningServer

pytestmark = pytest.mark.usefixtures("unknown_sensors")


def test_a_wrong_password_is_said_and_the_right_one_leads_on(opened: Opener, filled: Filled) -> None:
    page = opened(f"/patients/{filled.patient}", signed_in=False, stays=True)
    expect(page).to_have_url(re.compile(r"/sign-in\?next="))
    page.get_by_label("User name").fill("anna")
    page.get_by_label("Password").fill("not the password")
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("alert")).to_contain_text("Incorrect name or password")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    page.wait_for_url(re.compile(rf":\d+/patients/{filled.patient}$"))


def test_signing_out_ends_the_sign_in(opened: Opener, running: RunningServer) -> None:
    page = opened("/sign-in?next=/account", signed_in=False, stays=True)
    page.get_by_label("User name").fill("anna")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    page.wait_for_url(re.compile(r":\d+/account$"))  # loaded: its button works
    page.get_by_role("button", name="Sign out").click()
    page.wait_for_url(re.compile(r"/sign-in$"))
    page.goto("/patients")
    expect(page).to_have_url(re.compile(r"/sign-in\?next="))


@pytest.mark.journey
def test_a_patient_is_added_found_renamed_and_deleted(opened: Opener) -> None:
    page = opened("/patients", stays=True)
    page.get_by_role("button", name="New patient").first.click()
    page.locator("dialog[open]").get_by_label("Code").fill("Ü-17 (b)")
    page.get_by_role("button", name="Add patient").click()
    page.wait_for_url(re.compile(r"/patients/[0-9a-f]{32}$"))
    page.get_by_role("button", name="Edit").click()
    page.locator("dialog[open]").get_by_label("Code").fill("Ü-18 (b)")
    page.get_by_role("button", name="Save").click()
    expect(page.locator("h1")).to_contain_text("Ü-18 (b)")
    page.goto("/patients")
    page.get_by_label("Search by code or note").fill("ü-18")
    rows = page.locator("#patient-rows tr:visible")
    expect(rows).to_have_count(1)
    rows.first.click()
    page.wait_for_url(re.compile(r"/patients/[0-9a-f]{32}$"))  # loaded: its buttons work
    _delete(page, typed="Ü-17 (b)")
    assert page.locator("dialog[open] input:invalid").count() == 1, "a wrong code must not pass"
    page.keyboard.press("Escape")
    _delete(page, typed="Ü-18 (b)")
    page.wait_for_url(re.compile(r":\d+/patients$"))
    expect(page.locator("#patient-rows")).not_to_contain_text("Ü-18")


def test_a_code_that_is_taken_is_said_in_the_dialog(opened: Opener, filled: Filled) -> None:
    page = opened("/patients", stays=True)
    page.get_by_role("button", name="New patient").first.click()
    page.locator("dialog[open]").get_by_label("Code").fill("P-0042")
    page.get_by_role("button", name="Add patient").click()
    expect(page.locator("dialog[open] .form-error")).to_contain_text("P-0042")


def test_another_mapping_runs_the_analysis_again(
    opened: Opener, filled: Filled, running: RunningServer
) -> None:
    files, sensors = filling.simulated_files()
    with running.client() as client:
        patient = filling.add(client, "/patients", code="AGAIN")["id"]
        session = filling.add_session(client, patient, "Walk")
        filling.upload(client, session, files)
        turn = {"l": "r", "r": "l"}
        wrong = {d: s[:-1] + turn[s[-1]] if s and s[-2:] in {"_l", "_r"} else s for d, s in sensors.items()}
        filling.analyse(client, session, wrong)
    page = opened(f"/sessions/{session}/data", stays=True)
    page.get_by_role("link", name="Change mapping").click()
    page.wait_for_url(re.compile(r"/upload$"))
    page.get_by_role("button", name="Swap left and right").click()
    page.get_by_role("button", name="Analyse").click()
    page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), wait_until="commit")
    with running.client() as client:
        filling.wait(client, client.get("/api/v1/jobs").json()[0]["id"])
    # the page hears of the end by itself and loads the new results
    expect(page.locator("job-progress")).to_have_count(0, timeout=30_000)
    expect(page.locator("gait-view")).to_be_visible(timeout=30_000)
    page.wait_for_load_state("networkidle")
    page.goto(f"/sessions/{session}/data")
    expect(page.get_by_role("heading", name="Earlier analyses")).to_be_visible()
    terms = page.locator("section:has(#h-sens) dt").all_inner_texts()
    values = page.locator("section:has(#h-sens) dd").all_inner_texts()
    visible_mapping = dict(zip(terms, values, strict=True))
    left_foot = next(d for d, s in sensors.items() if s == "foot_l")
    assert visible_mapping[left_foot] == "Left foot"


def test_a_waiting_job_is_shown_live_and_can_be_cancelled(
    opened: Opener, filled: Filled, running: RunningServer
) -> None:
    files, _ = filling.simulated_files()
    with running.client() as client:
        patient = filling.add(client, "/patients", code="WAITING")["id"]
        session = filling.add_session(client, patient, "Walk")
        filling.upload(client, session, files)
    with running.without_workers():
        page = opened(f"/sessions/{session}/upload", stays=True)
        page.locator("[data-sides=keep]").click()
        page.get_by_role("button", name="Analyse").click()
        card = page.locator("job-progress.card")
        expect(card).to_contain_text("Waiting for the worker")
        expect(card).to_contain_text("Detect contacts and strides")
        expect(card).to_contain_text("You can close this page")
        expect(page.locator(".rail .count")).to_have_text("1")
        card.get_by_role("button", name="Cancel").click()
        # no reload by us: the page hears of the end by itself
        expect(page.locator("h3")).to_have_text("The analysis was cancelled")
    page.get_by_role("link", name="Check sensors").click()
    page.wait_for_url(re.compile(r"/upload$"))
    page.get_by_role("button", name="Analyse").click()
    expect(page.locator("gait-view")).to_be_visible(timeout=60_000)


def test_a_take_without_strides_says_why_and_offers_the_mapping(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.unusable}", stays=True)
    expect(page.locator(".quality")).to_contain_text("No strides")
    empty = page.locator(".empty", has_text="No strides found")
    assert len(empty.locator("p").inner_text()) > 40
    empty.get_by_role("link", name="Check sensors").click()
    expect(page.locator("sensor-map")).to_be_visible()


def test_an_unknown_page_is_a_page_with_a_way_back(opened: Opener) -> None:
    page = opened("/sessions/00000000000000000000000000000000", stays=True)
    expect(page.locator("h1")).to_have_text("Page not found")
    page.get_by_role("link", name="Patients").click()
    page.wait_for_url(re.compile(r":\d+/patients$"))


def test_an_assistant_sees_uploads_but_no_results(
    opened: Opener, filled: Filled, running: RunningServer
) -> None:
    with running.client() as client:
        filling.add(client, "/users", name="tom", role="assistant", password=PASSWORD)
    page = opened("/sign-in?next=/patients", signed_in=False, stays=True)
    page.get_by_label("User name").fill("tom")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    page.wait_for_url(re.compile(r":\d+/patients$"))
    expect(page.locator(".rail .item")).to_have_text(["Patients", "Jobs", "Sensors", "Theme", "Account"])
    page.goto(f"/sessions/{filled.done}")
    assert page.locator(".params").count() == 0
    assert page.goto(f"/sessions/{filled.done}/kinematics").status == 403  # type: ignore[union-attr]
    page.goto(f"/sessions/{filled.unmapped}/upload")
    expect(page.locator("upload-area")).to_be_visible()
    assert page.locator("[data-analyse]").count() == 0
    assert page.locator("[data-swap]").count() == 0


def test_light_and_dark_can_be_chosen_and_are_remembered(opened: Opener) -> None:
    page = opened("/patients", stays=True)
    ground = "getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(ground)
    page.locator(".rail [data-theme-toggle]").click()
    dark = page.evaluate(ground)
    assert dark != light
    page.goto("/jobs")
    assert page.evaluate(ground) == dark


def _delete(page: Page, typed: str) -> None:
    page.get_by_role("button", name="Delete patient").first.click()
    page.locator("dialog[open] input").fill(typed)
    page.locator("dialog[open]").get_by_role("button", name="Delete patient").click()


def test_a_form_is_kept_when_the_sign_in_ends_and_its_end_is_told_before(
    opened: Opener, running: RunningServer
) -> None:
    page = opened("/sign-in?next=/patients", signed_in=False)
    page.get_by_label("User name").fill(NAME)
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    page.wait_for_url(re.compile(r":\d+/patients$"))
    page.wait_for_load_state()
    page.get_by_role("button", name="New patient").first.click()
    page.locator("#new-patient").get_by_label("Code", exact=True).fill("KEPT-1")
    page.get_by_label("Note", exact=True).fill("Long and carefully written.")
    # two minutes before the end it is told; whoever stays is asked of the server, which counts it
    soon = page.locator("#sign-out-soon")
    page.route("**/api/v1/sign-in", lambda r: r.fulfill(json={"name": NAME, "left_s": 100}), times=1)
    page.evaluate("() => import('/static/js/sign-out.js')")
    expect(soon).to_be_visible()
    expect(soon).to_contain_text(re.compile(r"hidden in 1:\d\d"))
    with page.expect_response("**/api/v1/sign-in"):  # else it would find the end below
        soon.get_by_role("button", name="Stay signed in").click()
    expect(soon).to_be_hidden()
    # the end: the server forgets this sign-in
    token = next(c["value"] for c in page.context.cookies() if c["name"] == "sid")
    with contextlib.closing(Database(running.folder / "sagittal.db")) as db, db.write() as c:
        c.execute(delete(login_session).where(login_session.c.token_sha256 == token_hash(token)))
    page.get_by_role("button", name="Add patient").click()
    out = page.locator("#signed-out")
    expect(out).to_be_visible()
    page.keyboard.press("Escape")
    expect(out).to_be_visible()
    out.get_by_label(f"Password of {NAME}").fill("wrong by intention")
    out.get_by_role("button", name="Sign in").click()
    expect(out.get_by_role("alert")).to_be_visible()
    out.get_by_label(f"Password of {NAME}").fill(PASSWORD)
    out.get_by_role("button", name="Sign in").click()
    expect(out).to_be_hidden()
    expect(page.get_by_label("Note", exact=True)).to_have_value("Long and carefully written.")
    page.get_by_role("button", name="Add patient").click()
    page.wait_for_url(re.compile(r"/patients/[0-9a-f]{32}$"))
    expect(page.locator("h1")).to_contain_text("KEPT-1")
    # notes have their day
    page.wait_for_load_state()
    page.get_by_role("region", name="Notes").get_by_role("button", name="Add", exact=True).click()
    page.get_by_label("Note", exact=True).last.fill("Wants to walk to the bakery.")
    page.get_by_role("button", name="Add note").click()
    expect(page.locator(".notes")).to_contain_text("Wants to walk to the bakery.")
