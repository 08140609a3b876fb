"""A real recording goes in through the browser, a clinical session comes out."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.browser.conftest import NAME, PACED, PASSWORD, Opener, RunningServer
from tests.browser.filling import add, add_session, simulated_files, upload
from tests.browser.network import Network
from tests.data import ROOT, data_folder

pytestmark = pytest.mark.usefixtures("unknown_sensors")

SEGMENTS = {
    "00B40B91": "pelvis",
    "00B40C45": "thigh_l",
    "00B40C3C": "thigh_r",
    "00B40BA5": "shank_l",
    "00B40C35": "shank_r",
    "00B40C55": "foot_l",
    "00B40C48": "foot_r",
}
"""Where each sensor was worn (README of the recording)."""


@pytest.mark.journey
def test_eleven_files_become_a_session_page(solid: Browser, running: RunningServer) -> None:
    files = sorted(data_folder("neura_walk", "rawimu").glob("*.txt"))
    assert len(files) == 11
    context = solid.new_context(base_url=running.url, viewport={"width": 1280, "height": 800})
    context.add_init_script(PACED)
    page = context.new_page()
    _sign_in(page)
    _new_session(page)
    page.locator("[data-files]").set_input_files([str(f) for f in files])

    # what was found: nine sensors, two byte copies said
    element = page.locator("sensor-map")
    expect(element).to_be_visible(timeout=60_000)
    facts = page.locator("dl.dl").inner_text()
    assert "9 and 2 copies" in facts
    assert "100 Hz" in facts
    copies = page.locator(".note", has_text="copies of others")
    expect(copies).to_contain_text("“00B40C49” of “00B40C44”")
    expect(copies).to_contain_text("“00B40C4A” of “00B40C47”")

    _map_sensors(page)
    page.locator("[data-analyse]").click()
    page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), wait_until="commit")
    expect(page.locator("h2", has_text="Key values")).to_be_visible(timeout=120_000)

    session = page.url
    _has_figures(page)
    page.goto(session)
    _replays(page, session)
    page.goto(f"{session}/kinematics")
    expect(page.locator(".kin .chart.cycle")).not_to_have_count(0)
    assert page.locator(".kin path.ml").count() >= 8, "left mean curves"
    assert page.locator(".kin path.mr").count() >= 8, "right mean curves"
    context.close()


def test_a_table_without_a_time_asks_for_it_in_words(opened: Opener, running: RunningServer) -> None:
    table = data_folder("gaitmap_foot", "imu_sample.csv")
    data = table.read_bytes().replace(b"_sensor", b"_shoe")  # no table of these columns was described before
    with running.client() as client:
        patient = add(client, "/patients", code="NO-TIME")["id"]
        session = add_session(client, patient, "Walk, no time")
        client.put(f"/api/v1/sessions/{session}/files/{table.name}", content=data).raise_for_status()
    page = opened(f"/sessions/{session}/upload")
    element = page.locator("[data-check=bad]")
    expect(element).to_have_text("Enter the sampling rate or select the time column.")
    page.locator("[data-rate]").fill("204.8")
    expect(element).to_have_count(0)
    expect(page.locator("[data-check]")).to_have_count(2)


def test_a_visit_of_wrong_files_is_deleted_where_it_is_said(opened: Opener, running: RunningServer) -> None:
    with running.client() as client:
        patient = add(client, "/patients", code="WRONG")["id"]
        session = add_session(client, patient, "Walk, another file")
    page = opened(f"/sessions/{session}/upload", width=1024, height=768)
    page.locator("[data-files]").set_input_files(
        {"name": "notes.txt", "mimeType": "text/plain", "buffer": b"Walked well.\n"}
    )
    expect(page.get_by_text("These files could not be read")).to_be_visible(timeout=60_000)
    page.get_by_role("button", name="Delete visit").click()
    page.locator("dialog[open]").get_by_role("button", name="Delete visit").click()
    page.wait_for_url(f"**/patients/{patient}")
    with running.client() as client:
        assert client.get(f"/api/v1/sessions/{session}").status_code == 404


def test_why_nothing_can_be_analysed_is_said_on_a_tablet(opened: Opener, running: RunningServer) -> None:
    with running.client() as client:
        patient = add(client, "/patients", code="TABLET")["id"]
        session = add_session(client, patient, "Walk, no places")
        upload(client, session, simulated_files()[0])
    page = opened(f"/sessions/{session}/upload", width=1024, height=768)
    for select in page.locator("tr[data-device] select").all():
        select.select_option("")
    expect(page.locator("[data-analyse]")).to_be_disabled()
    expect(page.get_by_text("0 of 7 sensors assigned")).to_be_visible()


def test_a_table_with_its_manifest_is_analysed_as_from_the_command_line(
    opened: Opener, running: RunningServer, tmp_path: Path
) -> None:
    table = data_folder("gaitmap_foot", "imu_sample.csv")
    sides = {f"foot_{side[0]}": f"{side}_sensor" for side in ("left", "right")}
    columns = {
        foot: {kind: [f"{name}/{kind}_{axis}" for axis in "xyz"] for kind in ("acc", "gyr")}
        for foot, name in sides.items()
    }
    entry = {
        "file": table.name, "header_rows": 2, "index_column": True, "rate_hz": 204.8,
        "acc_unit": "m/s2", "gyr_unit": "deg/s", "columns": columns,
    }  # fmt: skip
    manifest = tmp_path / "manifest.json"
    manifest.write_text(
        json.dumps({"subject": {"height_m": 1.76, "standing_width_m": 0.21}, "sources": [entry]})
    )
    with running.client() as client:
        patient = add(client, "/patients", code="TABLE")["id"]
        session = add_session(client, patient, "Walk, a table")
    page = opened(f"/sessions/{session}/upload")
    page.locator("[data-files]").set_input_files([str(table), str(manifest)])
    expect(page.locator("sensor-map")).to_be_visible(timeout=60_000)
    for foot in sides:
        expect(page.locator(f"tr[data-device={foot}] select")).to_have_value(foot)
    # what the file's manifest measured is shown, so that a person can correct it
    expect(page.get_by_label("Distance between the ankles while standing")).to_have_value("0.21")
    page.locator("[data-analyse]").click()
    page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), wait_until="commit")
    expect(page.locator(".params").first).to_be_visible(timeout=180_000)
    # long names and doubtful values leave room for every column, and a key number for its unit
    page.set_viewport_size({"width": 1280, "height": 800})
    boxes = page.locator("#rows > .scroll:has(.params), .h-list a").evaluate_all(
        "all => all.map(e => e.scrollWidth - e.clientWidth)"
    )
    assert boxes
    assert max(boxes) <= 1, boxes

    out = tmp_path / "out"
    command = [
        sys.executable,
        "-m",
        "sagittal.server.main",
        "analyse",
        str(table),
        "--manifest",
        str(manifest),
    ]
    subprocess.run([*command, "--out", str(out)], cwd=ROOT, check=True, capture_output=True)
    with running.client() as client:
        for name in ("events.csv", "strides.csv"):
            served = client.get(f"/api/v1/sessions/{session}/{name}").raise_for_status().content
            assert served == (out / name).read_bytes(), name


def _sign_in(page: Page) -> None:
    page.goto("/")
    page.get_by_label("User name").fill(NAME)
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    page.wait_for_url("**/patients")


def _new_session(page: Page) -> None:
    page.get_by_role("button", name="New patient").first.click()
    dialog = page.locator("dialog[open]")
    dialog.get_by_label("Code").fill("NEURA-S02")
    dialog.get_by_label("Height in metres").fill("1.75")
    dialog.get_by_role("button", name="Add patient").click()
    page.wait_for_url(re.compile(r"/patients/[0-9a-f]{32}$"))
    page.get_by_role("link", name="New visit").first.click()
    page.wait_for_url("**/sessions/new")  # loaded: its script is there
    page.get_by_role("button", name="Upload a recording").click()
    page.wait_for_url("**/upload")


def _map_sensors(page: Page) -> None:
    """The movement gives the parts; which leg is the left one is asked, and here the guess is wrong."""
    analyse = page.locator("[data-analyse]")
    expect(analyse).to_be_disabled()
    question = page.locator("[data-ask]")
    expect(question.locator("[data-ask-id]")).to_have_text(re.compile(r"\S"))
    left_foot = question.locator("[data-ask-id]").inner_text()
    answer = "keep" if SEGMENTS[left_foot] == "foot_l" else "swap"
    page.locator(f"[data-sides={answer}]").click()
    expect(question).to_have_count(0)
    for row in page.locator("tr[data-device]").all():
        device = row.get_attribute("data-device") or ""
        assert row.locator("select").input_value() == SEGMENTS.get(device, ""), device
    expect(analyse).to_be_enabled()


def _has_figures(page: Page) -> None:
    page.get_by_role("link", name="How it was measured").click()
    quality = page.locator(".quality").inner_text()
    assert "Strides included" in quality
    page.locator("summary", has_text="Timing").click()
    stride_time = page.locator(".params tr", has_text="Stride time").first.inner_text()
    assert page.locator(".params tbody tr:not(.group)").count() >= 15
    figures = [float(f) for f in re.findall(r"(?<!± )\b\d\.\d\d", stride_time)[:2]]
    # README of the recording: strides of about 1.4 s
    assert all(1.2 < f < 1.6 for f in figures), stride_time


def _replays(page: Page, url: str) -> None:
    view = page.locator("gait-view[data-state=open]")
    expect(view).to_be_visible(timeout=30_000)
    canvas = page.frame_locator("gait-view iframe").locator("canvas[data-engine]")
    expect(canvas).to_be_visible(timeout=30_000)
    # the charts, the time bar and the figure follow one clock
    visible_attribute = view.get_attribute("data-shown")
    page.keyboard.press("j")
    expect(view).not_to_have_attribute("data-shown", visible_attribute or "", timeout=10_000)
    at = float(page.locator("time-bar input").input_value())
    expect(page.locator("[data-chart] .cursor").first).not_to_have_attribute("hidden", "hidden")
    page.wait_for_function(
        "at => Math.abs(Number(document.querySelector('gait-view').dataset.shown) - at) < 0.05", arg=at
    )
    assert url == page.url


def test_a_file_that_is_no_recording_is_said_in_a_sentence(
    flat: Browser, running: RunningServer, tmp_path: Path
) -> None:
    picture = tmp_path / "walk 🚶.jpg"
    picture.write_bytes(b"\xff\xd8\xff\xe0 no recording")
    context = flat.new_context(base_url=running.url)
    page = context.new_page()
    _sign_in(page)
    with running.client() as client:
        patient = client.post("/api/v1/patients", json={"code": "PICTURE"}).json()["id"]
        session = client.post(
            f"/api/v1/patients/{patient}/sessions", json={"title": "Walk", "performed_on": "2026-11-18"}
        ).json()["id"]
    page.goto(f"/sessions/{session}/upload")
    page.locator("[data-files]").set_input_files(str(picture))
    note = page.locator(".note.bad:visible")
    expect(note).to_contain_text("These files could not be read", timeout=30_000)
    assert len(note.inner_text()) > 60
    expect(page.locator("details .files")).to_contain_text("walk 🚶.jpg")
    context.close()


def test_a_file_that_breaks_off_can_be_tried_again(
    flat: Browser, running: RunningServer, tmp_path: Path
) -> None:
    files = {"one.txt": b"first", "two.txt": b"second"}
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    context = flat.new_context(base_url=running.url)
    page = context.new_page()
    _sign_in(page)
    with running.client() as client:
        patient = client.post("/api/v1/patients", json={"code": "BROKEN"}).json()["id"]
        session = client.post(
            f"/api/v1/patients/{patient}/sessions", json={"title": "Walk", "performed_on": "2026-11-18"}
        ).json()["id"]
    page.goto(f"/sessions/{session}/upload")
    page.route("**/files/two.txt", lambda route: route.abort(), times=1)
    page.locator("[data-files]").set_input_files([str(tmp_path / name) for name in files])
    broken = page.locator("[data-sending] li.bad")
    expect(broken).to_contain_text("The connection was lost")
    expect(page.get_by_role("button", name="Continue without them")).to_be_visible()
    page.get_by_role("button", name="Try two.txt again").click()
    # both are there: the server looks into them and the page shows what it thinks of them
    expect(page.locator("details .files li")).to_have_count(2, timeout=30_000)
    context.close()


@pytest.mark.journey
def test_a_large_file_goes_on_after_a_lost_connection_and_after_a_reload(
    flat: Browser, running: RunningServer, tmp_path: Path
) -> None:
    large = tmp_path / "large.txt"
    large.write_bytes(np.random.default_rng(19).bytes(17_000_000))
    with running.client() as client:
        session = add_session(client, add(client, "/patients", code="LARGE")["id"], "Walk")
    network = Network(running.url)
    context = flat.new_context(base_url=network.url)
    page = context.new_page()
    _sign_in(page)
    page.goto(f"/sessions/{session}/upload")
    parts, cuts = list[int](), [4_000_000, 12_000_000]

    def watch(route: Route) -> None:
        if route.request.method == "PATCH":
            parts.append(int(route.request.headers["upload-offset"]))
            if cuts and parts[-1] == cuts[0]:
                cuts.pop(0)
                network.cut()
        route.continue_()

    page.route("**/uploads/*", watch)
    page.locator("[data-files]").set_input_files(str(large))
    say = page.locator("[data-sending] [data-say]")
    expect(say).to_contain_text("The upload resumes automatically")
    # the page finds how far the server is, and goes on there without anybody
    with page.expect_request(lambda r: r.headers.get("upload-offset") == "12000000", timeout=30_000):
        network.mend()
    expect(say).to_contain_text("The upload resumes automatically", timeout=30_000)
    page.on("dialog", lambda dialog: dialog.accept())
    page.goto("about:blank")
    network.mend()
    page.goto(f"/sessions/{session}/upload")
    expect(page.locator("[data-part]")).to_contain_text("Choose the file again to continue")
    parts.clear()
    page.locator("[data-files]").set_input_files(str(large))
    expect(page.locator("details .files")).to_contain_text("large.txt", timeout=30_000)
    assert min(parts) == 12_000_000, "nothing that was there was sent again"
    with running.client() as client:
        stored = client.get(f"/api/v1/sessions/{session}/files/large.txt").content
    assert stored == large.read_bytes()
    network.close()
    context.close()


def test_two_columns_cannot_both_be_the_time(opened: Opener, running: RunningServer, tmp_path: Path) -> None:
    channels = [
        f"L FOOT: {kind}.{axis} 1 [{unit}]"
        for kind, unit in (("ACC", "g"), ("GYRO", "dps"))
        for axis in "XYZ"
    ]
    file = tmp_path / "run.csv"
    rows = [",".join(f"{0.01 * i:.2f},{v}" for v in (0.0, 0.0, 1.0, 3.0, 0.0, 1.0)) for i in range(600)]
    file.write_text("\n".join([",".join(f"X [s],{c}" for c in channels), *rows]) + "\n")
    with running.client() as client:
        patient = add(client, "/patients", code="COLUMNS-1", height_m=1.75)["id"]
        session = add_session(client, patient, "Walk, 10 m overground")
    page = opened(f"/sessions/{session}/upload", stays=True)
    page.locator("[data-files]").set_input_files(file)
    columns = page.locator("column-map")
    expect(columns.locator("[data-check=bad]")).to_contain_text("select the time column", timeout=60_000)
    columns.get_by_label("Meaning of column X [s]#1").select_option("time")
    expect(columns.locator("[data-check=bad]")).to_have_count(0, timeout=20_000)
    columns.get_by_label("Meaning of column X [s]#3").select_option("time")
    expect(columns.locator("[data-check=bad]")).to_have_text(
        "Time is assigned to columns X [s]#1 and X [s]#3. Choose one of them."
    )
    expect(columns.get_by_role("button", name="Use these columns")).to_be_disabled()
    columns.get_by_label("Meaning of column X [s]#1").select_option("")
    expect(columns.get_by_role("button", name="Use these columns")).to_be_enabled(timeout=20_000)
