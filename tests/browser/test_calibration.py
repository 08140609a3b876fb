"""The tab of a calibration: a segment of the picture leads to its checks."""

from __future__ import annotations

from playwright.sync_api import expect

from tests.browser.conftest import Filled, Opener


def test_a_segment_leads_to_its_checks(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}/calibration", stays=True)
    segment = page.locator("svg.calbody a").last
    words = segment.get_attribute("aria-label") or ""
    segment.focus()
    page.keyboard.press("Enter")
    card = page.locator(":target")
    expect(card).to_be_in_viewport()
    expect(card.get_by_role("heading")).to_have_text(words.partition(":")[0])
    expect(card.locator("tbody tr").first).to_be_visible()
