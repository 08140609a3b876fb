"""Live pages driven by a simulated feed: states, charts, texts, sound."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, Locator, Page, Route, expect

from sagittal.core.online.frame import Stage
from tests.browser import feed, filling
from tests.browser.conftest import WITHOUT_FIGURE, KeptContexts, RunningServer
from tests.browser.design import SIZES, layout_faults, text_faults
from tests.browser.feed import Told
from tests.browser.test_german import left_english

Opener = Callable[..., Told]

LIFTED = "(e) => e.hidden"
"""Of what covers a picture, for `_seen`."""

HEARD = """() => {
  window.heard = [];
  const start = OscillatorNode.prototype.start;
  OscillatorNode.prototype.start = function (...at) {
    window.heard.push(Math.round(this.frequency.value));
    return start.apply(this, at);
  };
}"""
"""Notes the pitch of every sound that is really started."""

PIXELS = """([tag, token]) => {
  const canvas = document.querySelector(`${tag} canvas`), g = canvas.getContext('2d');
  const probe = document.createElement('canvas').getContext('2d'), named = document.createElement('span');
  document.body.append(named);
  named.style.color = `var(--${token})`;
  probe.fillStyle = getComputedStyle(named).color;
  named.remove();
  probe.fillRect(0, 0, 1, 1);
  const [r, gr, b] = probe.getImageData(0, 0, 1, 1).data;
  const d = g.getImageData(0, 0, canvas.width, canvas.height).data;
  let n = 0;
  for (let i = 0; i < d.length; i += 4) {
    const off = Math.abs(d[i] - r) + Math.abs(d[i + 1] - gr) + Math.abs(d[i + 2] - b);
    n += off < 12 && d[i + 3] > 200 ? 1 : 0;
  }
  return n;
}"""
"""Pixels of a canvas in the colour of a token."""


@pytest.fixture(scope="module")
def trained(running: RunningServer) -> tuple[str, str, str]:
    """Sessions: step length with bar and sound; the same as a path, right; nothing prescribed."""
    result = []
    with running.client() as client:
        for code, side, modes in (
            ("P-0060", "left", ["bar", "tone", "tick"]),
            ("P-0061", "right", ["zone"]),
            ("P-0062", None, None),
        ):
            patient = filling.add(client, "/patients", code=code, sex="male", birth_year=1968, height_m=1.76)[
                "id"
            ]
            if modes is not None:
                prescribe(client, patient, side=side, modes=modes)
            result.append(filling.add_session(client, patient, "Training 10"))
    return result[0], result[1], result[2]


def prescribe(client: httpx.Client, patient_id: str, **changed: Any) -> None:
    """Step length with a manual target."""
    record = {
        "parameter": "step_length_m",
        "side": "left",
        "target": {"source": "manual", "mean": feed.TARGET, "sd": feed.SD},
        **changed,
    }
    filling.add(client, f"/patients/{patient_id}/prescriptions", **record)


@pytest.fixture
def told(flat: Browser, kept: KeptContexts) -> Opener:
    """Open a page whose feed the test controls."""

    def open_(
        path: str, *, width: int = 1280, height: int = 800, scheme: str = "light", locale: str = "en-US"
    ) -> Told:
        page = kept.take(flat, WITHOUT_FIGURE, locale).new_page()
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")  # type: ignore[arg-type]
        page.add_init_script(f"({HEARD})()")
        this = Told.of(page)
        page.goto(path)
        page.wait_for_function("() => true")
        _until(lambda: bool(this.routes), page)
        return this

    return open_


def test_the_strip_draws_zones_as_shapes_and_a_table_says_the_same(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    page = _therapist(told, trained[0])
    for token in ("target", "ok", "warn", "bad", "accent"):
        page.wait_for_function(f"args => ({PIXELS})(args) > 20", arg=["target-strip", token])
    expect(page.locator("[data-in-zone]")).to_have_text("2 of 4 in zone")
    expect(page.locator("[data-asymmetry]")).to_have_text(re.compile("left shorter by 0.0"))
    page.get_by_role("button", name="Table").click()
    rows = page.locator("#strides-table tbody tr")
    expect(rows).to_have_count(4)
    expect(rows.first).to_contain_text("just below")
    expect(rows.nth(1)).to_contain_text("no, faded out")


def test_the_current_stride_grows_without_a_norm_of_another_zero_and_follows_the_joint(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    this.walk([0.53], ["in"])
    page = this.page
    drawn = []
    for i in range(20):
        this.say(feed.frame(112.02 + 0.03 * i))
        drawn.append(page.evaluate(PIXELS, ["stride-chart", "left"]))
    assert drawn[-1] > drawn[0]
    assert page.evaluate(PIXELS, ["stride-chart", "norm"]) < 100, "what starts from standing has no band"
    drawing = "() => document.querySelector('stride-chart canvas').toDataURL()"
    initial_evaluation = page.evaluate(drawing)
    page.get_by_role("button", name="Hip").click()
    page.wait_for_timeout(150)
    assert page.evaluate(drawing) != initial_evaluation
    expect(page.locator("[data-variable]")).to_have_text("Hip flexion, relative to standing")


def test_charts_follow_the_theme(told: Opener, trained: tuple[str, str, str]) -> None:
    page = _therapist(told, trained[0])
    drawn, source = f"(of) => ({PIXELS.strip()})(of) > 100", ["stride-chart", "left"]
    page.wait_for_function(drawn, arg=source)
    page.emulate_media(color_scheme="dark")
    page.wait_for_function(drawn, arg=source)
    assert page.evaluate(PIXELS, source) > 100


def test_left_against_right_is_said_of_four_strides_that_tell_them_apart_only(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    asymmetry = this.page.locator("[data-asymmetry]")
    this.walk([0.53, 0.45, 0.52], ["in", "low", "in"])
    expect(asymmetry).to_have_text("too few strides to compare")
    this.say(feed.stride(6, "left", 0.495), feed.stride(7, "right", 0.57))
    expect(asymmetry).to_have_text(re.compile("left shorter by 0.0"))
    this.say(feed.stride(8, "left", 0.75), feed.stride(9, "right", 0.57))
    expect(asymmetry).to_have_text("no clear difference")


def test_old_data_cover_the_charts_until_new_ones_come(told: Opener, trained: tuple[str, str, str]) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    this.walk([0.53], ["in"])
    cover = this.page.locator("[data-cover]")
    expect(cover).to_be_visible()
    with _seen(cover, LIFTED, True):
        this.say_fresh()
    expect(cover).to_be_visible()
    expect(this.page.locator("stride-chart canvas")).to_be_hidden()
    with _seen(cover, LIFTED, True):
        this.say_fresh()
    this.say(feed.frame(this.at_s + 1.1, stale=True))
    expect(cover).to_be_visible()


def test_after_stop_the_page_says_that_it_is_saving_not_that_data_are_missing(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    this.walk([0.53], ["in"])
    page, cover = this.page, this.page.locator("[data-cover]")
    held: list[Route] = []  # the server's answer to STOP is held back: the page must not wait for it
    page.route("**/live/commands", lambda route: held.append(route))
    page.get_by_role("button", name="STOP").click()
    expect(cover).to_contain_text("Stopping… saving")
    expect(page.locator("[data-rec]")).to_contain_text("Stopping… saving")
    expect(cover).to_contain_text("The tablet is sending the remaining data")
    this.say(feed.frame(100.9, stale=True))
    expect(cover).not_to_contain_text("Paused")
    expect(page.locator("[data-spoken]")).to_contain_text("Stopping", timeout=30_000)


def test_a_page_opened_after_stop_and_one_whose_stop_was_refused_say_what_is(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    this.say(feed.state(stopping=True), feed.feedback(), feed.frame(100.0))
    expect(this.page.locator("[data-cover]")).to_contain_text("Stopping… saving")
    this.page.close()
    second = told(f"/sessions/{trained[0]}/live")
    second.walk([0.53], ["in"])
    second.page.get_by_role("button", name="STOP").click()  # the server knows of no take here
    expect(second.page.locator("[data-note=problem]")).to_be_visible()
    expect(second.page.locator("[data-rec]")).to_contain_text("Recording")
    expect(second.page.locator("[data-cover]")).not_to_contain_text("Stopping")


@pytest.mark.parametrize("size", [(820, 1180), (768, 1024), (701, 1000), (390, 844)])
def test_nothing_of_the_live_page_is_cut_off_on_a_tablet_held_upright(
    size: tuple[int, int], told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live", width=size[0], height=size[1])
    this.walk([0.53, 0.45], ["in", "low"])
    page = this.page
    title = "Gait training with feedback, left leg first, after the pause"
    page.locator(".live-top h1").evaluate("(h, title) => { h.lastChild.textContent = title; }", title)
    mark = {"t_s": 93.0, "value": "lost balance near the door"}
    this.say(feed.state(marks=[mark]), feed.frame(100.2))
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    boxes = page.evaluate(
        """() => [...document.querySelectorAll('[data-do=stop], .live-bot .btn, .live-grid > *')]
          .map((e) => [e.dataset.do ?? e.className, e.getBoundingClientRect()])
          .filter(([name, r]) => r.width).map(([name, r]) => [name, r.left, r.right, r.height])"""
    )
    assert {"stop", "pause", "mark", "undo", "sound", "screen"} <= {name for name, *_ in boxes}
    cut = [b for b in boxes if b[1] < 0 or b[2] > size[0] or b[3] < 44]
    assert not cut


def test_a_lost_tablet_is_said_and_stop_asks_before_leaving_data_there(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    this.say(feed.state(tablet="lost"), feed.frame(10.0))
    page = this.page
    expect(page.locator("[data-note=tablet]")).to_contain_text("Nothing is lost")
    page.get_by_role("button", name="STOP").click()
    expect(page.locator("[data-note=tablet]")).to_contain_text("the rest stays on the tablet")
    this.say(feed.state())
    expect(page.locator("[data-note=tablet]")).to_have_count(0)


def test_stop_stays_within_reach_while_a_mark_is_written(told: Opener, trained: tuple[str, str, str]) -> None:
    page = _therapist(told, trained[0])
    page.get_by_role("button", name="Mark", exact=True).click()
    expect(page.get_by_label("What happened")).to_be_focused()
    stop = page.get_by_role("button", name="STOP")
    box = stop.bounding_box()
    assert box is not None
    assert box["height"] >= 56
    assert box["x"] + box["width"] > 1280 - 32
    stop.click(trial=True)
    page.keyboard.press("Escape")
    expect(page.locator("#mark-dialog")).to_be_hidden()


@pytest.mark.parametrize(("stage", "words"), [("stand", "stand still"), ("walk", "walk straight ahead")])
def test_calibration_says_what_is_waited_for(
    stage: Any, words: str, told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    this.say(feed.state(), feed.frame(2.0, stage))
    expect(this.page.locator("live-calibration [data-say]")).to_contain_text(words)
    expect(this.page.locator(".checks tbody tr")).to_have_count(7)
    expect(this.page.locator(".checks tbody")).to_contain_text("still" if stage == "stand" else "moving")
    expect(this.page.locator("live-sensors")).to_contain_text("3 % lost")
    expect(this.page.locator("live-sensors")).to_contain_text("battery low")


def test_clock_and_sensors_are_shown_before_the_estimator_has_said_anything(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    row = {"rate_hz": 60.0, "lost_pct": None, "still": None, "battery_pct": None, "state": "ok", "words": ""}
    sensors = [{"id": "A1", "segment": "pelvis", **row}, {"id": "A2", "segment": "foot_l", **row}]
    this.say(feed.state(estimate="preparing", elapsed_s=65.0, sensors=sensors))
    expect(this.page.locator("[data-elapsed]")).to_contain_text("01:0")
    expect(this.page.locator("live-sensors tbody tr")).to_have_count(2)
    expect(this.page.locator("live-sensors [data-all]")).to_contain_text("2 of 2 good")
    expect(this.page.locator("live-sensors tbody")).to_contain_text("60 Hz")
    expect(this.page.locator(".checks tbody tr")).to_have_count(2)
    expect(this.page.locator("live-calibration [data-say]")).to_contain_text("being recorded")


def test_a_code_is_shown_in_two_groups_and_a_second_page_asks_for_a_new_one(
    flat: Browser, running: RunningServer, cookies: list[dict[str, str]]
) -> None:
    with running.client() as client:
        patient = filling.add(client, "/patients", code="P-0063")["id"]
        session = filling.add_session(client, patient, "Walk")
    context = flat.new_context(base_url=running.url)
    context.add_cookies(cookies)  # type: ignore[arg-type]
    page = context.new_page()
    page.goto(f"/sessions/{session}")
    page.get_by_role("link", name="Record live").click()
    page.wait_for_url(re.compile(r"/live$"))  # loaded: its button works
    page.get_by_role("button", name="Open for the tablet").click()
    expect(page.locator("[data-code]")).to_have_text(re.compile(r"^[2-9A-Z]{3} [2-9A-Z]{3}$"))
    expect(page.locator("[data-code-left]")).to_have_text(re.compile("Valid for 09:"))
    first = page.locator("[data-code]").text_content()
    other_other_page = context.new_page()
    other_other_page.goto(f"/sessions/{session}/live")
    expect(other_other_page.locator("[data-code-left]")).to_contain_text("Request a new one")
    other_other_page.get_by_role("button", name="New code").click()
    expect(other_other_page.locator("[data-code]")).to_have_text(re.compile(r"^[2-9A-Z]{3} [2-9A-Z]{3}$"))
    assert other_other_page.locator("[data-code]").text_content() != first
    context.close()


def test_the_patient_sees_no_number_and_reads_the_way_to_the_zone(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = _patient(told, trained[0])
    this.say_fresh(feed.cue(0, 0.53, "in"))
    message = this.page.locator("[data-message]")
    expect(message).to_have_text("Good step")
    this.say_fresh(feed.cue(2, 0.49, "near_low"))
    expect(message).to_have_text("A little longer")
    this.say_fresh(feed.cue(4, 0.62, "high"))
    expect(message).to_have_text("Shorter")
    assert not re.search(r"\d", this.page.locator("patient-screen").inner_text())
    kinds = [m.get_attribute("class") for m in this.page.locator("[data-last] svg").all()]
    assert kinds == ["in", "near", "away"]
    sizes = this.page.evaluate(
        "() => [...document.querySelectorAll('patient-screen :is(span, b, p, button, label)')]"
        ".filter(e => e.checkVisibility() && e.innerText?.trim())"
        ".map(e => parseFloat(getComputedStyle(e).fontSize))"
    )
    assert min(sizes) >= 32
    # held upright the picture takes the width, and nothing of it is cut off
    this.page.set_viewport_size({"width": 820, "height": 1180})
    track, feet = (this.page.locator(f"[data-scene=bar] {part}") for part in (".track", "[data-feet]"))
    this.page.wait_for_function("() => document.querySelector('.track').getBoundingClientRect().height > 600")
    for part in (track, feet):
        box = part.bounding_box()
        assert box is not None
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 820
    # what to do is said at every stage
    stages: tuple[tuple[Stage, str], ...] = (("stand", "Stand still"), ("walk", "Walk on"))
    for stage, words in stages:
        with _seen(this.page.locator("[data-pause-title]"), "(e) => e.textContent", words):
            this.say_fresh(stage=stage)
    this.say_fresh(feed.feedback(on=False))
    expect(message).to_have_text("On your own")
    this.say(feed.state("finished"))
    expect(this.page.locator("[data-pause-title]")).to_have_text("Well done")


def test_sound_follows_the_error_and_the_contacts_after_one_tap(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = _patient(told, trained[0], sound=True)
    page = this.page
    this.say_fresh(feed.cue(2, 0.47, "low"), contact="r")
    for contact in ("rl", "l", "lr"):
        this.say_fresh(contact=contact)
    page.wait_for_function("() => heard.length === 3")
    assert page.evaluate("heard") == [240, 880, 660]
    this.say_fresh(feed.cue(4, 0.53, "in"), contact="l")
    expect(page.locator("[data-last] svg.in")).to_have_count(1)  # it has been taken
    assert len(page.evaluate("heard")) == 3
    this.say(feed.feedback(paused=True))
    this.say_fresh(contact="lr")
    expect(page.locator("[data-pause-title]")).to_be_visible()
    assert len(page.evaluate("heard")) == 3


def test_a_stride_without_feedback_dims_everything(told: Opener, trained: tuple[str, str, str]) -> None:
    this = _patient(told, trained[0])
    this.say_fresh(feed.cue(0, 0.53, "in"), feed.cue(2, 0.45, "low", "probe"))
    expect(this.page.locator("patient-screen")).to_have_attribute("data-faded", "")
    expect(this.page.locator("[data-message]")).to_have_text("On your own")
    assert this.page.locator("[data-last] svg").count() == 1
    this.say_fresh(feed.cue(4, 0.53, "in"))
    expect(this.page.locator("patient-screen")).not_to_have_attribute("data-faded", "")


def test_the_patient_screen_pauses_when_data_are_old(told: Opener, trained: tuple[str, str, str]) -> None:
    this = _patient(told, trained[0])
    pause = this.page.locator("[data-pause]")
    with _seen(pause, LIFTED, True):
        this.say_fresh()
    expect(pause).to_be_visible()
    expect(pause).to_contain_text("Short pause")
    this.say(feed.cue(2, 0.53, "in"))
    assert this.page.locator("[data-last] svg").count() == 0
    with _seen(pause, LIFTED, True):
        this.say_fresh()


def test_the_picture_moves_aside_for_neglect_and_stays_so(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[1]}/live/patient")
    page = this.page
    page.get_by_role("button", name="Picture right").click()
    page.get_by_role("button", name="Without sound").click()
    this.say(feed.state(), feed.feedback(), feed.frame(100.0))
    expect(page.locator("patient-screen")).to_have_attribute("data-picture", "path")
    expect(page.locator("[data-what]")).to_have_text("Right step")
    middle = page.locator("[data-scene=path] .road").bounding_box()
    assert middle is not None
    assert middle["x"] + middle["width"] / 2 > 640 + 100
    page.reload()
    expect(page.locator("patient-screen")).to_have_attribute("data-side", "right")


def test_the_therapist_switches_the_sound_of_the_patient_screen(
    told: Opener, trained: tuple[str, str, str]
) -> None:
    this = told(f"/sessions/{trained[0]}/live")
    this.walk([0.53], ["in"])
    page = this.page
    button = page.locator("[data-do=sound]")
    expect(button).to_be_disabled()
    with page.context.expect_page() as opened:
        page.get_by_role("button", name="Patient screen").click()
    screen = opened.value
    screen.get_by_role("button", name="With sound").click()
    expect(button).to_have_text("Sound on")
    button.click()
    expect(button).to_have_text("Sound off")
    expect(screen.locator("[data-settings] use")).to_have_attribute("href", "#i-mute")


def test_every_state_obeys_the_design_system(told: Opener, trained: tuple[str, str, str]) -> None:
    faults: dict[str, dict[str, Any]] = {}
    this = told(f"/sessions/{trained[0]}/live")
    this.say(feed.state("pairing", "none"))
    faults["pair"] = _faults_everywhere(this)
    this.say(feed.state())
    faults["stand"] = _faults_everywhere(this, "stand")
    this.walk([0.53, 0.49], ["in", "near_low"])
    faults["run"] = _faults_everywhere(this, "running")
    expect(this.page.locator("[data-cover]")).to_be_visible()
    faults["stale"] = _faults_everywhere(this)
    screen = _patient(told, trained[0])
    screen.say_fresh(feed.cue(0, 0.49, "near_low"))
    faults["patient"] = _faults_everywhere(screen, "running")
    assert not {k: v for k, v in faults.items() if v}


def test_a_running_take_is_german(told: Opener, trained: tuple[str, str, str]) -> None:
    this = told(f"/sessions/{trained[0]}/live", locale="de-DE")
    this.say(feed.state())
    faults = {"walk": _faults_everywhere(this, "walk")}
    assert left_english(this.page) == []
    this.walk([0.53, 0.49], ["in", "near_low"])
    faults["run"] = _faults_everywhere(this, "running")
    assert left_english(this.page) == []
    screen = told(f"/sessions/{trained[0]}/live/patient", locale="de-DE")
    screen.page.get_by_role("button", name="Ohne Ton").click()
    screen.say(feed.state(), feed.feedback(), feed.frame(100.0, contact="r"), feed.cue(0, 0.49, "near_low"))
    expect(screen.page.locator("[data-what]")).to_have_text("Schritt links")
    faults["patient"] = _faults_everywhere(screen, "running")
    assert left_english(screen.page) == []
    assert not {k: v for k, v in faults.items() if v}


def _faults_everywhere(this: Told, stage: Stage | None = None) -> dict[str, Any]:
    """Faults of a state in every size, light and dark; a new frame each time keeps a stage from going old."""
    fields: dict[str, Any] = {}
    for width, height in SIZES:
        this.page.set_viewport_size({"width": width, "height": height})
        for scheme in ("light", "dark"):
            this.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            if stage is None:
                this.say()
            else:
                this.say_fresh(stage=stage)
            faults = {**layout_faults(this.page), **text_faults(this.page)}
            fields |= {f"{width} {scheme}": faults} if faults else {}
    return fields


def _therapist(notices: Opener, session: str) -> Page:
    this = notices(f"/sessions/{session}/live")
    this.walk([0.53, 0.45, 0.52, 0.495], ["in", "low", "in", "near_low"])
    return this.page


def _patient(notices: Opener, session: str, *, sound: bool = False, **size: Any) -> Told:
    this = notices(f"/sessions/{session}/live/patient", **size)
    this.page.get_by_role("button", name="With sound" if sound else "Without sound").click()
    this.say(feed.state(), feed.feedback(), feed.frame(100.0, contact="r"))
    return this


@contextmanager
def _seen(place: Locator, what: str, expected: Any) -> Iterator[None]:
    """Assert that an element's value matched at least once while the block ran.

    Parameters
    ----------
    what : JavaScript from the element to the compared value.
    """
    place.evaluate(
        f"""(e) => {{ window.seen = []; new MutationObserver(() => seen.push(({what})(e)))
          .observe(e, {{attributes: true, childList: true, characterData: true, subtree: true}}); }}"""
    )
    yield
    place.page.wait_for_function("wanted => seen.includes(wanted)", arg=expected)


def _until(done: Callable[[], bool], page: Page) -> None:
    for _ in range(100):
        if done():
            return
        page.wait_for_timeout(20)
    raise AssertionError("the page did not open its feed")


def test_a_test_whose_estimate_has_ended_shows_no_running_clock_and_nothing_to_begin(
    told: Opener, running: RunningServer
) -> None:
    with running.client() as client:
        patient = filling.add(client, "/patients", code="P-0069", height_m=1.7)["id"]
        session = filling.add_session(client, patient, "Up and go", protocol="tug")
    this = told(f"/sessions/{session}/live")
    test, page = this.page.locator("live-test"), this.page
    begun = {
        "phase": "running", "say": "Walk three metres", "start_s": 1.0, "end_s": None, "seconds": None,
        "rises": 0, "problem": None, "figures": [], "segments": [], "corrected": False,
    }  # fmt: skip
    this.say(feed.state(), json.dumps(json.loads(feed.frame(4.0)) | {"test": begun}))
    expect(test.locator("[data-phase]").first).to_have_text("Running")
    expect(test.get_by_role("button", name="Start over")).to_be_visible()
    this.say(feed.state(estimate="failed"))
    expect(test.locator("[data-phase]").first).to_have_text("Live view stopped")
    expect(test.locator("[data-say]")).to_contain_text("analysed afterwards")
    expect(test.get_by_role("button", name="Start over")).to_be_hidden()
    expect(test.locator("[data-clock]")).to_have_css("text-decoration-line", "line-through")
    visible_text = test.locator("[data-clock]").inner_text()
    expect(page.locator("[data-note=estimate]")).to_contain_text("The live view has stopped.")
    page.wait_for_timeout(13_000)  # longer than a notice stays
    this.say(feed.state(estimate="failed"))
    expect(page.locator("[data-note=estimate]")).to_be_visible()
    expect(test.locator("[data-clock]")).to_have_text(visible_text)
