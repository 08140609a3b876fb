"""The first start: one printed address, one administrator, no default password."""

from __future__ import annotations

import re
import time
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, expect

from tests.browser.conftest import PASSWORD, serve
from tests.browser.design import layout_faults, text_faults


@pytest.mark.first
def test_the_printed_address_makes_the_first_administrator_once(flat: Browser, tmp_path: Path) -> None:
    with serve(tmp_path) as server:
        address = _printed(tmp_path / "server.log")
        page = flat.new_page(base_url=server.url)
        page.goto(address)
        assert not layout_faults(page) | text_faults(page)
        page.get_by_label("User name").fill("maria")
        page.get_by_label("Password", exact=True).fill(PASSWORD)
        page.get_by_label("Repeat password").fill("another sentence")
        page.get_by_role("button", name="Create account").click()
        assert page.locator("input:invalid").count() == 1, "two different passwords must not pass"
        page.get_by_label("Repeat password").fill(PASSWORD)
        page.get_by_role("button", name="Create account").click()
        page.wait_for_url(re.compile(r":\d+/patients$"))
        expect(page.locator(".empty")).to_contain_text("No patients yet")
        expect(page.locator(".rail")).to_contain_text("Audit")
        page.goto(address)
        expect(page.locator("h1")).to_contain_text("has been used")
        page.close()


def _printed(log: Path) -> str:
    """The set-up address; printed once requests are answered."""
    end = time.monotonic() + 20
    while time.monotonic() < end:
        match = re.search(r"http://\S+/set-up/\S+", log.read_text())
        if match:
            assert httpx.get(match[0]).is_success
            return match[0]
        time.sleep(0.1)
    raise AssertionError(f"no set-up address in:\n{log.read_text()}")
