"""Frame messages for browsers: degrees, null for unknown values, texts for sensors; permissions."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from sagittal.core.calibration.score import CalibrationCheck, CalibrationScore
from sagittal.core.errors import Notice
from sagittal.core.online.frame import AngleTrail, CalibrationView, LiveFrame, SegmentCheck, SensorHealth
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.server.live import wire
from sagittal.server.live.room import KEPT, QUEUE, Room

GOOD = SensorHealth("A1", "pelvis", 99.87, 0.0, 0.0, 0.01, False)
STRIDE = LiveStride(
    4, "left", 10.0, 10.6, 11.0, 11.03, {"stance_pct": 60.0, "step_length_m": None},
    {"step_length_m": "not_yet"}, {"knee_flexion": np.linspace(0.0, np.pi / 2, 101)}, None, ("turn",),
    False, False,
)  # fmt: skip


def told(
    frame: LiveFrame, trail: tuple[AngleTrail, ...] = (), battery: dict[str, float] | None = None
) -> Any:
    slow = wire.slow_part(frame, battery or {})
    return json.loads(wire.frame(frame, trail, slow, {"left": 40.04, "right": None}) + b"}")


def test_angles_are_degrees_and_what_is_lost_is_null() -> None:
    frame = LiveFrame(
        1.5,
        7,
        "running",
        angles={"knee": np.pi / 6, "hip": float("nan")},
        contact={"left": True, "right": False},
    )
    trail = AngleTrail(np.array([1.49, 1.5]), ("knee", "hip"), np.array([[0.0, np.nan], [np.pi / 6, 0.1]]))
    message = told(frame, (trail,))
    assert message["angles_deg"] == {"knee": 30.0, "hip": None}
    assert message["trace"] == {"t": [1.49, 1.5], "knee": [0.0, 30.0], "hip": [None, 5.73]}
    assert message["contact"] == {"l": True, "r": False}
    assert message["phase"] == {"l": 40.0, "r": None}
    assert (message["t"], message["stage"], message["calibration"], message["health"]) == (
        1.5,
        "running",
        None,
        [],
    )


def test_trails_that_were_not_sent_are_joined_and_other_names_are_another_curve() -> None:
    frame = LiveFrame(2.0, 1, "running")
    old = AngleTrail(np.array([1.0]), ("hip",), np.array([[0.1]]))
    parts = [AngleTrail(np.array([t]), ("knee",), np.array([[0.0]])) for t in (1.1, 1.2)]
    assert told(frame, (old, *parts))["trace"] == {"t": [1.1, 1.2], "knee": [0.0, 0.0]}


@pytest.mark.parametrize(
    ("change", "state", "words"),
    [
        ({}, "ok", ""),
        ({"segment": None}, "none", "not used"),
        ({"silent_s": 0.7}, "bad", "silent"),
        ({"silent_s": 12.4, "lost_share": 0.5}, "bad", "silent for 12 s"),
        ({"lost_share": 0.25}, "bad", "25 % lost"),
        ({"lost_share": 0.02, "saturated_share": 0.1}, "warn", "2 % lost"),
        ({"saturated_share": 0.01}, "warn", "saturated"),
        ({"doubt": "sensors_exchanged", "lost_share": 0.02}, "bad", "exchanged"),
        ({"doubt": "sensor_slipped"}, "bad", "slipped"),
        ({"doubt": "sensor_late"}, "warn", "late"),
        ({"doubt": "clocks_disagree"}, "warn", "clock in doubt"),
    ],
)
def test_a_sensor_is_judged_by_the_worst(change: dict[str, Any], state: str, words: str) -> None:
    row = told(LiveFrame(0.0, 0, "stand", health=(replace(GOOD, **change),)))["health"][0]
    assert (row["state"], row["words"]) == (state, words)
    assert row["battery_pct"] is None


def test_a_low_battery_is_said() -> None:
    row = told(LiveFrame(0.0, 0, "stand", health=(GOOD,)), battery={"A1": 9.0})["health"][0]
    assert (row["state"], row["words"], row["battery_pct"]) == ("warn", "battery low", 9.0)


def test_a_failed_calibration_says_why() -> None:
    notice = Notice("not_still", "The left foot moved.", "foot_l", 2.0)
    check = SegmentCheck("foot_l", False, None, None, (notice,))
    view = CalibrationView(3.0, 0.0, 0, (check,), False, notice)
    message = told(LiveFrame(2.0, 1, "stand", calibration=view))["calibration"]
    assert message["problem"]["message"] == "The left foot moved."
    assert message["checks"][0]["notices"][0]["severity"] == "warn"
    assert (message["ok"], message["checks"][0]["score"]) == (False, None)


def test_a_calibration_that_does_not_pass_says_where_why_and_what_to_do() -> None:
    good = CalibrationCheck("stillness", "foot_l", 1.0, 4.0, "pass")
    bad = replace(good, segment="shank_r", value=6.0, verdict="redo", why="shank_r tilted.")
    view = CalibrationView(3.0, 9.0, 8, (), True, score=CalibrationScore((good, bad)))
    message = told(LiveFrame(2.0, 1, "running", calibration=view))["calibration"]["verdict"]
    assert message["verdict"] == "redo"
    assert message["headline"] == "Calibrate again: 1 of 2 checks fails, at the right shank."
    assert message["redo"] == [
        {
            "place": "right shank",
            "title": "Standing still",
            "why": "right shank tilted.",
            "todo": bad.todo,
        }
    ]
    assert (
        told(LiveFrame(2.0, 1, "walk", calibration=replace(view, score=None)))["calibration"]["verdict"]
        is None
    )


def test_a_stride_has_51_points_and_the_reason_of_every_null() -> None:
    stride = wire.stride(STRIDE)
    assert stride["foot_off_pct"] == 60.0
    assert stride["values"] == {"stance_pct": 60.0, "step_length_m": None}
    assert stride["reasons"] == {"step_length_m": "not_yet"}
    assert stride["curves_deg"]["knee_flexion"][::25] == [0.0, 45.0, 90.0]
    assert wire.stride(replace(STRIDE, foot_off_s=None))["foot_off_pct"] is None


def test_a_browser_that_does_not_read_gets_the_newest_state_and_the_last_strides() -> None:
    async def watch() -> list[bytes]:
        room = Room()
        with room.viewing() as viewer:
            for i in range(QUEUE + 50):
                room.say("frame", b"frame %d" % i)
                room.say("stride", b"stride %d" % i)
                room.say("state", b"state %d" % i)
            return await viewer.take()

    got = asyncio.run(watch())
    newest = QUEUE + 49
    assert got[0] == b"state %d" % newest
    assert got[-1] == b"frame %d" % newest
    assert got[1:-1] == [b"stride %d" % i for i in range(50, newest + 1)]


def test_who_comes_later_gets_the_last_strides_and_cues_and_nothing_of_another_take() -> None:
    async def first() -> list[bytes]:
        with room.viewing() as viewer:
            return await viewer.take()

    room = Room()
    for k in range(100):
        for telling in range(3):
            room.keep_stride(b'{"n":%d,"telling":%d}' % (k, telling))
        room.keep_cue(k, b"cue %d" % k)
    room.keep_cue(99, b"cue 99")  # said again by a new estimator
    room.say("feedback", b"feedback")
    got = asyncio.run(first())
    assert [m for m in got if m.startswith(b"cue")] == [b"cue %d" % k for k in range(100 - KEPT, 100)]
    texts = [msgspec.json.decode(m) for m in got if m.startswith(b"{")]
    assert texts == [{"n": n, "telling": 2} for n in range(100 - KEPT, 100)], "each as it was told last"
    assert got[-1] == b"feedback"
    room.forget_strides()
    room.keep_stride(b'{"n":0}')
    assert asyncio.run(first()) == [b'{"n":0}', b"feedback"]
    room.clear()
    room.say("state", b"state")
    assert asyncio.run(first()) == [b"state"]
