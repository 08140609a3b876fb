"""A therapist writes the assessment, signs, hands out a link and takes it back, all on the page."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import Filled, Opener
from tests.browser.design import layout_faults, text_faults


@pytest.mark.journey
def test_a_report_is_signed_shared_by_a_slip_with_a_code_and_reopened(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}/print")
    page.get_by_role("link", name="Sign, share").click()
    page.get_by_label("Assessment of the therapist").last.fill("Longer steps.\n\nPlan: go on.")
    with page.expect_navigation():
        page.get_by_role("button", name="Save the text").click()
    page.get_by_role("button", name="Sign", exact=True).click()
    with page.expect_navigation():
        page.get_by_role("button", name="Sign and lock").click()
    expect(page.get_by_text("Version 1 is signed and locked")).to_be_visible()
    expect(page.get_by_role("button", name="Save the text")).to_have_count(0)
    page.get_by_role("button", name="Share").click()
    page.get_by_role("button", name="Make the link").click()
    slip = page.locator("#slip")
    expect(slip.get_by_role("img", name="QR code of the address")).to_be_visible()
    assert slip.locator("img").evaluate("i => i.complete && i.naturalWidth > 0")
    assert not layout_faults(page) | text_faults(page)
    url = slip.locator("[data-url]").inner_text()
    assert page.content().count(url) == 1
    # the slip goes to somebody else: nothing else is on the paper, the patient's code least of all
    page.emulate_media(media="print")
    expect(slip).to_be_visible()
    for other in (page.locator(".page-head"), page.get_by_role("heading", name="Signed versions")):
        expect(other).to_be_hidden()
    page.emulate_media(media="null")
    # whoever has no account
    outside = opened(url, signed_in=False)
    expect(outside.get_by_text("Longer steps.")).to_be_visible()
    said = outside.locator(".sheet").first.evaluate("s => getComputedStyle(s).width")
    assert said.startswith("793"), "its style came with it"
    with page.expect_navigation():
        page.get_by_role("link", name="Done").click()
    with page.expect_navigation():
        page.get_by_role("button", name="Revoke the link").click()
    outside.reload()
    expect(outside.get_by_text("Longer steps.")).to_have_count(0)
    page.get_by_role("button", name="Reopen").click()
    page.get_by_label("Why").fill("Typing error")
    with page.expect_navigation():
        page.get_by_role("dialog").get_by_role("button", name="Reopen").click()
    expect(page.get_by_role("button", name="Save the text")).to_be_visible()
