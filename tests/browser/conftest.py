"""A real server with its worker, real Chromium, and a clinic filled through the API."""

from __future__ import annotations

import contextlib
import datetime as dt
import functools
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import (
    Browser,
    BrowserContext,
    Dialog,
    Page,
    Playwright,
    ViewportSize,
    expect,
    sync_playwright,
)
from sqlalchemy import delete, select

from sagittal.server.auth import accounts
from sagittal.server.auth.passwords import hash_password
from sagittal.server.auth.roles import Role
from sagittal.server.storage.db import Database
from sagittal.server.storage.field_cipher import make_keys
from sagittal.server.storage.migrate import upgrade
from sagittal.server.storage.schema.tables import device_check, job
from tests.browser import filling
from tests.browser.console import Console
from tests.data import ROOT
from tests.helpers.kept import keep_served

expect.set_options(timeout=30_000)  # beside other tests a page may take long; nobody waits unless it does

NAME, PASSWORD = "anna", "correct horse battery"
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or "/usr/bin/chromium"
FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--process-per-site"]  # fmt: skip
FLAT = [*FLAGS, "--disable-gpu"]
SOLID = [*FLAGS, "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--disable-gpu-rasterization"]  # fmt: skip
"""Without 3D (fast 2D) and with software WebGL, which slows pages down to a few frames a second; all of a
page but the figure is then drawn as without 3D."""
PACED = """
if (window !== window.top) {
  const draw = window.requestAnimationFrame.bind(window), waiting = new Map();
  let last = 0, frames = 0;
  window.requestAnimationFrame = (then) => { waiting.set(++last, then); return last; };
  window.cancelAnimationFrame = (number) => waiting.delete(number);
  window.drawNow = () => draw((now) => {
    const all = [...waiting.values()];
    waiting.clear();
    for (const then of all) then(now);
  });
  const beat = () => { drawNow(); setTimeout(beat, frames++ < 10 ? 100 : 500); };
  beat();
}
"""
"""A figure drawn by software as often as it can takes all processors from the server that is to be tested. So
it is drawn twice a second once it stands, and when a picture of it is taken (picture.py)."""
WITHOUT_FIGURE = "if (location.pathname.startsWith('/views/')) location.replace('about:blank');"
"""Without 3D nobody sees the figure; its megabytes of script would draw it all the same."""
FORGET = """async () => {
  localStorage.clear();
  sessionStorage.clear();
  await Promise.all((await indexedDB.databases()).map(({ name }) => new Promise((done) => {
    const asked = indexedDB.deleteDatabase(name);
    asked.onsuccess = asked.onerror = done;
  })));
}"""

REST = "/health/live"
"""Where the page of a context is that stays in it."""
DESK = ViewportSize(width=1280, height=800)
RECORDS_ONLY = {"SAGITTAL_WORKERS": "0", "SAGITTAL_LIVE_WORKERS": "0"}


@dataclass(frozen=True)
class RunningServer:
    """A server process on an empty data folder with one administrator."""

    url: str
    folder: Path
    pid: int

    @contextlib.contextmanager
    def without_workers(self) -> Iterator[None]:
        """Hold the workers still for a moment, so that a job waits as in a busy clinic."""
        workers = [pid for pid, parent in _parents().items() if parent == self.pid]
        for pid in workers:
            os.kill(pid, signal.SIGSTOP)
        try:
            yield
        finally:
            for pid in workers:
                os.kill(pid, signal.SIGCONT)

    @functools.cached_property
    def cookies(self) -> httpx.Cookies:
        """Of one sign-in that clients and pages share: checking a password takes tenths of a second."""
        with httpx.Client(base_url=self.url, timeout=60) as client:
            client.post("/api/v1/sign-in", json={"name": NAME, "password": PASSWORD}).raise_for_status()
            return client.cookies

    @contextlib.contextmanager
    def client(self) -> Iterator[httpx.Client]:
        """A signed-in API client."""
        with httpx.Client(base_url=self.url, timeout=60, cookies=self.cookies) as client:
            yield client


@contextlib.contextmanager
def serve(folder: Path, *, records_only: bool = False) -> Iterator[RunningServer]:
    """Run `sagittal serve` on a data folder; its output goes to server.log there.

    Parameters
    ----------
    records_only : accept files and live trials without starting workers and estimators.
    """
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    log = (folder / "server.log").open("wb")
    # an own process group, so that a Ctrl-C in the terminal does not reach it twice
    process = subprocess.Popen(
        [sys.executable, "-m", "sagittal.server.main", "serve", "--data", str(folder), "--port", str(port)],
        cwd=ROOT, stdout=log, stderr=subprocess.STDOUT, start_new_session=True,
        env={**os.environ, **(RECORDS_ONLY if records_only else {})},
    )  # fmt: skip
    url = f"http://127.0.0.1:{port}"
    try:
        _wait_until_ready(url, process, folder / "server.log")
        yield RunningServer(url, folder, process.pid)
    finally:
        process.terminate()
        try:
            process.wait(15)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        log.close()


@pytest.fixture(scope="session")
def running(tmp_path_factory: pytest.TempPathFactory, clinic_files: ClinicFiles) -> Iterator[RunningServer]:
    """One server for all tests, with one administrator, on a clinic that has something on every page."""
    folder = tmp_path_factory.mktemp("clinic")
    for name, content in clinic_files[1].items():
        path = folder / name
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        path.write_bytes(content)
        path.chmod(0o600)
    with serve(folder) as server:
        yield server


def _wait_until_ready(url: str, process: subprocess.Popen[bytes], log: Path) -> None:
    end = time.monotonic() + 60
    while time.monotonic() < end:
        try:
            if httpx.get(f"{url}/health/live", timeout=2).is_success:
                return
        except httpx.TransportError:
            pass
        if process.poll() is not None:
            break
        time.sleep(0.1)
    pytest.fail(f"the server did not start:\n{log.read_text(errors='replace')[-3000:]}")


def _parents() -> dict[int, int]:
    """Process id → its parent's, from /proc."""
    result = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            result[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
    return result


@pytest.fixture(scope="session")
def playwright_() -> Iterator[Playwright]:
    # while it lives it keeps an event loop running in this thread: pages come last (tests/conftest.py, ORDER)
    if not Path(CHROMIUM).exists():
        pytest.skip(f"no Chromium at {CHROMIUM}; set CHROMIUM to one")
    with sync_playwright() as p:
        yield p


@pytest.fixture(scope="session")
def console() -> Console:
    """Console messages of all pages of all tests."""
    return Console()


@pytest.fixture(autouse=True)
def quiet_console(console: Console) -> Iterator[None]:
    """Fail the test if a page logs an unexpected error or warning, or throws an uncaught exception."""
    yield
    messages = console.take()
    assert not messages, messages


Launcher = Callable[[Sequence[str]], Browser]


@pytest.fixture(scope="session")
def launch(playwright_: Playwright, console: Console) -> Launcher:
    """Starts Chromium with these flags, its consoles watched."""
    return lambda flags: console.watch(
        playwright_.chromium.launch(executable_path=CHROMIUM, args=list(flags))
    )


@pytest.fixture(scope="session")
def flat(launch: Launcher) -> Iterator[Browser]:
    """Chromium without 3D."""
    with launch(FLAT) as browser:
        yield browser


@pytest.fixture(scope="session")
def solid(launch: Launcher) -> Iterator[Browser]:
    """Chromium with software WebGL."""
    with launch(SOLID) as browser:
        yield browser


@pytest.fixture
def unknown_sensors(running: RunningServer) -> None:
    """The clinic remembers no sensor of another test's take."""
    with contextlib.closing(Database(running.folder / "sagittal.db")) as db, db.write() as c:
        c.execute(delete(device_check))


@pytest.fixture(scope="session")
def cookies(running: RunningServer) -> list[dict[str, str]]:
    """The cookie of one sign-in, so that a page need not sign in each time."""
    return [{"name": k, "value": v, "url": running.url} for k, v in running.cookies.items()]


class KeptContexts:
    """Browser contexts shared by all tests: one per browser and language, signed in or not.

    A new context costs a second of CPU time for its process and for compiling all scripts and styles. State
    left by a test is removed after it.
    """

    def __init__(self, url: str, cookies: list[dict[str, str]]) -> None:
        self._url, self._cookies = url, cookies
        self._all: dict[tuple[Browser, str, bool], BrowserContext] = {}
        self._used: dict[BrowserContext, bool] = {}

    def take(
        self, browser: Browser, script: str = "", locale: str = "en-US", *, signed_in: bool = True
    ) -> BrowserContext:
        """The one of this browser and language, made at its first use; `script` runs in every document."""
        if (browser, locale, signed_in) not in self._all:
            output = browser.new_context(locale=locale, base_url=self._url, viewport=DESK)
            output.set_default_timeout(60_000)
            if script:
                output.add_init_script(script)
            if signed_in:
                output.add_cookies(self._cookies)  # type: ignore[arg-type]
            output.new_page().goto(REST)  # stays, and with it the process of its pages
            self._all[browser, locale, signed_in] = output
        result = self._all[browser, locale, signed_in]
        self._used[result] = signed_in
        return result

    def clean(self) -> None:
        """Close the pages of a test and clear their storage."""
        for context, signed_in in self._used.items():
            first, *remaining = context.pages
            for page in remaining:
                page.close()
            if not first.url.endswith(REST):
                first.on("dialog", _accept)  # what a test typed and did not send may go
                first.goto(REST)
                first.remove_listener("dialog", _accept)
            first.evaluate(FORGET)
            context.clear_cookies()
            if signed_in:
                context.add_cookies(self._cookies)  # type: ignore[arg-type]
        self._used.clear()


def _accept(dialog: Dialog) -> None:
    dialog.accept()


@pytest.fixture(scope="session")
def all_kept(running: RunningServer, cookies: list[dict[str, str]]) -> KeptContexts:
    return KeptContexts(running.url, cookies)


@pytest.fixture
def kept(all_kept: KeptContexts) -> Iterator[KeptContexts]:
    """The shared contexts, clean for the next test."""
    yield all_kept
    all_kept.clean()


Opener = Callable[..., Page]


@pytest.fixture
def at_rest(running: RunningServer) -> None:
    """No job of an earlier test is at work: a page that shows one loads itself again when it ends."""
    at_work = select(job.c.id).where(job.c.state.in_(("queued", "running"))).limit(1)
    end = time.monotonic() + 60
    with contextlib.closing(Database(running.folder / "sagittal.db")) as db:
        while time.monotonic() < end:
            with db.read() as c:
                if c.execute(at_work).first() is None:
                    return
            time.sleep(0.05)
    pytest.fail("a job of an earlier test does not end")


@pytest.fixture
def opened(flat: Browser, kept: KeptContexts, at_rest: None) -> Opener:
    """Opens pages.

    A page that `stays` is the one that is always in the context: a new one costs a quarter of a second of
    processor time. It is for tests that leave no listener, route or script on it, and do not close it.
    """

    def open_(
        path: str,
        *,
        width: int = 1280,
        height: int = 800,
        scheme: str = "light",
        browser: Browser = flat,
        signed_in: bool = True,
        locale: str = "en-US",
        stays: bool = False,
    ) -> Page:
        script = WITHOUT_FIGURE if browser is flat else PACED
        context = kept.take(browser, script, locale, signed_in=signed_in)
        page = context.pages[0] if stays else context.new_page()
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(color_scheme=scheme, reduced_motion="null", media="null")  # type: ignore[arg-type]
        page.mouse.move(0, 0)
        page.goto(path)
        # what plays the figure begins once the page has been seen, which may be after it is loaded
        page.wait_for_function("() => !document.querySelector('time-bar:not(:defined)')")
        return page

    return open_


@dataclass(frozen=True)
class Filled:
    """A clinic with something on every page.

    Parameters
    ----------
    patient : with three visits and a programme. done, earlier : analysed, twice the same walk. unread : the
        files are no recording. unmapped : uploaded, not analysed. unusable : analysed with one sensor, so
        without strides. empty : nothing uploaded.
    """

    patient: str
    done: str
    earlier: str
    unread: str
    unmapped: str
    unusable: str
    empty: str


ClinicFiles = tuple[Filled, Mapping[str, bytes]]
"""What is where in a clinic, and the files of its data folder by their paths in it."""


@pytest.fixture(scope="session")
def clinic_files() -> ClinicFiles:
    return _make_clinic(dt.datetime.now(dt.UTC).date())


@pytest.fixture(scope="session")
def filled(clinic_files: ClinicFiles) -> Filled:
    """Initial content of the clinic of `running`."""
    return clinic_files[0]


@keep_served
def _make_clinic(day: dt.date) -> ClinicFiles:
    """Fill a clinic through the API, once per `day` for all processes, so that dates on pages are current."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("PYTEST_DEBUG_TEMPROOT")) as temporary_directory:
        folder = Path(temporary_directory)
        make_keys(folder / "identity.key")  # this clinic keeps names
        upgrade(folder / "sagittal.db")
        with contextlib.closing(Database(folder / "sagittal.db")) as db, db.write() as c:
            accounts.create(c, NAME, "Anna", Role.ADMIN, hash_password(PASSWORD))
        with serve(folder) as server, server.client() as client:
            filled = _fill(client)
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        return filled, {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _fill(client: httpx.Client) -> Filled:
    files, sensors = filling.simulated_files()
    patient = filling.add(
        client,
        "/patients",
        code="P-0042",
        sex="male",
        birth_year=1968,
        height_m=1.76,
        note="Stroke, left side affected",
    )["id"]
    filling.add(client, "/patients", code="P-0043", sex="female", birth_year=1951)
    second = filling.add(client, "/patients", code="P-0047", note="Knee, after ligament repair")["id"]
    done = filling.add_session(client, patient, "Walk, own pace", note="Barefoot, no aid")
    earlier = filling.add_session(client, patient, "Walk, first visit", performed_on="2026-10-21")
    for session in (done, earlier):
        filling.upload(client, session, files)
        assert filling.analyse(client, session, sensors)["state"] == "done"
    filling.add(client, f"/patients/{patient}/programmes", starts_on="2026-10-26")
    unmapped = filling.add_session(client, patient, "Walk, with stick", performed_on="2026-11-20")
    filling.upload(client, unmapped, files)
    unread = filling.add_session(client, second, "Walk")
    filling.upload(client, unread, {"notes.txt": b"no recording at all\n"})
    unusable = filling.add_session(client, second, "Walk, one sensor", performed_on="2026-11-19")
    name, content = next(iter(files.items()))
    filling.upload(client, unusable, {name: content})
    filling.analyse(client, unusable, {next(iter(sensors)): "shank_l"})
    empty = filling.add_session(client, second, "Walk, later", performed_on="2026-11-21")
    return Filled(patient, done, earlier, unread, unmapped, unusable, empty)
