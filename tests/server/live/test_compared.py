"""Sensor comparison of a live trial runs after all other output of a batch, and its findings are reported."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from sagittal.core.errors import Notice
from sagittal.core.formats.live_log import SampleBatch
from sagittal.core.frames import Segment
from sagittal.core.online import LiveFrame, OnlineSession
from sagittal.core.simulate import simulate_scenario
from sagittal.server.live.follower import Follower
from sagittal.server.live.messages import FeedItem, FollowTake, Report
from tests.helpers.live import send, shared

FEET: dict[Segment | None, Segment] = {"foot_l": "foot_r", "foot_r": "foot_l"}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A take whose feet were exchanged."""
    recording = simulate_scenario("comfortable", 3).recording
    wrong = replace(recording, segments={d: FEET.get(s, s) for d, s in recording.segments.items()})
    path = tmp_path_factory.mktemp("log") / "take"
    path.write_bytes(send([shared(wrong)]).log())
    return path


@pytest.mark.slow
def test_sensors_are_compared_when_strides_and_cues_are_out(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    message: list[Report] = []
    messages: list[tuple[int, int]] = []  # strides of the frames so far, and those said of them
    strides = 0
    push, compare = OnlineSession.push, OnlineSession.compare_sensors

    def pushed(online: OnlineSession, batch: SampleBatch) -> LiveFrame | None:
        nonlocal strides
        frame = push(online, batch)
        strides += 0 if frame is None else len(frame.strides)
        return frame

    def compared(online: OnlineSession) -> list[Notice]:
        messages.append((strides, sum(isinstance(x, FeedItem) and x.kind == "stride" for x in message)))
        return compare(online)

    monkeypatch.setattr(OnlineSession, "push", pushed)
    monkeypatch.setattr(OnlineSession, "compare_sensors", compared)
    follower = Follower(
        FollowTake("take", str(log), log.stat().st_size, 1.75, "walk", None, None, []), message.append
    )
    while follower.has_work:
        follower.step()
    follower.close()
    assert strides > 20
    assert all(expected == out for expected, out in messages)
    notices = [msgspec.json.decode(x.body) for x in message if isinstance(x, FeedItem) and x.kind == "notice"]
    (result,) = [x for x in notices if x["code"] == "sensors_exchanged"]
    assert result["sensor"] == "foot_l"
    assert "left foot with right foot" in result["text"]
