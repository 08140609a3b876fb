"""Result of daily-life monitoring over hours to days (docs/science/activity.md).

All times are seconds from the recording's first sample; `started_at` is the device's own clock there, if its
file has one. Angles are in degrees, trunk inclination is positive forward. Unknown values are None with a
reason.

ActivityResult     the complete result and its inputs
ActivitySpan       an activity with start and end; spans cover the whole time without gaps or overlap
PosturalTransition an accepted rising, sitting down, lying down or getting up
TransitionCandidate a rejected lean of the trunk, with the reason
ActivityBout       walking without a long break: level, up or down stairs, with its steps
ActivityHour       steps and minutes of each kind in one clock hour (or hour of the recording)
ActivityDay        the same for one day, and its wear time
WearPeriod         a period of wear with the sensor's up and forward axes, and how they were estimated
inclination_deg    signed trunk lean once per second, NaN if not worn or forward is unknown

Exported files: server/report/files/activity_files.py.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, get_args

from sagittal.core.errors import Notice
from sagittal.core.events.turns import Turn
from sagittal.core.frames import Floats, Segment

ActivityKind = Literal[
    "lying", "sitting", "standing", "walking", "stairs_up", "stairs_down", "unknown", "non_wear", "gap"
]
"""unknown: worn, but the signals contradict each other or say nothing; gap: nothing was recorded."""

KINDS: Final[tuple[ActivityKind, ...]] = get_args(ActivityKind)

TransitionKind = Literal["sit_to_stand", "stand_to_sit", "sit_to_lie", "lie_to_sit"]
"""SiSt, StSi, SiLy, LySi of the thesis."""

TRANSITIONS: Final[tuple[TransitionKind, ...]] = get_args(TransitionKind)

Evidence = Literal[
    "both_ends", "one_end", "sub_threshold", "steps", "inclination", "contradiction", "too_long_still",
    "nothing_known", "brief_tilt", "no_baseline", "no_movement", "no_samples",
]  # fmt: skip
"""What a span rests on. both_ends, one_end: what begins and what ends it says the same, or one of them says
it; sub_threshold: one of them is a candidate below the limit of the lean; steps: walking; inclination: lying.
The rest say why a span is unknown or not worn: contradiction: its ends say different things; too_long_still:
standing longer without a step than anybody does; nothing_known: neither end says anything; brief_tilt: beyond
the limit of lying, but not still; no_baseline: upright is not known."""

TransitionRefusal = Literal[
    "lean_below_limit", "chest_did_not_rise", "direction_unclear", "near_lying", "while_walking"
]
"""Why a candidate does not count. lean_below_limit: the only thing it lacks is the lean (a slow or careful
person); chest_did_not_rise: a bow; direction_unclear: acceleration and displacement disagree on up or
down."""


@dataclass(frozen=True)
class ActivitySpan:
    """One activity span, half-open [start_s, end_s).

    Parameters
    ----------
    confidence : 1 both ends agree or steps were detected, 0.8 lying, 0.7 evidence from one end only, 0.5 from
    a candidate below the limit; None for unknown, non_wear and gap. A rank, not a probability.
    evidence : evidence for the kind, or the reason why it is unknown.
    """

    start_s: float
    end_s: float
    kind: ActivityKind
    confidence: float | None
    evidence: Evidence

    @property
    def duration_s(self) -> float:
        """Length of the span, s."""
        return self.end_s - self.start_s


@dataclass(frozen=True)
class PosturalTransition:
    """An accepted change of posture.

    Parameters
    ----------
    time_s : time of the largest lean, or for lying of half the inclination. start_s, end_s : of the lean.
    lean_deg : largest inclination from upright. rise_m : vertical displacement of the chest, up positive;
    None for lying.
    consistent : False if the preceding posture cannot be its starting posture.
    """

    kind: TransitionKind
    time_s: float
    start_s: float
    end_s: float
    lean_deg: float
    rise_m: float | None
    consistent: bool = True


@dataclass(frozen=True)
class TransitionCandidate:
    """A rejected lean, kept for manual review.

    Parameters
    ----------
    likely : the transition it most resembles, None if the direction is unclear.
    """

    time_s: float
    start_s: float
    end_s: float
    lean_deg: float
    rise_m: float
    refused: TransitionRefusal
    likely: TransitionKind | None


@dataclass(frozen=True)
class ActivityBout:
    """Walking without a long break.

    Parameters
    ----------
    kind : of the majority of its steps. steps : number of steps. stairs_up_steps, stairs_down_steps : number
    on
        stairs. cadence_spm : steps per minute.
    """

    start_s: float
    end_s: float
    kind: Literal["walking", "stairs_up", "stairs_down"]
    steps: int
    stairs_up_steps: int
    stairs_down_steps: int
    cadence_spm: float

    @property
    def duration_s(self) -> float:
        """From the first to the last step, s."""
        return self.end_s - self.start_s


@dataclass(frozen=True)
class ActivityHour:
    """One hour. minutes : kind → min; they add up to its length. steps : number of steps."""

    start_s: float
    end_s: float
    steps: int
    minutes: Mapping[ActivityKind, float]


@dataclass(frozen=True)
class ActivityDay:
    """One calendar day, or 24 hours from the start if the file has no clock.

    Parameters
    ----------
    date : by the device's clock, None without one. worn_h : time that is neither non_wear nor gap.
    minutes : kind → min. transitions : kind → count. bouts : number of walking bouts.
    """

    date: dt.date | None
    start_s: float
    end_s: float
    worn_h: float
    steps: int
    minutes: Mapping[ActivityKind, float]
    transitions: Mapping[TransitionKind, int]
    bouts: int
    longest_bout_s: float | None


UprightMethod = Literal["walking", "first_rest", "neighbour", "none"]
"""Upright is the trunk's mean while walking; the first 5 s of rest; that of the nearest period; or
unknown."""


@dataclass(frozen=True)
class WearPeriod:
    """Half-open period between donning and doffing the sensor.

    Parameters
    ----------
    up : unit axis of the sensor that points up in an upright person, None = unknown. forward : unit axis that
    points forward, None without suitable leans. method : how up was estimated. leans : number of leans used
    for forward.
    """

    start_s: float
    end_s: float
    up: tuple[float, float, float] | None
    forward: tuple[float, float, float] | None
    method: UprightMethod
    leans: int


@dataclass(frozen=True, eq=False)
class ActivityResult:
    """Complete result of the daily-life monitor.

    Parameters
    ----------
    segment : sensor placement, "chest" or "pelvis". device_id, source : the sensor and its file.
    rate_hz : its nominal rate. has_gyro : the gyroscope was used (required for turns).
    duration_s : from first to last sample. height_m : used for the thigh length.
    steps_s : (n,) time of every step. inclination_deg : (seconds,) mean of every full second, NaN = unknown.
    turns : turns while walking; empty without a gyroscope.
    """

    segment: Segment
    device_id: str
    source: str
    rate_hz: float
    has_gyro: bool
    started_at: dt.datetime | None
    duration_s: float
    height_m: float
    spans: tuple[ActivitySpan, ...]
    transitions: tuple[PosturalTransition, ...]
    candidates: tuple[TransitionCandidate, ...]
    bouts: tuple[ActivityBout, ...]
    steps_s: Floats
    turns: tuple[Turn, ...]
    hours: tuple[ActivityHour, ...]
    days: tuple[ActivityDay, ...]
    periods: tuple[WearPeriod, ...]
    inclination_deg: Floats
    notices: tuple[Notice, ...] = field(default=())

    def minutes(self, kind: ActivityKind) -> float:
        """Minutes of one activity in the whole recording."""
        return sum(s.duration_s for s in self.spans if s.kind == kind) / 60.0

    @property
    def sub_threshold(self) -> tuple[TransitionCandidate, ...]:
        """Candidates rejected only for too small a lean."""
        return tuple(c for c in self.candidates if c.refused == "lean_below_limit")
