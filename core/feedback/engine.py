"""Strides in, cues out: zone and level, schedule, rules for level changes and stopping, guard.

A pure function of the sequence of strides and commands: no clock, no randomness. After a crash the state is
restored by replaying both, and the displayed cues can be derived from the record alone.
"""

from __future__ import annotations

from collections import deque
from typing import Final, Literal, cast, get_args

from sagittal.core.errors import ParameterError
from sagittal.core.feedback.baseline import Baseline
from sagittal.core.feedback.cue import Cue, FeedbackState, Phase, Stop, WhyNot, Zone
from sagittal.core.feedback.guard import GuardWatch
from sagittal.core.feedback.levels import Ladder
from sagittal.core.feedback.prescription import Prescription
from sagittal.core.feedback.schedule import ScheduleSlot, find_slot
from sagittal.core.feedback.stride import StrideLike
from sagittal.core.feedback.tally import RunningStatistics
from sagittal.core.feedback.zones import make_zones
from sagittal.core.message import Message

OPENING: Final = 10
"""Strides without feedback that give the start level where no earlier session does (our choice)."""

LATE_S: Final = 0.5
"""A stride told later than this after its last sample is too old to be shown: nobody is told of the past
(docs/science/feedback.md, "Which strides get a cue"); so the strides that calibration walked through give no
late burst of cues."""

REMEMBERED: Final = 200
"""A stride is told at most twice, within few others: `n` this far back will not come again."""

Command = Literal["feedback", "level", "pause", "stale"]
COMMANDS: Final[tuple[Command, ...]] = get_args(Command)


class FeedbackEngine:
    """Feedback for one recording.

    Raises
    ------
    ParameterError no_target: the target of the prescription is not resolved.
    """

    def __init__(self, prescription: Prescription, baseline: Baseline | None = None) -> None:
        zones = make_zones(prescription, prescription.progression.worse)
        if zones is None:
            raise ParameterError(
                "no_target",
                "The target of the prescription has no mean and SD. Expected both: from the norm, from an "
                "earlier session, or entered.",
            )
        self.prescription = prescription
        self._baseline = baseline or Baseline()
        self._guard = GuardWatch(prescription, self._baseline)
        self._ladder = Ladder(zones, prescription.progression, self._baseline)
        has_retention = self._baseline.after_training
        self._opening: Literal["retention", "baseline"] = "retention" if has_retention else "baseline"
        block = prescription.schedule.retention_strides if has_retention else 0
        self._opening_left = block if self._ladder.known else max(block, OPENING)
        self._opened: list[float] = []
        self._on, self._paused, self._stale = True, False, False
        self._stopped: Stop | None = None
        self._waived: set[Stop] = set()
        self._first_s: float | None = None
        self._strides = 0
        self._position = 0
        self._with, self._without = RunningStatistics(), RunningStatistics()
        self._told: deque[int] = deque(maxlen=REMEMBERED)

    def push(self, stride: StrideLike, now_s: float | None = None) -> Cue | None:
        """Evaluate a stride.

        Parameters
        ----------
        now_s : last sample when the stride became known; None = not late.

        Returns
        -------
        None for a stride that is not counted, has no value (yet), or belongs to the other side.
        """
        value = stride.values.get(self.prescription.parameter)
        if not stride.counted or value is None or stride.n in self._told:
            return None
        self._told.append(stride.n)
        if self._first_s is None:
            self._first_s = stride.start_s
        self._guard.add_stride(stride.side, value, stride.curves)
        if self.prescription.side not in (None, stride.side):
            return None
        late = now_s is not None and now_s - stride.detected_s > LATE_S
        cue = self._judge(stride, value, late)
        self._count(cue, value)
        self._check_stop(stride.end_s)
        return cue

    def command(self, name: Command, value: bool | int = True) -> None:
        """Execute a command of the user or the data source.

        Parameters
        ----------
        name : feedback = on or off, on also overrides a stop rule; level = steps easier (+) or harder (−);
            pause and stale = begin or end.

        Raises
        ------
        ParameterError unknown_command; bad_value: a non-integer step, or a switch value other than on or off.
        """
        if name not in COMMANDS:
            raise ParameterError(
                "unknown_command",
                Message(
                    "There is no command '{name}'. Expected one of {COMMANDS}.",
                    name=name,
                    COMMANDS=", ".join(COMMANDS),
                ),
            )
        if isinstance(value, bool) == (name == "level") or not isinstance(value, int):
            expected = "a whole number of levels" if name == "level" else "true or false"
            raise ParameterError(
                "bad_value",
                Message(
                    "The value of {name} is {value}. Expected {expected}.",
                    name=name,
                    value=repr(value),
                    expected=expected,
                ),
            )
        if name == "level":
            self._ladder.move(value)
        elif name == "pause":
            self._paused = bool(value)
        elif name == "stale":
            self._stale = bool(value)
        else:
            self._on = bool(value)
            if value and self._stopped is not None:
                self._waived.add(self._stopped)
                self._stopped = None

    @property
    def state(self) -> FeedbackState:
        """State of the training."""
        slot = self._place()
        training = self._opening_left == 0 and self._stopped is None
        low, high = self._ladder.limits
        return FeedbackState(
            on=self._on,
            paused=self._paused,
            stale=self._stale,
            stopped=self._stopped,
            phase=self._phase(slot),
            level=self._ladder.level,
            zone_low=low,
            zone_high=high,
            strides=self._strides,
            share_pct=slot.share_pct if training else 0,
            next_probe=slot.next_probe if training else None,
            block_left=self._opening_left or (slot.block_left if training else None),
            in_zone=self._ladder.share("in"),
            window_n=self._ladder.window_n,
            with_feedback=self._with.summary,
            without_feedback=self._without.summary,
            guard=self._guard.state,
        )

    def _phase(self, slot: ScheduleSlot) -> Phase:
        if self._opening_left:
            return self._opening
        if self._stopped is not None:
            return "stopped"
        return "probe" if slot.block is not None else "training"

    def _place(self) -> ScheduleSlot:
        return find_slot(self.prescription.schedule, self._position)

    def _judge(self, stride: StrideLike, value: float, late: bool) -> Cue:
        zone = self._ladder.zone(value)
        slot = self._place()
        reason = self._why_not(slot, zone, late)
        running = self._running(reason)
        if running and slot.block is None:
            self._ladder.add_stride(zone)
        low, high = self._ladder.limits
        is_shown = reason is None
        sound = is_shown and "tone" in self.prescription.modes
        return Cue(
            n=stride.n,
            side=stride.side,
            start_s=stride.start_s,
            t_s=stride.end_s,
            value=value,
            error_sd=self._ladder.zones.error_sd(value),
            zone=zone,
            shown=is_shown,
            why_not=reason,
            level=self._ladder.level,
            zone_low=low,
            zone_high=high,
            tone=self._ladder.zones.tone(value, self._ladder.level) if sound else None,
            block=slot.block if running else None,
            share_in_zone_last20=self._ladder.share("in"),
        )

    def _why_not(self, slot: ScheduleSlot, zone: Zone, late: bool) -> WhyNot | None:
        """The first applicable reason not to show this stride."""
        p = self.prescription
        reasons: tuple[tuple[bool, WhyNot], ...] = (
            (self._opening_left > 0, self._opening),
            (not self._on, "off"),
            (self._paused, "paused"),
            (self._stale or late, "stale"),
            (self._stopped is not None, "stopped"),
            (slot.block is not None, "probe"),
            (not slot.shown, "faded"),
            (p.positive_only and zone != "in", "positive_only"),
            (p.bandwidth and zone == "in", "bandwidth"),
        )
        return next((reason for holds, reason in reasons if holds), None)

    def _running(self, reason: WhyNot | None) -> bool:
        """Whether schedule and level rule advance with this stride."""
        return reason in {None, "probe", "faded", "positive_only", "bandwidth"}

    def _count(self, cue: Cue, value: float) -> None:
        """Advance by one stride."""
        self._strides += 1
        if self._opening_left:
            self._opened.append(value)
            self._opening_left -= 1
            if not self._opening_left:
                self._ladder.end_first_strides(self._opened)
            return
        (self._with if cue.with_feedback else self._without).add(value, cue.zone == "in")
        if self._running(cue.why_not):
            self._position += 1
            if cue.block is None:
                self._ladder.follow_rule()

    def _check_stop(self, now_s: float) -> None:
        rule, rise = self.prescription.stop_rule, self._guard.state.gps.change
        minutes = 0.0 if self._first_s is None else (now_s - self._first_s) / 60.0
        passed = {
            "max_strides": rule.max_strides is not None and self._strides >= rule.max_strides,
            "max_minutes": rule.max_minutes is not None and minutes >= rule.max_minutes,
            "gps_rise": rule.gps_rise_deg is not None and rise is not None and rise > rule.gps_rise_deg,
        }
        for name, holds in passed.items():
            if holds and self._stopped is None and name not in self._waived:
                self._stopped = cast("Stop", name)
