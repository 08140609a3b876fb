"""Prescription of the training: one parameter, its target, feedback schedule, difficulty, stop rules.

One parameter at a time (Schließmann et al. 2018; docs/science/feedback.md); target, mode, schedule and dose
are fields of the prescription because reviews find that studies differ in them (Spencer et al. 2021).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import isfinite
from typing import Final, Literal, get_args

from sagittal.core.errors import ParameterError
from sagittal.core.feedback.fields import RecordFields
from sagittal.core.frames import SIDES, Side
from sagittal.core.parameters.catalogue import list_trainable

TargetSource = Literal["norm", "own_better_side", "own_baseline", "manual"]
Mode = Literal["bar", "zone", "tone", "tick"]
ScheduleKind = Literal["every", "fading"]
Towards = Literal["low", "high"]

SOURCES: Final[tuple[TargetSource, ...]] = get_args(TargetSource)
MODES: Final[tuple[Mode, ...]] = get_args(Mode)
KINDS: Final[tuple[ScheduleKind, ...]] = get_args(ScheduleKind)

LEVELS: Final = 20
"""Easiest level there is. Our choice: nobody starts further off, and a rule must end somewhere."""


@dataclass(frozen=True)
class Target:
    """Target value.

    Parameters
    ----------
    source : norm = healthy people at this person's speed; own_better_side, own_baseline = the person's other
        side, if that is the better one, or the same side in an earlier session; manual = entered.
    mean, sd : in the unit of the parameter; None until resolved in a recording. A level has the width `sd`.
    words : printed description of their source. session_id : session they are taken from.
    """

    source: TargetSource = "norm"
    mean: float | None = None
    sd: float | None = None
    words: str = ""
    session_id: str | None = None

    @property
    def resolved(self) -> bool:
        """Whether mean and sd are known."""
        return self.mean is not None and self.sd is not None


@dataclass(frozen=True)
class Schedule:
    """Selection of strides with feedback.

    Parameters
    ----------
    kind : every stride, or fading: the percentage decreases step by step.
    shares_pct, strides_per_share : the steps and the number of training strides in each; the last one is
        permanent. Percentages and length are our choice.
    probe_every, probe_strides : number of training strides before a probe block, and of strides without
        feedback in it; None = no probes. Errors return immediately without feedback (Roemmich et al. 2016):
        only probes show learning.
    retention_strides : strides without feedback at the start of a visit that follows a training of the same
        parameter.
    """

    kind: ScheduleKind = "fading"
    shares_pct: tuple[int, ...] = (100, 50, 0)
    strides_per_share: int = 60
    probe_every: int | None = 40
    probe_strides: int = 10
    retention_strides: int = 20


@dataclass(frozen=True)
class Progression:
    """Difficulty and its changes (Schließmann et al. 2018).

    Parameters
    ----------
    automatic : levels follow the rule; otherwise only the therapist changes them.
    window : number of strides at one level for a decision. share : fraction of them in the zone above which
        it becomes harder.
    away_share : fraction of them outside the yellow zone on the worse side above which it becomes easier; the
        source states "too many", half is our choice.
    sd_per_level : width of a level in sd of the target. start_level : None = from the baseline.
    worse : side of the target the person is on; None = from the baseline.
    """

    automatic: bool = True
    window: int = 20
    share: float = 0.7
    away_share: float = 0.5
    sd_per_level: float = 1.0
    start_level: int | None = None
    worse: Towards | None = None


@dataclass(frozen=True)
class StopRule:
    """Automatic end of feedback.

    Parameters
    ----------
    max_strides : counted strides of the recording. max_minutes : since its first stride; 15 is the dose of a
        visit in Schließmann et al. 2018, 5 × 2 to 3 minutes. gps_rise_deg : rise of `gps_sagittal` since the
        start.
    """

    max_strides: int | None = None
    max_minutes: float | None = 15.0
    gps_rise_deg: float | None = 3.2


@dataclass(frozen=True)
class SideEffectGuard:
    """Monitored side effects of the training (Legrand et al. 2025: feedback on stance time reduced the GDI by
    7.9 points).

    Parameters
    ----------
    other_change : of the same parameter on the other side; None = its MDC, if published, else two sd of the
        first strides. gps_rise_deg : of `gps_sagittal`; 1.6° is the MCID of the GPS (Baker et al. 2012,
        children), twice that stops the training.
    """

    other_change: float | None = None
    gps_rise_deg: float | None = 1.6


@dataclass(frozen=True)
class Prescription:
    """Feedback on one parameter of one side.

    Parameters
    ----------
    side : None = strides of both. band_sd : half width of the zone at level 0, in sd of the target.
    modes : presentation. positive_only : only strides in the zone get a cue (Heel2Toe); bandwidth : only
        those outside. Not both.
    """

    parameter: str
    side: Side | None
    target: Target
    band_sd: float = 1.0
    modes: tuple[Mode, ...] = ("bar",)
    positive_only: bool = False
    bandwidth: bool = False
    schedule: Schedule = field(default_factory=Schedule)
    progression: Progression = field(default_factory=Progression)
    stop_rule: StopRule = field(default_factory=StopRule)
    guard: SideEffectGuard = field(default_factory=SideEffectGuard)

    def to_json(self) -> dict[str, object]:
        """Plain values; `from_json` reads them back."""
        return asdict(self)

    @staticmethod
    def from_json(data: Mapping[str, object]) -> Prescription:
        """Parse and validate a record; absent fields have defaults.

        Raises
        ------
        ParameterError bad_prescription: the message states the field, the expected and the actual value.
        """
        return _prescription(data)


def _prescription(data: Mapping[str, object]) -> Prescription:
    f = RecordFields("prescription", data)
    target = _target(f.part("target"))
    parameter = f.choice("parameter", list_trainable())
    side = f.choice("side", (*SIDES, None), None)
    modes = tuple(dict.fromkeys(f.choices("modes", MODES, ("bar",))))
    prescription = Prescription(
        parameter,
        side,
        target,
        f.number("band_sd", 1.0, 0.1, 5.0),
        modes,
        f.flag("positive_only", False),
        f.flag("bandwidth", False),
        _schedule(f.part("schedule")),
        _progression(f.part("progression")),
        _stop_rule(f.part("stop_rule")),
        _guard(f.part("guard")),
    )
    f.refuse_unknown()
    if prescription.positive_only and prescription.bandwidth:
        raise _refused(
            "positive_only and bandwidth are both on, and leave no stride to show. Expected at most one."
        )
    if side is None and target.source == "own_better_side":
        raise _refused(
            "target.source is own_better_side while both sides are trained. Expected side left or right, or "
            "another source."
        )
    return prescription


def _target(f: RecordFields) -> Target:
    source = f.choice("source", SOURCES, "norm")
    mean, sd = f.number_or_none("mean", None), f.number_or_none("sd", None)
    target = Target(source, mean, sd, f.text("words", "") or "", f.text("session_id", None))
    f.refuse_unknown()
    if (mean is None) != (sd is None) or (source == "manual" and mean is None):
        raise _refused(f"target.mean is {mean} and target.sd {sd}. Expected both numbers, or neither.")
    if sd is not None and not (isfinite(sd) and sd > 0.0):
        raise _refused(f"target.sd is {sd:g}. Expected more than 0: it is the width of a level.")
    return target


def _schedule(f: RecordFields) -> Schedule:
    d = Schedule()
    schedule = Schedule(
        f.choice("kind", KINDS, d.kind),
        f.percents("shares_pct", d.shares_pct),
        f.whole("strides_per_share", d.strides_per_share, 1, 10_000),
        f.whole_or_none("probe_every", d.probe_every, 1, 10_000),
        f.whole("probe_strides", d.probe_strides, 1, 1000),
        f.whole("retention_strides", d.retention_strides, 0, 1000),
    )
    f.refuse_unknown()
    if list(schedule.shares_pct) != sorted(schedule.shares_pct, reverse=True):
        raise _refused(
            f"schedule.shares_pct is {list(schedule.shares_pct)}. Expected no share above the one before."
        )
    return schedule


def _progression(f: RecordFields) -> Progression:
    d = Progression()
    progression = Progression(
        f.flag("automatic", d.automatic),
        f.whole("window", d.window, 5, 200),
        f.number("share", d.share, 0.05, 0.99),
        f.number("away_share", d.away_share, 0.05, 0.99),
        f.number("sd_per_level", d.sd_per_level, 0.05, 5.0),
        f.whole_or_none("start_level", None, 0, LEVELS),
        f.choice("worse", ("low", "high", None), None),
    )
    f.refuse_unknown()
    if progression.share + progression.away_share < 1.0:
        raise _refused(
            f"progression.share is {progression.share:g} and away_share "
            f"{progression.away_share:g}: the same strides "
            "could ask for harder and easier. Expected a sum of at least 1."
        )
    return progression


def _stop_rule(f: RecordFields) -> StopRule:
    d = StopRule()
    rule = StopRule(
        f.whole_or_none("max_strides", d.max_strides, 1, 100_000),
        f.number_or_none("max_minutes", d.max_minutes, 0.5, 240.0),
        f.number_or_none("gps_rise_deg", d.gps_rise_deg, 0.1, 60.0),
    )
    f.refuse_unknown()
    return rule


def _guard(f: RecordFields) -> SideEffectGuard:
    d = SideEffectGuard()
    guard = SideEffectGuard(
        f.number_or_none("other_change", d.other_change, 0.0),
        f.number_or_none("gps_rise_deg", d.gps_rise_deg, 0.1, 60.0),
    )
    f.refuse_unknown()
    return guard


def _refused(message: str) -> ParameterError:
    return ParameterError("bad_prescription", message)
