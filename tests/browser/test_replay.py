"""The 3D figure in its frame: walks through the room, leaves steps, follows the clock, is not lost."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from uuid import uuid4

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, Route, expect

from sagittal.core.frames import SIDES
from sagittal.server.viewer.client import client_version
from sagittal.server.viewer.colours import TINTS
from tests.browser import filling
from tests.browser.conftest import DESK, PACED, REST, Filled, Opener, RunningServer
from tests.browser.picture import wait_for_picture, wait_until_still
from tests.data import data_folder
from tests.helpers.walks import NEURA
from tests.server.viewer.seeing import pixels_of, shot


@pytest.fixture(scope="module")
def figure_page(
    solid: Browser, running: RunningServer, cookies: list[dict[str, str]], filled: Filled
) -> Iterator[Page]:
    """Session page with a loaded 3D view, shared because software rendering takes seconds."""
    context = solid.new_context(base_url=running.url, viewport=DESK)
    context.add_cookies(cookies)  # type: ignore[arg-type]
    context.add_init_script(PACED)
    page = context.new_page()
    page.emulate_media(color_scheme="light")
    page.goto(f"/sessions/{filled.done}")
    _wait_until_drawn(page)
    yield page
    context.close()


@pytest.fixture
def figure(figure_page: Page) -> Iterator[Page]:
    """The shared page for one test, reset afterwards."""
    yield figure_page
    switched = figure_page.locator("[data-switch][aria-pressed=false]")
    while switched.count():
        switched.first.click()
    figure_page.get_by_label("View from").select_option("near")
    if figure_page.locator("html[data-theme=dark]").count():
        figure_page.locator(".rail [data-theme-toggle]").click()
    _seek(figure_page, 0)


@pytest.mark.journey
def test_the_figure_has_two_legs_and_follows_the_clock(figure: Page) -> None:
    initial = wait_until_still(figure)
    assert initial["orange"] > 200
    assert initial["blue"] > 200
    figure.keyboard.press("j")
    figure.wait_for_function(
        "() => Math.abs(document.querySelector('gait-view').dataset.shown"
        " - document.querySelector('time-bar input').value) < 0.05"
    )
    final = wait_for_picture(figure, lambda now: now != initial)
    assert final["orange"] > 100, "the figure is gone"


def test_a_session_loads_little_the_first_time_and_next_to_nothing_again(
    solid: Browser, running: RunningServer, cookies: list[dict[str, str]], filled: Filled
) -> None:
    """With its figure, by a browser that was never here; and that it answers on two screens."""
    address, brotli = f"{running.url}/views/client/{client_version()}", {"Accept-Encoding": "br"}
    while "content-encoding" not in httpx.get(address, headers=brotli, trust_env=False).headers:
        time.sleep(0.2)  # the server packs viser's page once
    context = solid.new_context(base_url=running.url, viewport=DESK)
    context.add_cookies(cookies)  # type: ignore[arg-type]
    context.add_init_script(PACED)
    page = context.new_page()
    page.goto(f"/sessions/{filled.done}")
    _wait_until_drawn(page)
    loaded = page.evaluate(
        "() => ['navigation', 'resource'].flatMap((kind) => performance.getEntriesByType(kind))"
        ".map((e) => [new URL(e.name).pathname, e.transferSize])"
    )
    html = page.evaluate("() => performance.getEntriesByType('navigation')[0].decodedBodySize")
    assert html <= 80_000
    assert len(loaded) <= 14, loaded
    assert any(size > 500_000 for path, size in loaded if path.startswith("/views/")), "viser's is among them"
    assert sum(size for _, size in loaded) <= 700_000, loaded
    folds = page.locator("all-values").bounding_box()
    assert folds is not None
    assert folds["y"] <= 2 * 800, "what stands in front of the folds is longer than two screens"
    page.reload()
    _wait_until_drawn(page)
    second_evaluation = page.evaluate(
        "() => performance.getEntriesByType('resource').filter((e) => e.initiatorType === 'iframe')"
        ".map((e) => e.transferSize)"
    )
    assert len(second_evaluation) == 1
    assert second_evaluation[0] < 2_000, "a browser keeps viser's page"
    context.close()


def test_the_first_picture_gives_way_to_the_figure_without_a_jump(
    opened: Opener, solid: Browser, filled: Filled
) -> None:
    page, held = opened("/account", browser=solid), list[Route]()
    page.route("**/views/client/*", lambda route: held.append(route))
    page.goto(f"/sessions/{filled.done}", wait_until="domcontentloaded")
    view = page.locator("gait-view")
    drawn = shot(view)
    expect(view.get_by_role("img", name="Start of the replay")).to_be_visible()
    expect(view.locator("[data-say]")).to_have_text("Opening the 3D view…")
    while not held:
        page.wait_for_timeout(20)
    held[0].continue_()
    page.locator("gait-view[data-drawn]").wait_for()
    expect(view.get_by_role("img")).to_have_count(0)
    visible_rows = shot(view)
    for side in SIDES:
        first, then = (pixels_of(picture, TINTS[False][side]) for picture in (drawn, visible_rows))
        assert (first & then).sum() > 0.7 * max(first.sum(), then.sum()), side


def test_a_lost_line_comes_back_by_itself_and_keeps_what_was_switched(figure: Page) -> None:
    view = figure.locator("gait-view")
    for least in (200, 60):
        if least == 60:  # from afar it is small
            _switch(figure, "follow")
        figure.evaluate("document.querySelector('gait-view').socket.close()")
        expect(view).to_have_attribute("data-state", "lost")
        expect(view).to_have_attribute("data-state", "open", timeout=10_000)
        result = wait_for_picture(figure, lambda now: now["orange"] > least)  # noqa: B023 - called at once
        assert result["blue"] > least
    expect(figure.locator("[data-switch=follow]")).to_have_attribute("aria-pressed", "false")


def test_the_figure_goes_dark_with_the_page(figure: Page) -> None:
    light = wait_until_still(figure)
    figure.locator(".rail [data-theme-toggle]").click()
    dark = wait_for_picture(figure, lambda now: now["mean"] < 80 and now["blue"] > 0)
    assert light["mean"] > 200
    assert dark["orange"] > 0


def test_the_view_follows_the_walker(figure: Page) -> None:
    _switch(figure, "ground")
    for t_s in (12, 45):
        _seek(figure, t_s)
        assert 0.35 < wait_until_still(figure)["x"] < 0.65


def test_from_where_the_view_stands_still_the_walk_goes_on(figure: Page) -> None:
    _switch(figure, "follow")
    across = []
    for t_s in (15, 30, 45):
        _seek(figure, t_s)
        across.append(wait_until_still(figure)["x"])
    assert across[0] + 0.05 < across[1] < across[2] - 0.03


def test_steps_and_trails_are_left_behind_and_can_be_hidden(figure: Page) -> None:
    _seek(figure, 30)
    visible_rows = wait_until_still(figure)
    _switch(figure, "ground")
    hidden = wait_for_picture(figure, lambda now: visible_rows["orange"] > now["orange"] + 150)
    assert visible_rows["blue"] > hidden["blue"] + 150
    assert min(hidden["orange"], hidden["blue"]) > 200, "the figure is hidden too"


def test_a_take_of_two_feet_says_which_parts_are_estimated(
    figure: Page, opened: Opener, solid: Browser, running: RunningServer
) -> None:
    files, sensors = filling.simulated_files()
    feet = {k: v if v in ("foot_l", "foot_r") else None for k, v in sensors.items()}
    faint_page = _open(opened, solid, _analysed(running, files, feet))
    observations = []
    for page, estimated in ((figure, False), (faint_page, True)):
        expect(page.locator("[data-estimated]")).to_be_visible(visible=estimated)
        _switch(page, "ground")
        _seek(page, 20)
        observations.append(wait_until_still(page))
    full, faint = observations
    for colour in ("orange", "blue"):
        assert 30 < faint[colour] < 0.6 * full[colour]


def test_the_figure_is_looked_at_from_every_side(figure: Page) -> None:
    _switch(figure, "ground")
    _seek(figure, 12)
    observations = [wait_until_still(figure)]
    for view in ("right", "front", "top"):
        figure.get_by_label("View from").select_option(view)
        wait_for_picture(figure, lambda now: now != observations[-1])
        observations.append(wait_until_still(figure))
    assert [x for x in observations if not 0.3 < x["x"] < 0.7] == []
    # of legs seen from above less is seen than from the side
    assert observations[3]["orange"] + observations[3]["blue"] < 0.7 * (
        observations[0]["orange"] + observations[0]["blue"]
    )


def test_a_picture_of_the_figure_can_be_saved(figure: Page) -> None:
    _seek(figure, 12)
    wait_until_still(figure)
    with figure.expect_download(timeout=30_000) as waiting:
        figure.get_by_role("button", name="Save picture").click()
    assert re.fullmatch(r"figure-[\d.]+s\.png", waiting.value.suggested_filename)
    values = np.asarray(Image.open(waiting.value.path()).convert("RGB"))
    for side in SIDES:
        assert pixels_of(values, TINTS[False][side]).sum() > 200, side
    assert _is_large(values, figure)


def _is_large(picture: np.ndarray, page: Page) -> bool:
    """Whether a picture has the pixels of print, and the shape of the frame, which has its size again."""
    box = page.locator("gait-view iframe").bounding_box()
    stage = page.locator("gait-view").bounding_box()
    height, width = picture.shape[:2]
    assert box is not None
    assert stage is not None
    assert (box["width"], box["height"]) == (stage["width"], stage["height"])
    assert width / height == pytest.approx(box["width"] / box["height"], rel=0.01)
    return bool(width >= 1600)


def test_a_picture_saved_on_a_phone_is_as_large(opened: Opener, solid: Browser, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}", browser=solid, width=390, height=844)
    _wait_until_drawn(page)
    with page.expect_download(timeout=60_000) as waiting:
        page.get_by_role("button", name="Save picture").click()
    values = np.asarray(Image.open(waiting.value.path()).convert("RGB"))
    assert _is_large(values, page)
    assert pixels_of(values, TINTS[False]["left"]).sum() > 2000


EMPTY_AT_FIRST = """async () => {
  const { savePicture } = await import('/static/js/figure-export.js');
  const canvas = Object.assign(document.createElement('canvas'), { width: 64, height: 48 });
  const draw = canvas.getContext('2d');
  let asked = 0;
  await savePicture(canvas, () => {
    draw.clearRect(0, 0, 64, 48);
    draw.fillStyle = 'orange';
    if (++asked > 2) draw.fillRect(0, 0, 32, 48);
  }, 'figure.png');
}"""
"""A stream of a canvas that is empty in its first two frames, as that of a busy computer may be."""


def test_a_picture_of_an_empty_canvas_is_not_saved(opened: Opener) -> None:
    page = opened(REST)
    with page.expect_download(timeout=30_000) as waiting:
        page.evaluate(EMPTY_AT_FIRST)
    values = np.asarray(Image.open(waiting.value.path()).convert("RGB"))
    assert values[24, 16].tolist() == pytest.approx([255, 165, 0], abs=12)


def test_a_video_of_the_walking_figure_can_be_saved(figure: Page) -> None:
    with figure.expect_download(timeout=60_000) as waiting:
        figure.get_by_role("button", name="Record video").click()
        expect(figure.locator("time-bar [data-play]")).to_have_attribute("aria-label", "Pause")
        figure.wait_for_timeout(2500)
        figure.get_by_role("button", name="Stop and save").click()
    assert re.fullmatch(r"figure-[\d.]+s\.webm", waiting.value.suggested_filename)
    film = Path(waiting.value.path()).read_bytes()
    assert film[:4] == b"\x1a\x45\xdf\xa3"  # EBML
    assert len(film) > 5_000
    expect(figure.get_by_role("button", name="Record video")).to_be_visible()


def test_positions_for_the_eye_only_offer_no_view_of_the_whole_walk(
    opened: Opener, solid: Browser, running: RunningServer
) -> None:
    session = _analysed(running, *filling.simulated_files(), "stance_foot_anchor")
    page = _open(opened, solid, session)
    expect(page.locator("[data-switch=follow]")).to_be_hidden()
    expect(page.locator("[data-switch=ground]")).to_be_visible()


def test_a_real_walk_leaves_its_steps(opened: Opener, solid: Browser, running: RunningServer) -> None:
    folder = data_folder("neura_walk") / "rawimu"
    files = {p.name: p.read_bytes() for p in sorted(folder.glob("*.txt"))}
    page = _open(opened, solid, _analysed(running, files, NEURA))
    _seek(page, 19)
    visible_rows = wait_until_still(page)
    _switch(page, "ground")
    hidden = wait_for_picture(page, lambda now: now["orange"] < visible_rows["orange"] - 100)
    assert hidden["orange"] > 0


def _analysed(
    running: RunningServer,
    files: Mapping[str, bytes],
    sensors: Mapping[str, str | None],
    estimator: str = "auto",
) -> str:
    """A session with the analysis of a recording."""
    with running.client() as client:
        patient = filling.add(client, "/patients", code=f"P-{uuid4().hex[:6]}", height_m=1.7)["id"]
        session = filling.add_session(client, patient, "Walk")
        filling.upload(client, session, files)
        job = filling.analyse(client, session, sensors, {"poses": {"estimator": estimator}})
    assert job["state"] == "done", job
    return session


def _open(opened: Opener, solid: Browser, session_id: str) -> Page:
    page = opened(f"/sessions/{session_id}", browser=solid)
    _wait_until_drawn(page)
    return page


def _wait_until_drawn(page: Page) -> None:
    page.locator("gait-view[data-state=open]").wait_for(timeout=30_000)
    wait_for_picture(page, lambda now: min(now["orange"], now["blue"]) > 0)


def _seek(page: Page, t_s: float) -> None:
    """Move the time bar and wait until the figure is there."""
    page.locator("time-bar input").evaluate(
        "(e, t) => { e.value = t; e.dispatchEvent(new Event('input')); }", t_s
    )
    page.wait_for_function(
        "t => Math.abs(document.querySelector('gait-view').dataset.shown - t) < 0.05", arg=t_s
    )


def _switch(page: Page, name: str) -> None:
    page.locator(f"[data-switch={name}]").click()
