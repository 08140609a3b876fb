"""The tab of a session on which filters are chosen, run, and held against a reference."""

from __future__ import annotations

import csv
import io
import re

import pyarrow.parquet as pq
from playwright.sync_api import FilePayload, expect

from tests.browser.conftest import Filled, Opener, RunningServer
from tests.browser.design import all_faults


def test_filters_are_chosen_run_and_compared_with_a_reference(
    opened: Opener, filled: Filled, running: RunningServer
) -> None:
    with running.client() as client:
        analysis = client.get(f"/api/v1/sessions/{filled.done}/analyses").json()[0]["id"]
        poses = client.get(f"/api/v1/analyses/{analysis}/files/poses.parquet").content
    table = pq.read_table(io.BytesIO(poses))
    names = [f"shank_l_q_{part}" for part in "wxyz"]
    text = io.StringIO()
    csv.writer(text).writerows(
        [("time", *names), *zip(*(table[n].to_pylist() for n in ("t_s", *names)), strict=True)]
    )

    page = opened(f"/sessions/{filled.done}/algorithms")
    expect(page.get_by_text("No filters have been compared on this trial yet")).to_be_visible()
    file = FilePayload(name="optical.csv", mimeType="text/csv", buffer=text.getvalue().encode())
    with page.expect_navigation():
        page.locator("[data-file]").set_input_files(file)
    expect(page.get_by_role("link", name="optical.csv")).to_be_visible()

    for engine in page.locator("[data-engine]").all():
        engine.check()
    expect(page.get_by_text("39 of 39 selected")).to_be_visible()
    for engine in page.locator("[data-engine]").all():
        engine.uncheck()
    expect(page.get_by_text("0 of 39 selected")).to_be_visible()
    page.get_by_role("button", name="Run on this trial").click()
    expect(page.locator("filter-choice .form-error")).to_be_visible()
    page.get_by_label("Mahony2008").check()
    page.get_by_label("Hua2014").check()
    page.get_by_label("Martin2010").check()
    page.get_by_label("Use the magnetometer in filters that support it").uncheck()
    page.get_by_label("Compare with a reference").select_option("optical.csv")
    page.get_by_role("button", name="Run on this trial").click()
    expect(page.get_by_role("heading", name="Summary")).to_be_visible(timeout=90_000)
    expect(page.get_by_text(re.compile("Martin2010 requires a magnetometer"))).to_be_visible()
    expect(page.get_by_role("heading", name="Against the reference")).to_be_visible()
    expect(page.locator("circle.ba").first).to_be_attached()
    page.wait_for_load_state()  # its script sends the choice
    page.get_by_label("Plot of").select_option("mahony_2008")
    expect(page.get_by_text("Left shank, heading · Mahony2008")).to_be_visible()
    page.get_by_role("link", name="Time", exact=True).click()
    expect(page.locator(".kin .ml").first).to_be_attached()
    faults = all_faults(page)
    assert not faults, "\n".join(faults)
