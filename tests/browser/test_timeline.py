"""The timeline: events are dragged, nudged, added and deleted, strides left out; every number follows."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any
from uuid import uuid4

import pytest
from playwright.sync_api import APIResponse, Browser, Locator, Page, Route, expect

from sagittal.server.report.charts.svg import find_round_ticks
from tests.browser import filling
from tests.browser.conftest import Opener, RunningServer
from tests.browser.design import layout_faults, text_faults


@pytest.fixture(scope="module")
def walked(running: RunningServer) -> str:
    """A session of these tests alone, analysed."""
    files, sensors = filling.simulated_files()
    with running.client() as client:
        patient = filling.add(client, "/patients", code=f"P-{uuid4().hex[:6]}", height_m=1.76)["id"]
        session = filling.add_session(client, patient, "Walk")
        filling.upload(client, session, files)
        assert filling.analyse(client, session, sensors)["state"] == "done"
    return session


@pytest.fixture
def timeline(opened: Opener, running: RunningServer, walked: str) -> Iterator[Page]:
    """The page; what a test changed is undone after it."""
    page = opened(f"/sessions/{walked}/timeline", stays=True)
    expect(page.locator("[data-counts=left]")).to_have_text(re.compile(r"\d+ of \d+"))
    page.locator(".ev").first.wait_for()
    yield page
    with running.client() as client:
        while client.delete(f"/api/v1/sessions/{walked}/edits").is_success:
            pass


def review(running: RunningServer, session: str) -> dict[str, Any]:
    with running.client() as client:
        fields: dict[str, Any] = client.get(f"/api/v1/sessions/{session}/edits").json()
    return fields


def handle(page: Page, kind: str, n: int = 2, side: str = "left") -> Locator:
    return page.locator(f"[data-side={side}] .ev.{kind}").nth(n)


def drag(page: Page, label: Locator, by_px: float) -> None:
    box = label.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by_px, y, steps=5)
    page.mouse.up()


def done(page: Page, words: str) -> None:
    """The change has been answered and what depends on it drawn again."""
    expect(page.locator("[data-said]")).to_contain_text(words)


def numbers(page: Page) -> str:
    return page.locator("#numbers").inner_text()


def click_stride(mark: Locator) -> None:
    """Click a stride between the handles of its contact and its foot-off."""
    box = mark.bounding_box()
    assert box is not None
    mark.click(position={"x": 0.35 * box["width"], "y": box["height"] / 2})


def pick_counted(page: Page) -> Locator:
    """A counted left stride in view, picked by a click."""
    mark = page.locator("[data-side=left] g[data-stride]:not(:has(.x))").nth(1)
    click_stride(mark)
    expect(page.locator("[data-verdict]")).to_have_text("included")
    return mark


@pytest.mark.journey
def test_a_dragged_foot_off_changes_the_numbers_within_a_second_and_undo_brings_them_back(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    initial_numbers = numbers(timeline)
    event = handle(timeline, "tc")
    was = float(event.get_attribute("aria-valuenow") or 0)
    drag(timeline, event, 20)
    done(timeline, "left foot-off moved")
    (edit,) = review(running, walked)["edits"]
    assert (edit["kind"], edit["side"], edit["event"]) == ("move_event", "left", "tc")
    box = event.bounding_box()
    assert box is not None
    assert min(box["width"], box["height"]) >= 44
    assert edit["time_s"] == pytest.approx(was, abs=0.001)
    assert 0.05 < edit["to_s"] - was < 0.4
    final_numbers = numbers(timeline)
    assert final_numbers != initial_numbers
    assert int(timeline.locator("take-timeline").get_attribute("data-took") or 10_000) < 1000
    expect(timeline.locator("[data-edits]")).to_contain_text("foot-off moved from")
    timeline.locator("[data-undo]").click()
    done(timeline, "undone")
    assert numbers(timeline) == initial_numbers
    expect(timeline.locator("[data-undo]")).to_be_disabled()


def test_numbers_that_no_longer_hold_are_pale_until_the_new_ones_are_there(timeline: Page) -> None:
    held: list[Route] = []
    timeline.route("**/timeline/numbers", lambda route: held.append(route))
    try:
        drag(timeline, handle(timeline, "tc"), 20)
        expect(timeline.locator("#numbers")).to_have_css("opacity", "0.4")
    finally:
        for route in held:
            route.continue_()
        timeline.unroute("**/timeline/numbers")
    done(timeline, "left foot-off moved")
    expect(timeline.locator("#numbers")).to_have_css("opacity", "1")


def test_numbers_that_do_not_come_stay_pale_and_it_is_said(timeline: Page) -> None:
    timeline.route("**/timeline/numbers", lambda route: route.abort())
    drag(timeline, handle(timeline, "tc"), 20)
    done(timeline, "left foot-off moved")
    expect(timeline.locator("[data-problem]")).to_contain_text("The values could not be loaded")
    expect(timeline.locator("#numbers")).to_have_css("opacity", "0.4")
    timeline.unroute("**/timeline/numbers")


def test_numbers_of_an_earlier_change_that_come_late_are_not_shown(timeline: Page) -> None:
    late: list[tuple[Route, APIResponse]] = []

    def hold_first(route: Route) -> None:
        answer = route.fetch()
        if late:
            route.fulfill(response=answer)
        else:
            late.append((route, answer))

    timeline.route("**/timeline/numbers", hold_first)
    with timeline.expect_request("**/timeline/numbers"):
        drag(timeline, handle(timeline, "tc"), 25)
    drag(timeline, handle(timeline, "tc", side="right"), 25)
    done(timeline, "right foot-off moved")
    final_numbers = numbers(timeline)
    expect(timeline.locator("#numbers")).to_have_css("opacity", "1")
    ((route, answer),) = late
    route.fulfill(response=answer)
    done(timeline, "left foot-off moved")
    assert numbers(timeline) == final_numbers
    timeline.unroute("**/timeline/numbers")


def test_an_event_stops_at_its_neighbour_of_the_same_foot(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    contact = handle(timeline, "ic")
    drag(timeline, contact, 700)
    done(timeline, "left contact moved")
    result = review(running, walked)
    moved = result["edits"][0]["to_s"]
    following = min(e["time_s"] for e in result["events"] if e["side"] == "left" and e["time_s"] > moved)
    assert following - moved == pytest.approx(0.051, abs=0.002)


def test_arrow_keys_nudge_by_a_sample_and_several_presses_are_one_change(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    event = handle(timeline, "ic")
    event.focus()
    was = float(event.get_attribute("aria-valuenow") or 0)
    for _ in range(3):
        timeline.keyboard.press("ArrowRight")
    assert float(event.get_attribute("aria-valuenow") or 0) == pytest.approx(was + 0.03, abs=1e-6)
    done(timeline, "left contact moved")
    (edit,) = review(running, walked)["edits"]
    assert edit["to_s"] == pytest.approx(was + 0.03, abs=0.002)
    # the focus is still on the event that was moved
    label = timeline.evaluate("document.activeElement.ariaValueText")
    assert label.endswith("placed manually")
    timeline.keyboard.press("ArrowLeft")
    timeline.keyboard.press("Escape")
    timeline.wait_for_timeout(1200)
    assert len(review(running, walked)["edits"]) == 1


def test_keys_alone_delete_an_event_and_bring_it_back(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    count = len(review(running, walked)["events"])
    handle(timeline, "ic").focus()
    timeline.keyboard.press("ArrowDown")
    assert "tc" in timeline.evaluate("document.activeElement.className")
    timeline.keyboard.press("Delete")
    done(timeline, "left foot-off deleted")
    assert len(review(running, walked)["events"]) == count - 1
    # with an event focused, and while one is held: what is held goes back first, and nothing else is undone
    timeline.keyboard.press("ArrowRight")
    timeline.keyboard.press("Control+z")
    expect(timeline.locator(".ev.held")).to_have_count(0)
    assert len(review(running, walked)["edits"]) == 1
    timeline.keyboard.press("Control+z")
    done(timeline, "undone")
    assert len(review(running, walked)["events"]) == count
    timeline.keyboard.press("x")
    dialog = timeline.locator("dialog[open]")
    expect(dialog).to_contain_text("will be excluded")
    dialog.get_by_role("button", name="Cancel").click()


def test_undone_changes_are_redone_by_keys_and_button_until_there_is_a_new_one(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    def edits() -> list[tuple[str, float]]:
        return [(e["kind"], e["to_s"]) for e in review(running, walked)["edits"]]

    redo = timeline.locator("[data-redo]")
    handle(timeline, "ic").focus()
    for presses in (3, 2):
        for _ in range(presses):
            timeline.keyboard.press("ArrowRight")
        timeline.keyboard.press("Enter")
        expect(timeline.locator("[data-edit-count]")).to_have_text("1" if presses == 3 else "2")
    pair, final_numbers = edits(), numbers(timeline)
    expect(redo).to_be_disabled()
    timeline.keyboard.press("Control+Shift+Z")  # nothing was undone
    expect(timeline.locator("[data-said]")).to_contain_text("left contact moved")
    assert edits() == pair
    for second in ("Control+Shift+Z", "Control+Shift+z", "Control+y", "Meta+Shift+Z", "button"):
        timeline.keyboard.press("Control+z")
        done(timeline, "undone")
        expect(redo).to_be_enabled()
        assert edits() == pair[:1]
        if second == "button":
            redo.click()
        else:
            timeline.keyboard.press(second)
        done(timeline, "redone")
        assert edits() == pair
        assert numbers(timeline) == final_numbers
    for _ in range(2):
        timeline.locator("[data-undo]").click()
        expect(timeline.locator("take-timeline")).to_have_attribute("aria-busy", "false")
    expect(timeline.locator("[data-undo]")).to_be_disabled()
    redo.click()
    done(timeline, "redone")
    drag(timeline, handle(timeline, "tc", side="right"), 12)
    done(timeline, "right foot-off moved")
    expect(redo).to_be_disabled()
    assert [kind for kind, _ in edits()] == ["move_event"] * 2


def test_key_presses_that_were_undone_as_one_are_redone_as_one(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    event = handle(timeline, "ic")
    event.focus()
    was = float(event.get_attribute("aria-valuenow") or 0)
    for _ in range(3):
        timeline.keyboard.press("ArrowRight")
    timeline.keyboard.press("Control+z")
    expect(timeline.locator(".ev.held")).to_have_count(0)
    assert review(running, walked)["edits"] == []
    expect(timeline.locator("[data-redo]")).to_be_enabled()
    timeline.keyboard.press("Control+Shift+Z")
    done(timeline, "left contact moved")
    (edit,) = review(running, walked)["edits"]
    assert edit["to_s"] == pytest.approx(was + 0.03, abs=0.002)


def test_a_redo_is_refused_when_somebody_else_changed_something(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    drag(timeline, handle(timeline, "tc"), 12)
    done(timeline, "left foot-off moved")
    timeline.keyboard.press("Control+z")
    done(timeline, "undone")
    stride = next(s for s in review(running, walked)["strides"] if s["excluded_by"] is None)
    moment = (stride["start_s"] + stride["end_s"]) / 2
    body = {"kind": "exclude_stride", "side": stride["side"], "time_s": moment, "reason": "by a colleague"}
    with running.client() as client:
        client.post(f"/api/v1/sessions/{walked}/edits", json=body).raise_for_status()
    timeline.keyboard.press("Control+Shift+Z")
    expect(timeline.locator("[data-problem]")).to_contain_text("Another user has changed")
    expect(timeline.locator("[data-edits]")).to_contain_text("by a colleague")
    expect(timeline.locator("[data-redo]")).to_be_disabled()
    assert len(review(running, walked)["edits"]) == 1


def test_an_event_is_added_where_the_cursor_is(timeline: Page, running: RunningServer, walked: str) -> None:
    event = handle(timeline, "tc")
    event.focus()
    position = event.get_attribute("aria-valuenow")
    timeline.keyboard.press("Delete")
    done(timeline, "deleted")
    timeline.keyboard.press("a")
    dialog = timeline.locator("dialog[open]")
    expect(dialog.locator("#add-side")).to_have_value("left")
    expect(dialog.locator("#add-kind")).to_have_value("tc")
    expect(dialog.locator("#add-time")).to_have_value(position or "")
    dialog.get_by_role("button", name="Add").click()
    done(timeline, "foot-off added")
    added = [e for e in review(running, walked)["events"] if e["source"] == "manual"]
    assert [(e["side"], e["kind"]) for e in added] == [("left", "tc")]
    expect(timeline.locator("[data-side=left] .ev.manual")).to_have_count(1)


def test_a_second_click_leaves_a_stride_out_with_its_reason_and_the_overview_follows(
    timeline: Page, opened: Opener, running: RunningServer, walked: str
) -> None:
    words = timeline.locator("[data-counts=left]").inner_text()
    click_stride(pick_counted(timeline))
    dialog = timeline.locator("dialog[open]")
    dialog.locator("#words").fill("looked at the dog")
    dialog.get_by_role("button", name="Exclude").click()
    done(timeline, "excluded")
    used = int(words.split()[0])
    expect(timeline.locator("[data-counts=left]")).to_have_text(words.replace(str(used), str(used - 1), 1))
    expect(timeline.locator("[data-verdict]")).to_have_text("excluded")
    row = timeline.locator("[data-list] tr.on")
    expect(row).to_contain_text("no: looked at the dog")
    # kept by its middle, named by its contact as in the list
    contact = row.locator("td.n").first.inner_text()
    expect(timeline.locator("[data-edits] li").first).to_contain_text(f"stride at {contact} s excluded")
    overview = opened(f"/sessions/{walked}")
    expect(overview.locator("#warnings")).to_contain_text("1 stride excluded")
    timeline.locator("[data-count]").click()
    done(timeline, "included")
    # the stride is picked: a second click, on why, leaves it out
    timeline.get_by_role("button", name="Turn or obstacle").click()
    done(timeline, "excluded")
    expect(timeline.locator("[data-list] tr.on")).to_contain_text("no: Turn or obstacle")
    timeline.locator("[data-undo]").click()
    done(timeline, "undone")
    expect(timeline.locator("[data-counts=left]")).to_have_text(words)
    assert [e["kind"] for e in review(running, walked)["edits"]] == ["exclude_stride", "include_stride"]


def test_the_fields_of_a_stride_move_its_events_and_refuse_what_cannot_be(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    pick_counted(timeline)
    field = timeline.get_by_label("Foot-off", exact=True)
    was = field.input_value()
    field.fill("0.5")
    field.press("Enter")
    problem = timeline.locator("[data-problem]")
    expect(problem).to_contain_text("cannot pass another event")
    expect(field).to_have_value(was)
    assert review(running, walked)["version"] >= 0
    field.fill(f"{float(was) + 0.02:.3f}")
    field.press("Enter")
    done(timeline, "left foot-off moved")
    expect(problem).to_be_hidden()


def test_a_stride_whose_contact_was_typed_later_stays_the_one_in_the_fields(timeline: Page) -> None:
    """The cursor stayed where the contact had been, so the fields were those of the stride before."""
    pick_counted(timeline)
    contact = timeline.get_by_label("Contact", exact=True)
    other_input_values = [
        timeline.get_by_label(name, exact=True).input_value() for name in ("Foot-off", "Next contact")
    ]
    later = f"{float(contact.input_value()) + 0.05:.3f}"
    contact.fill(later)
    contact.press("Enter")
    done(timeline, "left contact moved")
    expect(contact).to_have_value(later)
    expect(contact).to_be_focused()
    expect(timeline.get_by_label("Foot-off", exact=True)).to_have_value(other_input_values[0])
    expect(timeline.get_by_label("Next contact", exact=True)).to_have_value(other_input_values[1])
    expect(timeline.locator("#h-stride")).to_have_text(f"Left stride, {float(later):.2f} s")


def test_zooming_and_moving_keep_all_lanes_and_the_table_together(timeline: Page) -> None:
    span = timeline.locator("[data-span]")
    first = span.inner_text()
    timeline.keyboard.press("0")
    expect(span).to_have_text(re.compile(r"^0\.0 to (\d+\.\d) s of \1 s$"))
    expect(timeline.locator(".ev")).to_have_count(0)  # too close together to be told apart
    # a lane is drawn when its piece of the signal has come
    widths = "[...document.querySelectorAll('.tl-lines')].map(e => e.viewBox.baseVal.width)"
    timeline.wait_for_function(f"() => new Set({widths}).size === 1 && {widths}[0] > 0")
    total = timeline.locator("[data-listed]")
    expect(total).to_contain_text("zoom in for the others")
    for _ in range(4):
        timeline.locator("[data-zoom='0.5']").click()
    assert timeline.locator(".ev").count() > 4
    timeline.wait_for_function("() => document.querySelectorAll('[data-list] tr').length < 16")
    timeline.keyboard.press(".")
    assert span.inner_text() != first


def test_the_value_beside_a_lane_is_the_signals_own(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    timeline.locator("#lane-0").select_option("knee_flexion")
    handle(timeline, "ic").focus()
    position = float(timeline.evaluate("document.activeElement.ariaValueNow"))
    with running.client() as client:
        query = {"start_s": max(position - 0.005, 0), "end_s": position + 0.005, "points": 10}
        piece = client.get(f"/api/v1/sessions/{walked}/signals/knee_flexion", params=query).json()
    near = [v for v in piece["low"]["left"] if v is not None]
    timeline.wait_for_timeout(600)
    text = timeline.locator("[data-values]").first.inner_text().replace("−", "-")
    match = re.search(r"L (-?[\d.]+)", text)
    assert match is not None
    assert min(near) - 0.6 <= float(match[1]) <= max(near) + 0.6


def test_signals_have_round_ticks_by_the_rule_of_the_report(timeline: Page) -> None:
    timeline.locator("[data-lane='0'] .tl-ticks span").first.wait_for()
    for n in range(3):
        lane = timeline.locator(f"[data-lane='{n}']")
        expect(lane.locator(".tl-ticks span").nth(1)).to_be_visible()
        texts = [t.replace("−", "-") for t in lane.locator(".tl-ticks span").all_inner_texts()]
        ticks = [float(re.findall(r"^-?[\d.]+", t)[0]) for t in texts]
        step = ticks[1] - ticks[0]
        assert f"{step:e}"[:2] in ("1.", "2.", "5."), texts
        assert all(abs(t / step - round(t / step)) < 1e-6 for t in ticks), texts
    ranges = [(44.1, 61.4), (0.0, 0.6), (-0.3, 0.3), (995.0, 1005.0), (-180.0, 180.0), (0.0012, 0.0017)]
    for low, high in ranges:
        theirs = timeline.evaluate(
            "async ([low, high]) => (await import('/static/js/common/ticks.js')).findRoundTicks(low, high)",
            [low, high],
        )
        ticks, digits = find_round_ticks(low, high)
        assert (theirs["ticks"], theirs["digits"]) == (pytest.approx(ticks), digits)


def test_a_raw_signal_shows_its_three_axes(timeline: Page) -> None:
    timeline.locator("#lane-1").select_option("shank_l_acc")
    expect(timeline.locator("[data-lane='1'] path")).to_have_count(3)
    expect(timeline.locator("[data-values]").nth(1)).to_contain_text(re.compile(r"x .*y .*z .*(m/s²|°/s)"))


def test_the_figure_comes_when_asked_for_and_stands_where_the_event_is(
    opened: Opener, solid: Browser, walked: str
) -> None:
    page = opened(f"/sessions/{walked}/timeline#t=20", browser=solid)
    expect(page.locator("gait-view")).to_have_count(0)
    page.get_by_role("button", name="Show the avatar").click()
    page.locator("gait-view[data-state=open]").wait_for(timeout=30_000)
    page.locator("[data-side=left] .ev.ic").first.focus()
    position = float(page.evaluate("document.activeElement.ariaValueNow"))
    page.wait_for_function(
        "t => Math.abs(document.querySelector('gait-view').dataset.shown - t) < 0.02",
        arg=position,
        timeout=30_000,
    )


def test_a_link_opens_a_moment(opened: Opener, walked: str) -> None:
    page = opened(f"/sessions/{walked}/timeline#t=30.5", stays=True)
    page.locator(".ev").first.wait_for()
    start, end = re.findall(r"\d+\.\d", page.locator("[data-span]").inner_text())[:2]
    assert float(start) < 30.5 < float(end)
    assert float(page.locator("time-bar input").input_value()) == pytest.approx(30.5, abs=0.02)


def test_what_somebody_else_changed_meanwhile_is_said_and_shown(
    timeline: Page, running: RunningServer, walked: str
) -> None:
    stride = next(s for s in review(running, walked)["strides"] if s["excluded_by"] is None)
    body = {"kind": "exclude_stride", "side": stride["side"], "reason": "by a colleague"}
    with running.client() as client:
        moment = (stride["start_s"] + stride["end_s"]) / 2
        client.post(f"/api/v1/sessions/{walked}/edits", json={**body, "time_s": moment}).raise_for_status()
    drag(timeline, handle(timeline, "tc"), 12)
    expect(timeline.locator("[data-problem]")).to_contain_text("Another user has changed")
    expect(timeline.locator("[data-edits]")).to_contain_text("by a colleague")
    assert len(review(running, walked)["edits"]) == 1


def test_a_drag_on_a_lane_moves_all_of_them_and_picks_nothing(timeline: Page) -> None:
    lane = timeline.locator("[data-side=left] .tl-blocks")
    box = lane.bounding_box()
    free = timeline.locator("[data-side=left] g[data-stride]:not(:has(.x))").nth(3).bounding_box()
    assert box is not None
    assert free is not None
    start = float(re.findall(r"\d+\.\d", timeline.locator("[data-span]").inner_text())[0])
    heading = timeline.locator("#h-stride").inner_text()
    # between the handles of a contact and its foot-off
    x, y = free["x"] + 0.35 * free["width"], box["y"] + box["height"] / 2
    timeline.mouse.move(x, y)
    timeline.mouse.down()
    timeline.mouse.move(x - box["width"] / 3, y, steps=6)
    timeline.mouse.up()
    moved = float(re.findall(r"\d+\.\d", timeline.locator("[data-span]").inner_text())[0])
    assert moved - start == pytest.approx(2.0, abs=0.15)
    assert timeline.locator("#h-stride").inner_text() == heading
    expect(timeline.locator("dialog[open]")).to_have_count(0)


@pytest.mark.parametrize("width", [1280, 360])
def test_the_dialogs_obey_the_design_system(opened: Opener, walked: str, width: int) -> None:
    page = opened(f"/sessions/{walked}/timeline", width=width, height=760, stays=True)
    expect(page.locator("[data-verdict]")).to_have_text("included")
    for button in ("[data-add]", "[data-out]"):
        page.locator(button).click()
        result = layout_faults(page) | text_faults(page)
        assert not result, f"{button} {width}: {result}"
        page.locator("dialog[open]").get_by_role("button", name="Cancel").click()
