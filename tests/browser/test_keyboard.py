"""Everything a mouse can do, keys can: the whole way from sign-in to the cursor in the curves."""

from __future__ import annotations

import re

from playwright.sync_api import Page, expect

from tests.browser.conftest import NAME, PASSWORD, Filled, Opener


def test_sign_in_and_open_a_patient_with_keys_only(opened: Opener, filled: Filled) -> None:
    page = opened("/sign-in?next=/patients", signed_in=False)
    keys = page.keyboard
    keys.type(NAME)  # the first field has the focus
    keys.press("Tab")
    keys.type(PASSWORD)
    keys.press("Enter")
    page.wait_for_url(re.compile(r":\d+/patients$"))
    expect(page.locator("job-progress")).to_have_count(0)  # the list loads itself anew when an analysis ends
    _tab_to(page, "P-0042")
    keys.press("Enter")
    page.wait_for_url(re.compile(r"/patients/[0-9a-f]{32}$"))
    assert filled.patient in page.url


def test_the_first_tab_stop_skips_to_the_content(opened: Opener) -> None:
    page = opened("/patients", stays=True)
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to content"
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    assert page.evaluate("Boolean(document.activeElement.closest('main'))")


def test_every_focus_is_seen(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.unmapped}/upload", stays=True)
    page.emulate_media(reduced_motion="reduce")
    unseen = []
    for _ in range(40):
        page.keyboard.press("Tab")
        evaluation = page.evaluate(
            """() => { const e = document.activeElement; if (e === document.body) return null;
            const s = getComputedStyle(e), hit = e.querySelector('.hit');
            const mark = s.outlineStyle !== 'none' && parseFloat(s.outlineWidth) >= 2;
            const ring = hit && parseFloat(getComputedStyle(hit).strokeWidth) >= 2;
            return mark || ring ? '' : e.outerHTML.slice(0, 120); }"""
        )
        unseen += [evaluation] if evaluation else []
    assert not unseen, unseen


def test_a_dialog_closes_with_escape_and_gives_the_focus_back(opened: Opener, filled: Filled) -> None:
    page = opened(f"/patients/{filled.patient}", stays=True)
    _tab_to(page, "Edit")
    page.keyboard.press("Enter")
    dialog = page.locator("dialog[open]")
    expect(dialog).to_be_visible()
    assert page.evaluate("Boolean(document.activeElement.closest('dialog'))")
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    assert page.evaluate("document.activeElement.textContent.trim()") == "Edit"


def test_a_sensor_is_placed_with_keys(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.unmapped}/upload", stays=True)
    row = page.locator("tr[data-device]").first
    select = row.locator("select")
    select.select_option("")
    select.focus()
    place = page.locator("[data-segment=chest]")
    place.focus()
    page.keyboard.press("Enter")
    expect(select).to_have_value("chest")
    expect(place).to_have_attribute("aria-label", re.compile("Chest: sensor 1"))


def test_swapping_left_and_right_swaps_every_leg_sensor(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.unmapped}/upload", stays=True)
    initial = _segments(page)
    page.locator("[data-swap]").focus()
    page.keyboard.press("Enter")
    turn = {"l": "r", "r": "l"}
    expected = [s[:-1] + turn[s[-1]] if s[-2:] in {"_l", "_r"} else s for s in initial]
    assert _segments(page) == expected
    assert expected != initial


def test_two_sensors_on_one_segment_cannot_be_analysed(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.unmapped}/upload", stays=True)
    rows = page.locator("tr[data-device] select")
    rows.nth(0).select_option("foot_l")
    rows.nth(1).select_option("foot_l")
    expect(page.locator("[data-clash]")).to_contain_text("Left foot")
    expect(page.locator("[data-analyse]")).to_be_disabled()


def test_keys_move_the_cursor_of_all_charts_and_the_time_bar(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}/kinematics", stays=True)
    time = page.locator("time-bar input")
    start = float(time.input_value())
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert _cursors(page) == {20.0}
    assert 0.005 < float(time.input_value()) - start < 0.1
    page.keyboard.press("j")
    assert _cursors(page) == {0.0}
    assert float(time.input_value()) > start + 0.2
    value = page.locator("[data-chart]:has([data-variable=knee_flexion]) [data-left]").inner_text()
    assert re.fullmatch(r"−?\d+°", value), value


def test_play_moves_the_time_and_pauses(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}", stays=True)
    time = page.locator("time-bar input")
    start = float(time.input_value())
    page.get_by_role("button", name="Play").focus()
    page.keyboard.press("Enter")
    page.wait_for_function("t => Number(document.querySelector('time-bar input').value) > t + 0.3", arg=start)
    expect(page.locator("[data-play]")).to_have_attribute("aria-label", "Pause")
    page.keyboard.press("Enter")
    stopped = float(time.input_value())
    page.wait_for_timeout(200)
    assert float(time.input_value()) == stopped


def test_pointing_at_a_curve_moves_the_cursor_of_all_charts(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}/kinematics", stays=True)
    plot = page.locator("[data-variable=hip_flexion] > svg")
    box = plot.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 20)
    (position,) = _cursors(page)
    assert abs(position - 600) < 10


def _segments(page: Page) -> list[str]:
    return [s.input_value() for s in page.locator("tr[data-device] select").all()]


def _cursors(page: Page) -> set[float]:
    """Positions of all visible cursors, 0 to 1000 over the cycle."""
    values: list[float] = page.evaluate(
        "[...document.querySelectorAll('[data-chart] .cursor:not([hidden])')]"
        ".map((e) => Math.round(10 * Number(e.getAttribute('x1'))) / 10)"
    )
    assert len(values) >= 8
    return set(values)


def _tab_to(page: Page, text: str) -> None:
    for _ in range(40):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.textContent.trim()") == text:
            return
    raise AssertionError(f"no way to '{text}' with the tab key")
