"""Every page obeys the design system: light and dark, desk, laptop, tablet and phone."""

from __future__ import annotations

import os
import re
from collections.abc import Callable

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import Filled, Opener, RunningServer
from tests.browser.design import AXE, all_faults, axe_faults, layout_faults, text_faults
from tests.browser.picture import wait_for_picture, wait_until_still
from tests.browser.streaming import until_strides, walking
from tests.data import ROOT

DESK, TABLET, PHONE = (1280, 800), (810, 1080), (360, 740)

Address = Callable[[Filled], str]
PAGES: dict[str, Address] = {
    "sign-in": lambda f: "/sign-in",
    "set-up": lambda f: "/set-up/no-such-token",
    "capture": lambda f: "/capture",
    "patients": lambda f: "/patients",
    "patient": lambda f: f"/patients/{f.patient}",
    "identity": lambda f: f"/patients/{f.patient}/identity",
    "trends": lambda f: f"/patients/{f.patient}/trends",
    "compare": lambda f: f"/sessions/{f.done}/compare/{f.earlier}",
    "prescription": lambda f: f"/patients/{f.patient}/prescription",
    "programme": lambda f: f"/patients/{f.patient}/programme",
    "new-session": lambda f: f"/patients/{f.patient}/sessions/new",
    "upload": lambda f: f"/sessions/{f.empty}/upload",
    "found": lambda f: f"/sessions/{f.unmapped}/upload",
    "unread": lambda f: f"/sessions/{f.unread}/upload",
    "session": lambda f: f"/sessions/{f.done}",
    "session-empty": lambda f: f"/sessions/{f.empty}",
    "record-live": lambda f: f"/sessions/{f.empty}/live",
    "session-failed": lambda f: f"/sessions/{f.unusable}",
    "timeline": lambda f: f"/sessions/{f.done}/timeline",
    "parameter": lambda f: f"/sessions/{f.done}/parameters/step_length_m",
    "kinematics": lambda f: f"/sessions/{f.done}/kinematics",
    "calibration": lambda f: f"/sessions/{f.done}/calibration",
    "algorithms": lambda f: f"/sessions/{f.done}/algorithms",
    "data": lambda f: f"/sessions/{f.done}/data",
    "print": lambda f: f"/sessions/{f.done}/print",
    "report": lambda f: f"/sessions/{f.done}/report",
    "leaflet": lambda f: f"/sessions/{f.done}/leaflet",
    "course": lambda f: f"/patients/{f.patient}/course",
    "study": lambda f: "/study",
    "jobs": lambda f: "/jobs",
    "sensors": lambda f: "/sensors",
    "users": lambda f: "/users",
    "audit": lambda f: "/audit",
    "system": lambda f: "/system",
    "account": lambda f: "/account",
    "error": lambda f: "/patients/00000000000000000000000000000000",
}
"""Name of a screenshot → address."""

PAPER = {"print", "leaflet", "course"}
"""A sheet of A4 has its own width; it scrolls inside the page on small screens."""

OUT = {"sign-in", "set-up", "capture"}
FIGURE = {"session", "kinematics"}
TABLETS = {"session", "found", "timeline", "kinematics"}
DARK = {"session", "timeline", "kinematics", "patients"}
"""Which pictures are also taken of a tablet and in the dark."""
LIVE = "live"
"""How the pictures of live pages begin."""
SCREENS = ROOT / "docs" / "screens"
pictures = pytest.mark.skipif(
    os.environ.get("SAGITTAL_SCREENS") != "1",
    reason="takes the pictures of docs/screens, which software draws for minutes: set SAGITTAL_SCREENS=1",
)


@pytest.mark.parametrize("name", PAGES)
def test_page_obeys_the_design_system(name: str, opened: Opener, filled: Filled) -> None:
    page = opened(PAGES[name](filled), signed_in=name not in OUT, stays=True)
    page.wait_for_load_state()
    faults = all_faults(page)
    assert not faults, "\n".join(faults)


def test_the_checks_can_fail(opened: Opener) -> None:
    page = opened("/patients")
    page.evaluate(
        "() => { document.querySelector('main').insertAdjacentHTML('beforeend', "
        "`<button id='tiny'>x</button><p id='faint'>faint</p><div id='wide'>wide</div>`);"
        "const s = (id, css) => Object.assign(document.getElementById(id).style, css);"
        "s('tiny', {width: '20px', height: '20px'}); s('faint', {color: '#bbb', fontSize: '9px'});"
        "s('wide', {width: '3000px'}); }"
    )
    assert set(layout_faults(page)) == {"sideways", "small", "over"}
    assert any("contrast" in k for k in text_faults(page))
    assert any("size 9" in k for k in text_faults(page))


@pytest.mark.skipif(not AXE.exists(), reason=f"no axe at {AXE}: npm install axe-core, or set SAGITTAL_AXE")
def test_axe_can_fail(opened: Opener) -> None:
    page = opened("/patients")
    page.evaluate("() => document.querySelector('main').insertAdjacentHTML('beforeend', `<input><img src=>`)")
    assert {fault.split()[0] for fault in axe_faults(page)} >= {"label", "image-alt"}


def test_dialogs_obey_the_design_system(opened: Opener, filled: Filled) -> None:
    for path, button in (
        ("/patients", "new-patient"),
        (f"/patients/{filled.patient}", "edit-patient"),
        (f"/patients/{filled.patient}", "delete-patient"),
        ("/users", "new-user"),
    ):
        page = opened(path, stays=True)
        for width, height in (DESK, PHONE):
            page.set_viewport_size({"width": width, "height": height})
            page.locator(f"[commandfor={button}]").click()
            result = layout_faults(page) | text_faults(page)
            assert not result, f"{button} {width}: {result}"
            box = page.locator("dialog[open]").bounding_box()
            assert box is not None
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
            page.keyboard.press("Escape")


def sheets(page: Page) -> int:
    """Sheets of paper that a page takes when it is printed."""
    pdf = page.pdf(prefer_css_page_size=True)
    return pdf.count(b"/Type /Page\n") + pdf.count(b"/Type /Page ")


def test_ctrl_p_prints_the_report_of_four_sheets_and_elsewhere_a_clean_page(
    opened: Opener, filled: Filled
) -> None:
    page = opened("/patients")
    assert sheets(page) <= 2
    page.emulate_media(media="print")
    expect(page.locator(".rail")).to_be_hidden()
    expect(page.get_by_role("button", name="New patient")).to_be_hidden()
    page.emulate_media(media="null")  # as it is: a sheet is printed as print
    page.add_init_script("window.print = () => { window.printed = true; }")
    page.goto(PAGES["session"](filled))
    page.wait_for_load_state()  # the script that listens is there
    page.keyboard.press("Control+p")
    page.wait_for_url(re.compile(r"/print$"))
    page.wait_for_function("() => window.printed")
    assert sheets(page) == 4


@pictures
def test_screenshots_of_every_page(opened: Opener, solid: Browser, filled: Filled) -> None:
    """Figures must be on them."""
    for name, address in PAGES.items():
        browser = {"browser": solid} if name in FIGURE else {}
        page = opened(address(filled), signed_in=name not in OUT, **browser)
        if name in FIGURE:
            _wait_for_figure(page)
        page.screenshot(path=SCREENS / f"{name}.png")
        if name in TABLETS:
            page.set_viewport_size({"width": TABLET[0], "height": TABLET[1]})
            page.wait_for_timeout(300)
            page.screenshot(path=SCREENS / f"{name}-tablet.png")
        page.close()
        if name in DARK:
            page = opened(address(filled), scheme="dark", **browser)
            if name in FIGURE:
                _wait_for_figure(page)
            page.screenshot(path=SCREENS / f"{name}-dark.png")
            page.close()
    sizes = [p.stat().st_size for p in SCREENS.glob("*.png") if not p.name.startswith(LIVE)]
    assert len(sizes) == sum(1 + (name in TABLETS) + (name in DARK) for name in PAGES)
    assert sum(sizes) < 6_000_000


@pictures
def test_screenshots_of_a_live_take(opened: Opener, solid: Browser, running: RunningServer) -> None:
    """The therapist's page from calibration on, with the figure, and the patient's; both also dark."""
    with walking(running) as session:
        page = opened(f"/sessions/{session}/live", browser=solid)
        page.locator("live-page[data-view=calibrate] .checks tbody tr").first.wait_for(timeout=60_000)
        page.wait_for_timeout(1000)
        page.screenshot(path=SCREENS / "live-calibration.png")
        until_strides(page, 4)
        page.get_by_role("button", name="Norm").dispatch_event("click")
        _wait_for_live_figure(page)
        page.screenshot(path=SCREENS / "live.png")
        page.set_viewport_size({"width": TABLET[0], "height": TABLET[1]})
        page.wait_for_timeout(1500)
        page.screenshot(path=SCREENS / "live-tablet.png")
        page.close()
        for scheme, name in (("light", "live-patient"), ("dark", "live-patient-dark")):
            page = opened(f"/sessions/{session}/live/patient", scheme=scheme)
            page.get_by_role("button", name="Without sound").click()
            page.locator("[data-last] svg").first.wait_for(timeout=60_000)
            page.screenshot(path=SCREENS / f"{name}.png")
            page.close()
        page = opened(f"/sessions/{session}/live", browser=solid, scheme="dark")
        page.frame_locator("live-view iframe").locator("canvas[data-engine]").wait_for(timeout=30_000)
        until_strides(page, 4)
        _wait_for_live_figure(page)
        page.screenshot(path=SCREENS / "live-dark.png")
        page.close()
    sizes = [p.stat().st_size for p in SCREENS.glob(f"{LIVE}*.png")]
    assert len(sizes) >= 6
    assert sum(sizes) < 1_500_000


def _wait_for_live_figure(page: Page) -> None:
    wait_for_picture(page, lambda now: now["orange"] > 150)


def _wait_for_figure(page: Page) -> None:
    page.locator("gait-view[data-state=open]").wait_for(timeout=30_000)
    wait_until_still(page)
