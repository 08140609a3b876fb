"""Output of the feedback engine: the cue of a stride, and the state of the training."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Final, Literal, get_args

from sagittal.core.feedback.fields import RecordFields
from sagittal.core.frames import SIDES, Side

Zone = Literal["in", "near_low", "near_high", "low", "high"]
"""in = green; near_* = yellow, one level width beside it; low, high = red."""

WhyNot = Literal[
    "baseline", "retention", "off", "paused", "stale", "stopped", "probe", "faded", "positive_only",
    "bandwidth",
]  # fmt: skip
"""Why a stride has no feedback. baseline, retention: the block a visit begins with; probe: a block without
feedback inside the training; positive_only, bandwidth: strides like this one are not shown."""

Phase = Literal["baseline", "retention", "training", "probe", "stopped"]
Stop = Literal["max_strides", "max_minutes", "gps_rise"]

ZONES: Final[tuple[Zone, ...]] = get_args(Zone)
WHY_NOT: Final[tuple[WhyNot, ...]] = get_args(WhyNot)


@dataclass(frozen=True)
class Tone:
    """A sound with pitch (Hz) and volume (0 to 1) increasing with the error (core/feedback/zones.py)."""

    pitch: float
    level: float


@dataclass(frozen=True)
class Cue:
    """One counted stride of a trained side, whether or not it was shown to the person.

    Parameters
    ----------
    n, side : of the stride; start_s, t_s : its two contacts, on the axis of the recording.
    value : in the unit of the parameter. error_sd : above (+) or below the target, in sd of the target.
    zone, level, zone_low, zone_high : the zone in the unit of the parameter at the level of this stride.
    shown : feedback was given, with a `tone` if the prescription includes sound and the value is outside the
        zone; else `why_not` holds the reason.
    block : number of its probe block, from 1; None outside.
    share_in_zone_last20 : of the training strides at this level, at most the last window (20); None without
        any.
    """

    n: int
    side: Side
    start_s: float
    t_s: float
    value: float
    error_sd: float
    zone: Zone
    shown: bool
    why_not: WhyNot | None
    level: int
    zone_low: float
    zone_high: float
    tone: Tone | None = None
    block: int | None = None
    share_in_zone_last20: float | None = None

    @property
    def with_feedback(self) -> bool:
        """Whether the person received information: if only good, or only bad strides are shown, silence is
        feedback too.
        """
        return self.shown or self.why_not in {"positive_only", "bandwidth"}

    def to_json(self) -> dict[str, object]:
        """Plain values; `from_json` reads them back."""
        return asdict(self)

    @staticmethod
    def from_json(data: Mapping[str, object]) -> Cue:
        """Parse the output of `to_json`; raises ParameterError bad_prescription."""
        f = RecordFields("cue", data)
        tone = None
        if data.get("tone") is not None:
            t = f.part("tone")
            tone = Tone(t.number("pitch", 0.0, 0.0, 1e5), t.number("level", 0.0, 0.0, 1.0))
        return Cue(
            n=f.whole("n", 0, 0, 10**9),
            side=f.choice("side", SIDES),
            start_s=f.number("start_s", 0.0, -1e9, 1e9),
            t_s=f.number("t_s", 0.0, -1e9, 1e9),
            value=f.number("value", 0.0, -1e9, 1e9),
            error_sd=f.number("error_sd", 0.0, -1e12, 1e12),
            zone=f.choice("zone", ZONES),
            shown=f.flag("shown", False),
            why_not=f.choice("why_not", (*WHY_NOT, None), None),
            level=f.whole("level", 0, 0, 10**6),
            zone_low=f.number("zone_low", 0.0, -1e12, 1e12),
            zone_high=f.number("zone_high", 0.0, -1e12, 1e12),
            tone=tone,
            block=f.whole_or_none("block", None, 1, 10**9),
            share_in_zone_last20=f.number_or_none("share_in_zone_last20", None, 0.0, 1.0),
        )


@dataclass(frozen=True)
class Summary:
    """Strides of one kind: number, values, fraction in the zone; None without strides (sd: fewer than
    two).
    """

    n: int = 0
    mean: float | None = None
    sd: float | None = None
    in_zone: float | None = None


@dataclass(frozen=True)
class SideEffect:
    """Change of another quantity since the start of the recording, or the reason why it is unknown.

    Parameters
    ----------
    change : last strides minus the first ones. limit, source : limit of the change. beyond : limit exceeded.
    reason : "too_few_strides", "joint_missing", "both_sides_trained", "no_limit"; None.
    """

    change: float | None = None
    limit: float | None = None
    source: str | None = None
    beyond: bool = False
    reason: str | None = "too_few_strides"


@dataclass(frozen=True)
class GuardState:
    """Side effects on the other side and on the sagittal profile."""

    other: SideEffect = field(default_factory=SideEffect)
    gps: SideEffect = field(default_factory=SideEffect)

    @property
    def state(self) -> Literal["ok", "watch", "unknown"]:
        """watch: a side effect exceeds its limit; unknown: none can be judged yet."""
        if self.other.beyond or self.gps.beyond:
            return "watch"
        judged_effects = [e for e in (self.other, self.gps) if e.reason is None]
        return "ok" if judged_effects else "unknown"


@dataclass(frozen=True)
class FeedbackState:
    """State of the training after the last stride.

    Parameters
    ----------
    strides : counted ones of the trained side. share_pct : current percentage of training strides with
        feedback.
    next_probe : training strides until the next probe block. block_left : remaining strides of the current
        block without feedback; None without one. window_n : number of strides in `in_zone`.
    with_feedback, without_feedback : of the training, blocks included; strides with feedback switched off
        count as without.
    """

    on: bool
    paused: bool
    stale: bool
    stopped: Stop | None
    phase: Phase
    level: int
    zone_low: float
    zone_high: float
    strides: int
    share_pct: int
    next_probe: int | None
    block_left: int | None
    in_zone: float | None
    window_n: int
    with_feedback: Summary
    without_feedback: Summary
    guard: GuardState

    def to_json(self) -> dict[str, object]:
        """The same as plain values for JSON."""
        data = asdict(self)
        data["guard"]["state"] = self.guard.state
        return data
