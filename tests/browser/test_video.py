"""Video of a trial: consent, alignment at one contact, synchronous playback."""

from __future__ import annotations

import base64
import re

from playwright.sync_api import FilePayload, expect

from tests.browser.conftest import Filled, Opener, RunningServer

FILM = """async () => {
  const canvas = Object.assign(document.createElement('canvas'), { width: 64, height: 48 });
  const draw = canvas.getContext('2d'), stream = canvas.captureStream(25), pieces = [];
  const recorder = new MediaRecorder(stream, { mimeType: 'video/webm;codecs=vp8' });
  recorder.ondataavailable = (e) => pieces.push(e.data);
  recorder.start();
  for (let i = 0; i < 60; i++) {
    draw.fillStyle = `hsl(${6 * i} 80% 50%)`;
    draw.fillRect(0, 0, 64, 48);
    await new Promise((then) => setTimeout(then, 40));
  }
  await new Promise((then) => { recorder.onstop = then; recorder.stop(); });
  const bytes = new Uint8Array(await new Blob(pieces).arrayBuffer());
  return btoa(String.fromCharCode(...bytes));
}"""
"""Two seconds and more, as a browser's own recorder writes it: without its length in the head."""

SEEN = "(t) => Math.abs(document.querySelector('take-video video').currentTime - t) < 0.05"


def test_a_film_is_aligned_by_one_contact_and_follows_the_clock(
    opened: Opener, filled: Filled, running: RunningServer
) -> None:
    page = opened(f"/sessions/{filled.done}/data")
    page.wait_for_load_state()
    film = base64.b64decode(page.evaluate(FILM))
    add = page.get_by_role("button", name="Add a video")
    expect(add).to_be_disabled()
    page.get_by_label("The person has agreed to be filmed").check()
    expect(add).to_be_enabled()
    payload: FilePayload = {"name": "walk.webm", "mimeType": "video/webm", "buffer": film}
    page.locator("video-upload [data-file]").set_input_files(payload)
    expect(page.get_by_text("Not aligned yet")).to_be_visible()
    expect(page.get_by_text(re.compile("Consent to filming recorded by anna on"))).to_be_visible()
    page.goto(f"/sessions/{filled.done}")
    player = page.locator("take-video")
    page.wait_for_function("() => Number(document.querySelector('take-video')?.dataset.length) > 1.5")
    same = player.get_by_role("button", name=re.compile(r"Same moment as the \w+ contact at \d+\.\d\d s"))
    contact = float(re.findall(r"\d+\.\d\d", same.inner_text())[0])
    player.locator("video").evaluate("(v) => { v.currentTime = 0.6; }")
    page.wait_for_function(SEEN, arg=0.6)
    same.click()
    expect(player).to_have_attribute("offset", re.compile(r"-?\d"))
    expect(same).to_be_hidden()
    with running.client() as client:
        stored_body = client.get(f"/api/v1/sessions/{filled.done}/video").json()
    assert abs(stored_body["offset_s"] + contact - 0.6) < 0.06
    time = page.locator("time-bar input")
    for final in (0.5, 0.2):
        time.evaluate("(e, v) => { e.value = v; e.dispatchEvent(new Event('input')); }", contact + final)
        page.wait_for_function(SEEN, arg=0.6 + final)
    time.evaluate("(e) => { e.value = 0; e.dispatchEvent(new Event('input')); }")
    expect(player.get_by_text("does not show this moment")).to_be_visible()
    page.goto(f"/sessions/{filled.done}/data")
    page.wait_for_load_state()
    page.locator("video-upload").get_by_role("button", name="Remove").click()
    expect(page.get_by_text("None. A video plays next to the avatar")).to_be_visible()
