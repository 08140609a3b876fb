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
    page.get_by_label("Therapist's assessment").last.fill("Longer steps.\n\nPlan: go on.")
    page.get_by_role("button", name="Save assessment").click()
    expect(page.get_by_role("status").filter(has_text="Saved")).to_be_visible()
    page.get_by_role("button", name="Sign", exact=True).click()
    with page.expect_navigation():
        page.get_by_role("button", name="Sign and lock").click()
    expect(page.get_by_text("Version 1 is signed and locked")).to_be_visible()
    expect(page.get_by_role("button", name="Save assessment")).to_have_count(0)
    page.get_by_role("button", name="Share").click()
    page.get_by_role("button", name="Create link").click()
    slip = page.locator("#slip")
    expect(slip.get_by_role("img", name="QR code of the address")).to_be_visible()
    assert slip.locator("img").evaluate("i => i.complete && i.naturalWidth > 0")
    assert not layout_faults(page) | text_faults(page)
    url = slip.locator("[data-url]").inner_text()
    assert page.content().count(url) == 1
    # the slip goes to somebody else: nothing else is on the paper, the patient's code least of all
    page.emulate_media(media="print")
    expect(slip).to_be_visible()
    for second in (page.locator(".page-head"), page.get_by_role("heading", name="Signed versions")):
        expect(second).to_be_hidden()
    page.emulate_media(media="null")
    # whoever has no account
    outside = opened(url, signed_in=False)
    expect(outside.get_by_text("Longer steps.")).to_be_visible()
    evaluation = outside.locator(".sheet").first.evaluate("s => getComputedStyle(s).width")
    assert evaluation.startswith("793"), "its style came with it"
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
    expect(page.get_by_role("button", name="Save assessment")).to_be_visible()


@pytest.mark.parametrize("width", [1280, 360])
def test_an_assessment_that_does_not_fit_is_neither_cut_nor_saved(
    opened: Opener, filled: Filled, width: int
) -> None:
    page = opened(f"/sessions/{filled.earlier}/report", width=width)
    text = page.locator("#f-content")
    room, save = page.locator("[data-left]").first, page.get_by_role("button", name="Save assessment")
    saved = page.locator("[data-saved]")
    sent: list[str] = []
    page.on("request", lambda r: sent.append(r.url) if r.method == "PUT" else None)
    text.fill("Kurz.")
    expect(room).to_have_text("415 characters left")
    text.fill("")
    text.focus()
    page.keyboard.insert_text("Longer steps. " * 31)  # as a paste
    long = text.input_value()
    assert len(long) == 434
    expect(room).to_have_text("14 characters too long")
    assert not layout_faults(page) | text_faults(page)
    save.click()
    expect(text).to_have_js_property("validationMessage", "The text is too long: at most 420 characters fit.")
    expect(text).to_be_focused()
    assert (text.input_value(), sent) == (long, [])
    # a page of before an update asks the server, which refuses, too
    text.evaluate("(t) => { t.setCustomValidity(''); t.form.noValidate = true; }")
    save.click()
    expect(page.get_by_role("alert")).to_contain_text("The assessment has 433 characters; at most 420 fit.")
    expect(text).to_have_value(long)
    expect(saved).to_have_text("")
    text.fill(long[:420])
    expect(room).to_have_text("0 characters left")
    save.click()
    expect(saved).to_have_text("Saved")
    expect(page.get_by_role("alert").first).to_be_hidden()
    page.reload()  # without a question
    expect(text).to_have_value(long[:420].rstrip())
    text.press("End")
    text.press_sequentially("!")
    expect(saved).to_have_text("")
