"""From a number to its strides, and from a stride to its signals and figure."""

from __future__ import annotations

import re

from playwright.sync_api import expect

from tests.browser.conftest import Filled, Opener


def test_a_number_opens_to_its_strides_and_a_stride_to_its_moment(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}", stays=True)
    page.locator("summary", has_text="Timing").click()
    page.locator(".params").get_by_role("link", name="Stride time").click()
    page.wait_for_url(re.compile(r"/parameters/stride_time_s$"))
    expect(page.locator("main")).to_contain_text("From a contact of the foot to its next.")
    expect(page.locator("main")).to_contain_text("95 % CI")
    rows = page.locator("table tbody tr")
    counted_strides = [float(r) for r in page.locator("tr:has-text('yes') td:nth-child(4)").all_inner_texts()]
    assert rows.count() > len(counted_strides) > 40, "strides that are left out stand there too"
    assert all(0.9 < value < 1.3 for value in counted_strides)
    marks = page.locator(".chart.behind circle")
    assert marks.count() == rows.count()
    page.get_by_role("link", name="Signals and avatar").nth(10).click()
    page.wait_for_url(re.compile(r"/timeline#t=\d+\.\d+$"))
    expect(page.locator("[data-stride-box]")).to_contain_text("Contact")


def test_a_value_is_found_by_its_name_among_all_folds(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}", stays=True)
    page.get_by_label("Find a value").fill("toe clearance")
    element = page.locator("all-values tbody tr:visible")
    expect(element.first).to_be_visible()
    assert all("toe clearance" in row.lower() for row in element.all_inner_texts())
    page.get_by_label("Find a value").fill("wingspan")
    expect(page.get_by_text("No matching value.")).to_be_visible()
    expect(element).to_have_count(0)
    page.get_by_label("Find a value").fill("")
    expect(page.locator("all-values summary").first).to_be_visible()
    assert page.locator("all-values details[open]").count() == 0
