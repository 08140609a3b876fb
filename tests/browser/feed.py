"""Messages of a live session's feed, made with the server's encoder, and a browser that receives them."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from playwright.sync_api import Page, WebSocketRoute

from sagittal.core.feedback.cue import Cue, FeedbackState, GuardState, SideEffect, Summary, Tone, WhyNot, Zone
from sagittal.core.frames import SUFFIX, Side
from sagittal.core.norms import look_up_norms
from sagittal.core.online.frame import (
    AngleTrail,
    CalibrationView,
    LiveFrame,
    SegmentCheck,
    SensorHealth,
    Stage,
)
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.server.live import wire

SEGMENTS = ("pelvis", "thigh_l", "shank_l", "foot_l", "thigh_r", "shank_r", "foot_r")
ANGLES = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
NAMES = tuple(f"{angle}_{SUFFIX[side]}" for angle in ANGLES for side in ("left", "right"))
STRIDE_S = 1.12
TARGET, SD = 0.53, 0.03
TAKE = "7" * 32
BANDS = look_up_norms(58, "male", None, 1.76).bands


def angle(name: str, percent: float) -> float:
    """A healthy angle in rad at a share of the cycle."""
    return math.radians(float(np.interp(percent % 100, np.arange(101), BANDS[name].mean_deg)))


def health() -> tuple[SensorHealth, ...]:
    """Seven sensors, of which one loses samples."""
    rows = [
        SensorHealth(f"00B40B{i:02X}", s, 100.0, 0.0, 0.0, 0.0, still=False)  # type: ignore[arg-type]
        for i, s in enumerate(SEGMENTS)
    ]
    return (*rows[:3], replace(rows[3], lost_share=0.03), *rows[4:])


def phases(t: float) -> dict[Side, float | None]:
    """Both legs walking, half a cycle apart."""
    return {"left": 100 * (t / STRIDE_S % 1.0), "right": 100 * ((t / STRIDE_S + 0.5) % 1.0)}


def frame(t: float, stage: Stage = "running", *, stale: bool = False, contact: str = "") -> str:
    """A frame; `contact` = letters of the feet on the floor."""
    phase = phases(t)
    values = np.array(
        [[angle(n[:-2], phases(s)[_side(n)] or 0.0) for n in NAMES] for s in (t - 0.02, t - 0.01, t)]
    )
    checks = tuple(SegmentCheck(s, still=stage == "stand") for s in SEGMENTS)  # type: ignore[arg-type]
    view = LiveFrame(
        t, 0, stage, health(), CalibrationView(2.0, 4.0 if stage == "walk" else 0.0, 5, checks), "erkf",
        contact={"left": "l" in contact, "right": "r" in contact},
        angles=dict(zip(NAMES, values[-1], strict=True)),
    )  # fmt: skip
    trail = AngleTrail(np.array([t - 0.02, t - 0.01, t]), NAMES, values)
    slow = wire.slow_part(view, {"00B40B00": 84.0, "00B40B05": 9.0})
    body = wire.frame(view, [trail], slow, phase)
    return (
        body + b',"delay_ms":%d,"stale":%s}' % (640 if stale else 58, b"true" if stale else b"false")
    ).decode()


def stride(n: int, side: Side, value: float | None, *, speed: float = 1.1) -> str:
    """A counted stride with its step length."""
    start = n * STRIDE_S / 2
    curves = {a: np.array([angle(a, p) for p in range(101)]) for a in ANGLES}
    values = {"step_length_m": value, "gait_speed_mps": speed, "stride_time_s": STRIDE_S}
    notices = LiveStride(
        n, side, start, start + 0.64 * STRIDE_S, start + STRIDE_S, start + STRIDE_S, values, {}, curves,
        0.0, (), counted=True, complete=True,
    )  # fmt: skip
    return json.dumps(wire.stride(notices))


def cue(n: int, value: float, zone: Zone, why_not: WhyNot | None = None, *, level: int = 2) -> str:
    """A cue on the left side, shown unless there is a reason not to."""
    error = (value - TARGET) / SD
    tone = Tone(440.0 + 100.0 * error, 0.5) if zone != "in" and why_not is None else None
    start = n * STRIDE_S / 2
    inputs = Cue(
        n, "left", start, start + STRIDE_S, value, error, zone, why_not is None, why_not,
        level, TARGET - SD, TARGET + SD, tone,
    )  # fmt: skip
    return json.dumps(wire.cue(inputs))


def feedback(**changed: Any) -> str:
    """A training at level 2 with half of the strides fed back."""
    effect = SideEffect(0.0, 0.1, None, beyond=False, reason=None)
    now = FeedbackState(
        on=True, paused=False, stale=False, stopped=None, phase="training", level=2, zone_low=TARGET - SD,
        zone_high=TARGET + SD, strides=80, share_pct=50, next_probe=18, block_left=None, in_zone=0.75,
        window_n=20, with_feedback=Summary(34, 0.531, 0.03, 0.7),
        without_feedback=Summary(40, 0.502, 0.03, 0.5), guard=GuardState(effect, effect),
    )  # fmt: skip
    return json.dumps(wire.feedback(replace(now, **changed)))


def state(name: str = "streaming", tablet: str = "connected", **more: Any) -> str:
    """State message of a trial."""
    return json.dumps(
        {"type": "state", "take": TAKE, "state": name, "tablet": tablet, "source": "dot", "count": 900,
         "elapsed_s": 252, "sensors": [], "marks": [], "ghost": None, "stale": False, "stopping": False,
         "estimate": "ok", "recording": None, "problem": None} | more
    )  # fmt: skip


def _side(name: str) -> Side:
    return "left" if name.endswith("_l") else "right"


@dataclass
class Told:
    """A page whose feed is spoken by the test."""

    page: Page
    routes: list[WebSocketRoute] = field(default_factory=list)
    at_s: float = 100.0
    """When the last frame was that `say_fresh` made."""

    @classmethod
    def of(cls, page: Page) -> Told:
        """Stand between the page and its feed; call before the page is opened."""
        this = cls(page)
        page.route_web_socket("**/live/feed", lambda route: this.routes.append(route))
        return this

    def say(self, *messages: str) -> None:
        """Send messages and let the page draw."""
        for message in messages:
            self.routes[-1].send(message)
        self.page.wait_for_timeout(60)

    def say_fresh(self, *messages: str, stage: Stage = "running", contact: str = "") -> None:
        """Send a new frame and these messages with time stamps that a slow page still accepts as current.

        Pages pause after half a second without messages, or when frames are late; each time stamp lies
        further in the future than any test machine is slow.
        """
        self.at_s += 100.0
        self.say(frame(self.at_s, stage, contact=contact), *messages)

    def walk(self, values: Sequence[float], zones: Sequence[Zone]) -> None:
        """Running trial with these left strides, each followed by a right one."""
        self.say(state(), feedback())
        for i, (value, zone) in enumerate(zip(values, zones, strict=True)):
            self.say(stride(2 * i, "left", value), cue(2 * i, value, zone, None if i % 2 else "faded"))
            self.say(stride(2 * i + 1, "right", 0.57))
        self.say(frame(100.0))
