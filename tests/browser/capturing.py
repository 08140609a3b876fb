"""Session with an open live trial and a paired tablet for the tests of the capture page."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, FilePayload, Page, expect

from tests.browser import filling
from tests.browser.conftest import KeptContexts, RunningServer
from tests.browser.network import Network
from tests.data import data_folder


class Clinic:
    """A session with a live take, by the interface the therapist's page uses."""

    def __init__(self, client: httpx.Client, session: str) -> None:
        self.client = client
        self.session = session
        self.code: str = self.post("/live")["code"]

    def post(self, path: str, **body: Any) -> Any:
        return filling.add(self.client, f"/sessions/{self.session}{path}", **body)

    def take(self) -> Any:
        answer = self.client.get(f"/api/v1/sessions/{self.session}/live")
        return answer.raise_for_status().json()

    def log(self, server: RunningServer) -> bytes:
        return stored_log(self.client, server, self.session)


def stored_log(client: httpx.Client, server: RunningServer, session: str) -> bytes:
    """The recording's only file, as the server keeps it."""
    body = client.get(f"/api/v1/sessions/{session}/recording").raise_for_status().json()
    (file,) = body["files"]
    (path,) = (p for p in (server.folder / "blobs").rglob(f"*{file['sha256']}") if p.is_file())
    return path.read_bytes()


@pytest.fixture
def clinic(running: RunningServer, request: pytest.FixtureRequest) -> Iterator[Clinic]:
    with running.client() as client:
        code = f"CAP-{hashlib.sha256(request.node.name.encode()).hexdigest()[:8]}"
        patient = filling.add(client, "/patients", code=code, height_m=1.75)["id"]
        new_clinic = Clinic(client, filling.add_session(client, patient, "Walk, 10 m overground"))
        yield new_clinic
        if new_clinic.take()["state"] in {"pairing", "open", "streaming"}:
            new_clinic.post("/live/close")


@pytest.fixture
def network(running: RunningServer) -> Iterator[Network]:
    network = Network(running.url)
    yield network
    network.close()


@functools.cache
def _kept_tablets(server: RunningServer) -> KeptContexts:
    return KeptContexts(server.url, [])


@contextmanager
def tablet(browser: Browser, position: RunningServer | Network) -> Iterator[Page]:
    """Capture page on a tablet with empty storage.

    Tablets of a server share one browser context in turn; with a simulated network each has its own.
    """
    retained = _kept_tablets(position) if isinstance(position, RunningServer) else None
    context = retained.take(browser) if retained else browser.new_context(base_url=position.url)
    page = context.new_page()
    page.set_viewport_size({"width": 810, "height": 1080})
    page.goto("/capture")
    try:
        yield page
    finally:
        if retained:
            retained.clean()
        else:
            context.close()


def pair(page: Page, code: str) -> None:
    page.get_by_label("Pairing code").press_sequentially(code.lower())
    expect(page.locator("[data-paired]")).to_be_visible()
    expect(page.locator("[data-paired]")).to_contain_text("Paired with CAP-")


def walk_files() -> list[tuple[str, bytes]]:
    folder = data_folder("neura_walk", "rawimu")
    return [(p.name, p.read_bytes()) for p in sorted(folder.glob("*.txt"))]


def choose(page: Page, files: list[tuple[str, bytes]]) -> None:
    payloads: list[FilePayload] = [{"name": n, "mimeType": "text/plain", "buffer": c} for n, c in files]
    page.locator("[data-files]").set_input_files(payloads)


def place(page: Page, segments: dict[str, str]) -> None:
    """Put these sensors on and no others: the clinic may remember all of them from another test."""
    page.evaluate(
        "(worn) => { const page = document.querySelector('capture-page');"
        "for (const s of page.worn.sensors) if (!worn.includes(s.id)) page.worn.place(s, null); }",
        list(segments),
    )
    for device, segment in segments.items():
        page.locator(f"li[data-sensor='{device}'] [data-place]").click()
        page.locator(f"dialog[open] button[value={segment}]").click()


def start(page: Page) -> None:
    page.locator("[data-go]").click()
    expect(page.locator("[data-link]")).to_have_text("Connected", timeout=10_000)
    page.wait_for_timeout(800)  # until the page takes another tap on the same button for a Stop


def until(page: Page, condition: str, timeout_s: float = 20) -> None:
    page.wait_for_function(
        f"() => {{ const page = document.querySelector('capture-page'); return {condition}; }}",
        timeout=timeout_s * 1000,
    )
