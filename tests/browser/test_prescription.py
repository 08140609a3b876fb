"""Feedback is prescribed on the patient's page: targets of this person, one record, its history."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from tests.browser import filling
from tests.browser.conftest import Filled, Opener, RunningServer
from tests.browser.design import all_faults


@pytest.fixture(scope="module")
def walker(running: RunningServer) -> str:
    """A patient with one analysed walk."""
    files, sensors = filling.simulated_files()
    with running.client() as client:
        patient = filling.add(
            client, "/patients", code="P-0110", sex="male", birth_year=1968, height_m=1.76,
            affected_side="left",
        )["id"]  # fmt: skip
        session = filling.add_session(client, patient, "Walk, own pace")
        filling.upload(client, session, files)
        assert filling.analyse(client, session, sensors)["state"] == "done"
    return str(patient)


@pytest.mark.journey
def test_a_prescription_is_written_changed_and_ended(opened: Opener, walker: str) -> None:
    page = opened(f"/patients/{walker}", stays=True)
    page.get_by_role("link", name="Prescribe").click()
    page.wait_for_url(re.compile(r"/prescription$"))
    # one choice says it all; the rest waits behind "More"
    summary = page.locator("[data-summary]")
    expect(summary).to_have_text(
        re.compile(
            r"Step length, (left|right); target 0\.\d+ ± 0\.\d+\s?m \(person's better side\); shown as"
        )
    )
    worse = "left" if "Step length, left" in summary.inner_text() else "right"
    expect(page.get_by_label("Probe after")).to_be_hidden()
    page.get_by_role("radio", name="Heel first").check()
    expect(summary).to_contain_text(re.compile("Foot pitch at contact, (left|right); target"))
    expect(page.locator("[data-summary]")).to_contain_text("bar and tone")
    page.get_by_text("More: side, target").click()
    page.get_by_label("Parameter", exact=True).select_option("stride_length_m")
    expect(page.get_by_label("Left affected")).to_be_disabled()
    expect(page.get_by_role("radio", name="Both", exact=True)).to_be_checked()
    expect(page.get_by_text("It is common to both sides")).to_be_visible()
    page.get_by_label("Parameter", exact=True).select_option("step_length_m")
    sides = {"left": page.get_by_label("Left affected"), "right": page.get_by_label("Right", exact=True)}
    better_side = "right" if worse == "left" else "left"
    sides[better_side].check()
    page.get_by_role("checkbox", name="Tone").uncheck()
    better = page.locator("[data-source=own_better_side]")
    expect(better.get_by_role("radio")).to_be_disabled()
    expect(better.locator("[data-words]")).to_contain_text(f"The {better_side} side is the better one")
    sides[worse].check()
    expect(better.locator("[data-value]")).to_have_text(re.compile(r"0\.\d+ ± 0\.\d+\s?m"))
    expect(better.locator("[data-words]")).to_contain_text(f"{better_side} side")
    better.get_by_role("radio").check()
    page.get_by_role("checkbox", name="Tone").check()
    page.get_by_label("Probe after").fill("30")
    page.get_by_label("Ends after").fill("")
    page.get_by_role("button", name="Prescribe").click()
    page.wait_for_url(re.compile(rf"/patients/{walker}$"))
    card = page.get_by_role("region", name="Feedback prescription")
    expect(card).to_contain_text(f"Step length, {worse}")
    expect(card).to_contain_text(f"{better_side} side")
    expect(card).to_contain_text("a bar, a tone outside the zone")
    expect(card).to_contain_text("after every 30, 10 without")
    card.get_by_role("link", name="Change").click()
    page.wait_for_url(re.compile(r"/prescription$"))
    expect(page.get_by_role("checkbox", name="Tone")).to_be_checked()
    expect(page.get_by_label("Ends after")).to_have_value("")
    page.get_by_label("Parameter", exact=True).select_option("stance_pct")
    expect(page.locator("[data-source=norm]").get_by_role("radio")).to_be_enabled()
    page.get_by_role("radio", name="Entered").check()
    page.get_by_label("Mean, %").fill("63.5")
    page.get_by_label("SD, %").fill("0")
    page.get_by_role("button", name="Prescribe").click()
    expect(page.get_by_role("alert")).to_contain_text("target.sd is 0. Expected more than 0")
    page.get_by_label("SD, %").fill("1.5")
    page.get_by_role("button", name="Prescribe").click()
    page.wait_for_url(re.compile(rf"/patients/{walker}$"))  # with the script that opens its dialog
    expect(card).to_contain_text("63.5 ± 1.5\u202f%, entered")
    card.get_by_text("Ended before (1)").click()
    expect(card.get_by_role("listitem")).to_contain_text(f"Step length, {worse}")
    card.get_by_role("button", name="End").click()
    page.get_by_role("dialog").get_by_role("button", name="End prescription").click()
    expect(card).to_contain_text("Ended before (2)")
    expect(card.get_by_role("link", name="Prescribe")).to_be_visible()


def test_without_a_walk_only_an_entered_target_can_be_chosen(opened: Opener, filled: Filled) -> None:
    with_nothing = opened("/patients")
    with_nothing.get_by_role("link", name="P-0043").click()
    with_nothing.wait_for_url(re.compile(r"/patients/[0-9a-f]{32}$"))
    patient = with_nothing.url.rsplit("/", 1)[1]
    page = opened(f"/patients/{patient}/prescription")
    page.get_by_text("More: side, target").click()
    expect(page.get_by_role("radio", name="Entered")).to_be_checked()
    for source in ("norm", "own_better_side", "own_baseline"):
        expect(page.locator(f"[data-source={source}]").get_by_role("radio")).to_be_disabled()
    expect(page.locator("[data-source=norm] [data-words]")).to_contain_text("No walk without feedback")


def test_the_form_is_filled_with_the_keyboard_alone(opened: Opener, walker: str) -> None:
    page = opened(f"/patients/{walker}/prescription", stays=True)
    expect(page.locator("[data-source=own_baseline] [data-value]")).not_to_be_empty()
    page.locator("[data-more] > summary").focus()
    page.keyboard.press("Enter")
    page.get_by_label("Parameter", exact=True).focus()
    page.keyboard.press("Tab")
    right = page.get_by_role("radio", name="Right", exact=True)
    for _ in range(3):
        if right.is_checked():
            break
        page.keyboard.press("ArrowRight")
    expect(right).to_be_checked()
    page.keyboard.press("Tab")
    for _ in range(4):
        if page.locator("[data-source=own_baseline] input").is_checked():
            break
        page.keyboard.press("ArrowDown")
    expect(page.locator("[data-source=own_baseline] input")).to_be_checked()
    page.get_by_role("button", name="Prescribe").focus()
    page.keyboard.press("Enter")
    page.wait_for_url(re.compile(rf"/patients/{walker}$"))
    expect(page.get_by_role("region", name="Feedback prescription")).to_contain_text("Step length, right")


def test_the_pages_obey_the_design_system(opened: Opener, walker: str) -> None:
    faults = []
    for path in (f"/patients/{walker}/prescription", f"/patients/{walker}"):
        page = opened(path, stays=True)
        page.wait_for_load_state("networkidle")
        faults += [f"{path} {fault}" for fault in all_faults(page)]
    assert not faults, "\n".join(faults)
