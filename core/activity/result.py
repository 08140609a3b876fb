"""What the monitor of daily life says about a recording of hours to days (docs/science/activity.md).

All times are seconds from the recording's first sample; `started_at` is the device's own clock there, where
its file has one. Angles are degrees, trunk inclination is positive forward. What is not known is None and
has its reason.

ActivityResult     everything below, and what it was made from
ActivitySpan       the day from end to end: what the person did from when to when; spans touch, none overlap
PosturalTransition rising, sitting down, lying down, getting up: those that count
TransitionCandidate a lean of the trunk that was looked at and does not count, with why
ActivityBout       walking without a long break: level, up or down stairs, with its steps
ActivityHour       steps and minutes of each kind in one hour of the clock (or of the recording)
ActivityDay        the same in one day, and how much of it can be judged
WearPeriod         how the sensor sat while it was worn: its up and forward axes, and how they were found
inclination_deg    once a second: signed lean of the trunk, NaN where it was not worn or forward is unknown

The files they become: server/report/files/activity_files.py.
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
    """One stretch of the day, half-open [start_s, end_s).

    Parameters
    ----------
    confidence : 1 both ends agree or steps were seen, 0.8 lying, 0.7 one end says so, 0.5 by a candidate
        below the limit; None where the kind is unknown, non_wear or gap. An order, not a probability.
    evidence : what it rests on, or why nothing is known.
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
    """A change of posture that counts.

    Parameters
    ----------
    time_s : largest lean, or for lying when the trunk is half way. start_s, end_s : of the
        lean.
    lean_deg : its largest inclination from upright. rise_m : of the chest, positive up; None for lying.
    consistent : False where the posture before it cannot be the one that it starts from.
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
    """A lean that does not count; a person may look at it.

    Parameters
    ----------
    likely : what it would have been, None where the direction is not clear.
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
    kind : of most of its steps. steps : counted. stairs_up_steps, stairs_down_steps : those of its parts on
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
    """One hour. minutes : kind → min; they add up to its length. steps : counted."""

    start_s: float
    end_s: float
    steps: int
    minutes: Mapping[ActivityKind, float]


@dataclass(frozen=True)
class ActivityDay:
    """One day of the clock, or 24 hours from the start where the file has no clock.

    Parameters
    ----------
    date : of the device's clock, None without one. worn_h : neither non_wear nor gap.
    minutes : kind → min. transitions : kind → number. bouts : number of walking bouts.
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
    """From putting on to taking off, half-open.

    Parameters
    ----------
    up : unit axis of the sensor that points up in an upright person, None = not known. forward : that points
        forward, None where no lean showed it. method : how up was found. leans : how many leans showed
        forward.
    """

    start_s: float
    end_s: float
    up: tuple[float, float, float] | None
    forward: tuple[float, float, float] | None
    method: UprightMethod
    leans: int


@dataclass(frozen=True, eq=False)
class ActivityResult:
    """Everything the monitor found.

    Parameters
    ----------
    segment : where the sensor was worn, "chest" or "pelvis". device_id, source : which sensor, of which file.
    rate_hz : its nominal rate. has_gyro : its gyroscope was used (turns need it).
    duration_s : from first to last sample. height_m : taken for the thigh length.
    steps_s : (n,) time of every step. inclination_deg : (seconds,) mean of every whole second, NaN = not
        known.
    turns : while walking; empty without a gyroscope.
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
        """Minutes of one kind in the whole recording."""
        return sum(s.duration_s for s in self.spans if s.kind == kind) / 60.0

    @property
    def sub_threshold(self) -> tuple[TransitionCandidate, ...]:
        """Candidates that lack nothing but the lean."""
        return tuple(c for c in self.candidates if c.refused == "lean_below_limit")
