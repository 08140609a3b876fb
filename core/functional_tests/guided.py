"""A functional test in real time: readiness, start, end and results (docs/science/timed-tests.md, "Guided on
the live page").

The results are those of a file: the same functions measure the samples so far, at fixed samples of the axis.
The result therefore depends only on the samples and not on their division into blocks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from sagittal.core.errors import EstimationError
from sagittal.core.events.bouts import find_bouts
from sagittal.core.events.result import GaitEvent, GaitEvents, Stride, Strides
from sagittal.core.events.turns import Turn, TurnParams
from sagittal.core.frames import FOOT, Protocol, Segment
from sagittal.core.functional_tests.chair import LONGEST_S, measure_chair_rises
from sagittal.core.functional_tests.kept_samples import KeptSamples
from sagittal.core.functional_tests.params import FunctionalTestParams
from sagittal.core.functional_tests.result import FunctionalTest, GuidedTestView, TestPhase, shift_test
from sagittal.core.functional_tests.rising import SIT_TO_STAND
from sagittal.core.functional_tests.sway import STANDING_QUIETLY, measure_sway
from sagittal.core.functional_tests.trunk import TRUNK, follow_trunk
from sagittal.core.functional_tests.tug import measure_tug
from sagittal.core.functional_tests.walks import LENGTH, measure_six_minutes, measure_ten_metres
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.core.parameters.measure import MeasuredGait
from sagittal.core.signals.recording import GivenLimits, Subject, UniformRecording
from sagittal.core.signals.rest import QuietParams, find_rest_windows, measure_quietness
from sagittal.core.timeline.live import UniformBlock

CHAIR_TESTS: Final = ("tug", "five_sit_to_stand")
STANDING_TESTS: Final = ("standing_eyes_open", "standing_eyes_closed")
WALK_TESTS: Final = ("walk_10m", "walk_6min")
GUIDED: Final[tuple[str, ...]] = (*CHAIR_TESTS, *WALK_TESTS, *STANDING_TESTS)
"""Protocols that the live page guides."""

REST: Final = QuietParams()
"""Being quiet is the rest of a file."""


@dataclass(frozen=True)
class LiveTestParams:
    """Phase transitions of a guided test (our choices).

    Parameters
    ----------
    tick_s : interval of state updates. look_s : interval of measurements on the data so far, in whole ticks.
    quiet_s : required rest before the start. standing_s : before a walk, as required for calibration.
    still_s : rest without a rise or a step after which a movement is discarded as not part of the test, and
        rest that ends the ten-metre walk. settle_s : delay between the end of a test and its display.
        final_s : delay until the result is final: the look-back of the detectors. longest_s : timeout of a
        trial without an end.
    kept_s : duration of samples retained before a trial. stand_s : duration of quiet standing to measure.
    """

    tick_s: float = 0.25
    look_s: float = 1.0
    quiet_s: float = 2.0
    standing_s: float = 3.0
    still_s: float = 2.0
    settle_s: float = 1.0
    final_s: float = 3.0
    longest_s: float = 180.0
    kept_s: float = 10.0
    stand_s: float = 30.0
    functional: FunctionalTestParams = field(default_factory=FunctionalTestParams)
    turning: TurnParams = field(default_factory=TurnParams)


class GuidedTest:
    """The current trial of a test.

    Parameters
    ----------
    columns : segments of the block columns. subject : of the recording.

    `push` only stores the samples; `advance` evaluates them, which takes milliseconds once per second.
    """

    def __init__(
        self,
        protocol: Protocol,
        columns: Sequence[Segment],
        rate_hz: float,
        subject: Subject | None = None,
        params: LiveTestParams | None = None,
    ) -> None:
        self.protocol = protocol
        self.params = params or LiveTestParams()
        candidates = tuple(FOOT.values()) if protocol in WALK_TESTS else TRUNK
        watched = tuple(s for s in candidates if s in columns)
        self._watched = watched if protocol in WALK_TESTS else watched[:1]
        self._columns = np.array([columns.index(s) for s in self._watched], np.int64)
        self._rate = rate_hz
        self._subject = subject or Subject()
        self._tick = max(1, round(self.params.tick_s * rate_hz))
        self._ticks_a_look = max(1, round(self.params.look_s / self.params.tick_s))
        k = len(self._watched)
        self._kept = KeptSamples(k)
        self._judged = 0
        self._strides: list[LiveStride] = []
        self._events: list[GaitEvent] = []
        self._asked = protocol not in STANDING_TESTS
        self._limits = GivenLimits()
        self._phase: TestPhase = "get_ready"
        self._moved = 0
        self._from = 0
        self._looked: FunctionalTest | None = None
        self.view = self._show()

    def push(
        self,
        block: UniformBlock,
        strides: Sequence[LiveStride] = (),
        events: Sequence[GaitEvent] = (),
    ) -> None:
        """Store the next samples, with the strides and events of the live chain."""
        self._kept.append(block, self._columns)
        if self.protocol in WALK_TESTS:
            self._strides += strides
            self._events += events

    def go(self) -> None:
        """Start quiet standing as soon as the person stands still; other tests start automatically."""
        self._asked = True
        if self._phase == "get_ready" and self.protocol in STANDING_TESTS:
            self._phase = "ready"
            self.view = self._show()

    def repeat(self) -> None:
        """Discard the trial, and restart with the next sample pushed."""
        self._judged = self._kept.end - self._kept.end % self._tick
        self._asked = self.protocol not in STANDING_TESTS
        self._begin_anew(self._kept.end, None)
        self._strides.clear()
        self._events.clear()

    def correct(self, limits: GivenLimits) -> None:
        """Measure the finished trial between manually given times, s of the axis."""
        self._limits = limits
        if self._phase == "done":
            self._look(self._judged)
            self.view = self._show(final=self.view.final)

    def advance(self) -> GuidedTestView:
        """Evaluate the samples so far."""
        while self._judged + self._tick <= self._kept.end:
            self._judged += self._tick
            self._judge(self._judged)
        return self.view

    def _judge(self, at: int) -> None:
        """Evaluate at one sample of the axis."""
        if not self._watched:
            self.view = self._show("segments_missing")
            return
        problem = self.view.problem
        final = self.view.final
        if self._phase in ("get_ready", "ready"):
            problem = self._wait(at, problem)
        elif self._phase == "running":
            problem = self._run(at)
        elif not final:
            end = self._end()
            final = end is None or at >= (end + self.params.final_s) * self._rate
            if final or self._is_look(at):
                self._look(at)
        self.view = self._show(problem, final=final)

    def _wait(self, sample: int, problem: str | None) -> str | None:
        """Check for rest, and for the start of the test."""
        p, rate = self.params, self._rate
        low = max(self._from, sample - round(p.kept_s * rate))
        self._kept.drop_before(low)
        if self.protocol in STANDING_TESTS:
            if self._asked and self._stands(sample):
                self._start(sample)
                return None
            return problem
        needed = p.standing_s if self.protocol in WALK_TESTS else p.quiet_s
        quiet = self._quiet_s(self._from, sample, needed)
        if self._phase == "ready" and quiet == 0.0:
            self._start(sample - self._tick)
            return None
        if quiet >= needed:
            self._phase = "ready"
        return problem

    def _start(self, sample: int) -> None:
        self._phase, self._moved, self._looked = "running", sample, None

    def _run(self, sample: int) -> str | None:
        """Check for the end of the test."""
        p, rate = self.params, self._rate
        if self.protocol in STANDING_TESTS:
            return self._stand(sample)
        seconds = self._seconds()
        longest = p.longest_s if seconds is None else seconds + p.longest_s
        if sample - self._moved > longest * rate:
            self._begin_anew(sample, "trial_too_long")
            return "trial_too_long"
        if self.protocol in WALK_TESTS:  # its strides tell; the samples only say who is quiet
            self._kept.drop_before(sample - round((LONGEST_S + REST.window_s) * rate))
        if not self._is_look(sample) or self._is_early(sample):
            return None
        self._look(sample)
        test = self._looked
        quiet = self._quiet_s(self._moved, sample, LONGEST_S)
        if test is None or test.start_s is None:
            if quiet >= p.still_s:
                self._begin_anew(self._moved, None)
            return None
        if self._is_over(test, sample, quiet):
            self._phase = "done"
        return None

    def _is_over(self, test: FunctionalTest, sample: int, quiet: float) -> bool:
        """Whether the test has ended, by its definition or after a long rest."""
        p, now = self.params, sample / self._rate
        if self.protocol == "walk_10m":
            return quiet >= p.still_s
        if self.protocol == "walk_6min":
            seconds = self._seconds()
            return (
                test.start_s is not None
                and seconds is not None
                and now >= test.start_s + seconds + p.settle_s
            )
        whole = all(x.mean is not None for x in test.parameters if x.name in _WHOLE[self.protocol])
        settled = test.end_s is not None and now >= test.end_s + p.settle_s
        return (whole and settled) or (bool(_rises(test)) and quiet >= LONGEST_S)

    def _is_early(self, sample: int) -> bool:
        """Whether a timed walk is still running, with nothing to measure yet."""
        seconds, test = self._seconds(), self._looked
        if seconds is None or test is None or test.start_s is None:
            return False
        return sample / self._rate < test.start_s + seconds + self.params.settle_s

    def _stand(self, sample: int) -> str | None:
        """Quiet standing: completed, or interrupted."""
        p, rate = self.params, self._rate
        if not self._stands(sample):
            self._begin_anew(sample, "stepped")
            return "stepped"
        if sample < self._moved + (p.stand_s + p.settle_s) * rate:
            return None
        self._look(sample)
        if self._looked is None or self._looked.end_s is None:
            self._begin_anew(sample, "stepped")
            return "stepped"
        self._phase = "done"
        return None

    def _stands(self, sample: int) -> bool:
        """Whether the person has been in quiet standing over the last seconds."""
        low = max(self._from, sample - round((self.params.quiet_s + 1.0) * self._rate))
        take = self._recording(low, sample)
        windows = find_rest_windows(take, STANDING_QUIETLY, self._watched)
        end = (sample - low) / self._rate
        return any(b > end - 0.5 and b - a >= self.params.quiet_s for a, b in windows)

    def _begin_anew(self, sample: int, problem: str | None) -> None:
        """Return to the waiting phase, with the samples from this one on."""
        requested = self._asked and self.protocol in STANDING_TESTS
        self._phase, self._looked, self._limits = "ready" if requested else "get_ready", None, GivenLimits()
        if problem is not None or sample >= self._kept.end:
            self._from = sample
            self._kept.drop_before(sample)
        self.view = self._show(problem)

    def _look(self, sample: int) -> None:
        """Measure the samples so far, as for a file."""
        try:
            self._looked = self._measure(sample)
        except EstimationError:
            self._looked = None

    def _measure(self, at: int) -> FunctionalTest:
        p, limits = self.params.functional, self._limits
        if self.protocol in WALK_TESTS:
            gait = self._gait(at)
            measure = measure_ten_metres if self.protocol == "walk_10m" else measure_six_minutes
            return measure(gait, limits, p.walks)
        low = max(self._from, self._moved - round(self.params.kept_s * self._rate), self._kept.first)
        take, zero = self._recording(low, at), low / self._rate
        if self.protocol in STANDING_TESTS:
            begin = self._moved / self._rate
            start = begin if limits.start_s is None else limits.start_s
            end = begin + self.params.stand_s if limits.end_s is None else limits.end_s
            sway_test = measure_sway(take, GivenLimits(max(0.0, start - zero), end - zero), p.sway)
            sway_test = replace(sway_test, corrected=limits != GivenLimits())
            return shift_test(sway_test, zero)
        limits_so_far = GivenLimits(
            *(None if t is None else max(0.0, t - zero) for t in (limits.start_s, limits.end_s))
        )
        trunk = follow_trunk(take)
        if self.protocol == "tug":
            return shift_test(measure_tug(trunk, limits_so_far, p.rising, self.params.turning), zero)
        return shift_test(measure_chair_rises(trunk, limits_so_far, p.rising), zero)

    def _gait(self, sample: int) -> MeasuredGait:
        """Gait of the walk so far from the live strides."""
        now, since = sample / self._rate, self._moved / self._rate - 1.0
        latest: dict[int, LiveStride] = {}
        for s in self._strides:
            if s.detected_s <= now and s.start_s >= since:
                latest[s.n] = s
        rows = sorted(latest.values(), key=lambda s: s.end_s)
        events: dict[tuple[str, str, float], GaitEvent] = {}
        for e in self._events:
            if since <= e.time_s <= now:
                key = e.time_s if e.first_s is None else e.first_s
                events[e.side, e.kind, key] = e
        steps = GaitEvents(tuple(sorted(events.values(), key=lambda e: e.time_s)))
        strides = tuple(
            Stride(s.side, s.start_s, s.foot_off_s, s.end_s, turn_rad=s.turn_rad, flags=s.flags) for s in rows
        )
        turns = tuple(Turn(s.start_s, s.end_s, s.turn_rad or 0.0, 0.0) for s in rows if "turn" in s.flags)
        columns: Mapping[str, Any] = {LENGTH: tuple(s.values.get(LENGTH) for s in rows)}
        return MeasuredGait(steps, Strides(strides), (), columns, find_bouts(steps), turns)

    def _recording(self, low: int, sample: int) -> UniformRecording:
        """Samples of the axis as a separate recording."""
        sensors = self._kept.cut(low, sample, self._watched)
        t_s = np.arange(sample - low) / self._rate
        return UniformRecording(t_s, self._rate, sensors, self._subject, self.protocol, {})

    def _quiet_s(self, low: int, sample: int, most_s: float) -> float:
        """How long all monitored sensors have been quiet (core/signals/rest.py), s; limited to the search
        window.
        """
        low = max(low, sample - round((most_s + REST.window_s) * self._rate), self._kept.first)
        quiet = np.ones(sample - low, np.bool_)
        for sensor in self._kept.cut(low, sample, self._watched).values():
            quiet &= measure_quietness(sensor, self._rate, REST).quiet
        moving = np.flatnonzero(~quiet)
        return (len(quiet) if not len(moving) else len(quiet) - 1 - int(moving[-1])) / self._rate

    def _is_look(self, sample: int) -> bool:
        return (sample // self._tick) % self._ticks_a_look == 0

    def _seconds(self) -> float | None:
        if self.protocol in STANDING_TESTS:
            return self.params.stand_s
        return self.params.functional.walks.seconds if self.protocol == "walk_6min" else None

    def _end(self) -> float | None:
        return None if self._looked is None else self._looked.end_s

    def _show(self, problem: str | None = None, *, final: bool = False) -> GuidedTestView:
        test = self._looked
        going = self._phase in ("running", "done")
        start_found_s = test.start_s if test is not None else None
        start = start_found_s if start_found_s is not None else self._moved / self._rate
        return GuidedTestView(
            self.protocol,
            self._phase,
            self._judged / self._rate,
            start_s=start if going else None,
            end_s=None if self._phase != "done" else self._end(),
            rises=_rises(test) if self.protocol == "five_sit_to_stand" and going else None,
            seconds=self._seconds(),
            result=test if self._phase == "done" else None,
            final=final and self._phase == "done",
            problem=problem,
        )


_WHOLE: Final[Mapping[str, tuple[str, ...]]] = {
    "tug": ("tug_duration_s", "tug_turn_s"),
    "five_sit_to_stand": ("five_sit_to_stand_s",),
}
"""Figures without which a test on a chair is not over."""


def _rises(test: FunctionalTest | None) -> int:
    return 0 if test is None else sum(s.name == SIT_TO_STAND for s in test.segments)
