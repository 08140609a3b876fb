"""Calibration in real time: stand, walk, and the offline calibration as soon as there are enough samples.

Evaluated at fixed samples of the axis, every half second, so that the result depends on the samples and not
on their division into blocks. Standing and walking are distinguished by the offline rules
(core/signals/rest.py, core/calibration/walking.py); the offline calibration itself decides whether the walk
was sufficient.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import radians
from typing import Final

import numpy as np

from sagittal.core.calibration import calibrate
from sagittal.core.calibration.calibrate import FEW_STEPS
from sagittal.core.calibration.functional import FUNCTIONAL, find_functional_movements
from sagittal.core.calibration.live_attempt import CalibrationSamples, WornSensors
from sagittal.core.calibration.live_standing import (
    StandingNow,
    cut_last_part,
    find_upward_axes,
    judge_standing,
)
from sagittal.core.calibration.walking import moving_mask
from sagittal.core.errors import Notice, SagittalError, SignalError
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.online.calibrated import LiveCalibration, MountingParams, finish_calibration
from sagittal.core.online.frame import CalibrationView, SegmentCheck, Stage
from sagittal.core.plurals import plural
from sagittal.core.signals.calibrated import Calibration
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.timeline.live import UniformBlock


@dataclass(frozen=True)
class CalibratingParams:
    """Transitions between the stages.

    Parameters
    ----------
    tick_s : evaluation interval.
    wait_s : after this time the attempt continues without a sensor that sends no data (our choice).
    stand_s : required standing time (in the clinic 3 to 5 s: docs/science/calibration.md, "Recipe").
        looked_s : duration of the last samples searched; quietness is relative to the quietest second in
        them.
    steps, walk_s : sufficient number of straight steps, or alternatively walking time, for small rooms, with
        at least `least_steps` of them: attaching sensors is no walk.
    moved : largest rotation of a sensor relative to the vertical between two standing periods; a larger one
        means that it was moved on the body or attached in between. Standing is reproducible within 10° (our
        choice).
    first_look_s : walking time before the first calibration attempt: two strides. kept_s : samples retained
        without walking: a standing period and its beginning. longest_s : timeout after which an attempt
        restarts (our choice).
    """

    mounting: MountingParams = field(default_factory=MountingParams)
    tick_s: float = 0.5
    wait_s: float = 10.0
    stand_s: float = 3.0
    looked_s: float = 10.0
    steps: int = FEW_STEPS
    walk_s: float = 12.0
    least_steps: int = 4
    moved: float = radians(20.0)
    first_look_s: float = 2.5
    kept_s: float = 15.0
    longest_s: float = 120.0


NOT_LOOKED: Final = CalibrationView(0.0, 0.0, 0, ())


class LiveCalibrator:
    """State machine of the live calibration.

    Parameters
    ----------
    wearer : segments in the order of the block columns, rate, subject, protocol, placement.
    """

    def __init__(self, wearer: WornSensors, params: CalibratingParams | None = None) -> None:
        self.wearer = wearer
        self.params = params or CalibratingParams()
        self.stage: Stage = "waiting"
        self.view = NOT_LOOKED
        self._tick = max(1, round(self.params.tick_s * wearer.rate_hz))
        self._length = 0
        self._begun = 0
        self._attempt = CalibrationSamples(wearer, 0)
        self._working: tuple[Segment, ...] = ()
        self._out: frozenset[Segment] = frozenset()
        self._walked = 0.0
        self._up: Mapping[Segment, Floats] = {}
        self._standings: list[int] = []
        self._functional = self._ongoing = False

    def drain_standings(self) -> tuple[int, ...]:
        """Samples of the axis at the end of standing periods that began an attempt, since the last call."""
        ends, self._standings = tuple(self._standings), []
        return ends

    def push(self, block: UniformBlock) -> LiveCalibration | None:
        """Process the next samples; returns the calibration, once, when it is complete.

        Samples of the block from the calibration's `past` on are not included. Blocks may be omitted while it
        runs; a new attempt begins with the next one pushed.
        """
        if block.first != self._length:
            self._length = self._begun = block.first
            self._attempt = CalibrationSamples(self.wearer, block.first)
        start, calibration = 0, None
        while start < len(block):
            stop = min(len(block), start + self._tick - self._length % self._tick)
            self._length += stop - start
            if self.stage != "running":
                self._attempt.append(block, start, stop)
                if self._length % self._tick == 0:
                    if block.out is not None:
                        self._leave_out(block.out[stop - 1])
                    calibration = self._judge()
                if calibration is not None:
                    self._length += len(block) - stop
                    return calibration
            start = stop
        return None

    def _leave_out(self, out: Bools) -> None:
        """Continue without sensors (n,) found not to measure."""
        self._out = frozenset(s for s, x in zip(self.wearer.segments, out, strict=True) if x)
        self._working = tuple(s for s in self._working if s not in self._out)
        if self.stage == "walk" and not self._working:
            self._restart(None)

    def redo(self) -> None:
        """Restart with the next sample pushed."""
        self._restart(None)
        self.view = NOT_LOOKED

    def _restart(self, problem: Notice | None) -> None:
        self.stage = "waiting"
        self._begun = self._length
        self._attempt = CalibrationSamples(self.wearer, self._length)
        if problem is not None:
            self.stage = "stand"
            self.view = replace(self.view, ok=False, problem=problem)

    def _judge(self) -> LiveCalibration | None:
        if self.stage in ("waiting", "stand"):
            self._look_for_standing()
            return None
        return self._look_for_walk()

    def _look_for_standing(self) -> None:
        """Waiting or standing: check for data of every sensor, and for how long all have been still."""
        p, rate = self.params, self.wearer.rate_hz
        self._attempt.keep_last(round(p.looked_s * rate))
        available = self._there()
        complete = len(available) == len(self.wearer.segments) - len(self._out)
        patient = self._length - self._begun >= p.wait_s * rate
        self.stage = "stand" if available and (complete or patient) else "waiting"
        recording = self._attempt.recording(available)
        standing = judge_standing(recording, p.mounting.calibration.rest)
        self.view = replace(
            self.view, stood_s=standing.stood_s, walked_s=0.0, steps=0, checks=self._checks(standing)
        )
        if self.stage == "stand" and standing.stood_s >= p.stand_s:
            self.stage, self._working = "walk", available
            self.view = replace(self.view, ok=None, problem=None)
            self._stand(recording, standing)

    def _stand(self, recording: UniformRecording, standing: StandingNow) -> None:
        """Start an attempt with this standing period; earlier samples, walking in particular, are
        discarded.
        """
        self._attempt.keep_last(round(standing.stood_s * self.wearer.rate_hz))
        self._up, self._walked = find_upward_axes(recording), 0.0
        self._standings.append(self._length)
        self.view = replace(self.view, walked_s=0.0, steps=0)

    def _there(self) -> tuple[Segment, ...]:
        """Segments with sensor data for most of the last second."""
        share = self._attempt.valid(round(self.wearer.rate_hz)).mean(axis=0)
        with_data = (s for s, x in zip(self.wearer.segments, share, strict=True) if x > 0.5)
        return tuple(s for s in with_data if s not in self._out)

    def _look_for_walk(self) -> LiveCalibration | None:
        """Walking: check whether enough has been walked since standing."""
        p, rate = self.params, self.wearer.rate_hz
        recording = self._attempt.recording(self._working)
        standing = judge_standing(cut_last_part(recording, p.kept_s), p.mounting.calibration.rest)
        calibration = p.mounting.calibration
        done = find_functional_movements(recording, calibration.functional).anywhere
        self._functional = bool(done.any())
        ongoing, before_ongoing = bool(done[-1:].any()), self._ongoing
        self._ongoing = ongoing
        moving = moving_mask(recording, calibration.walking) | done
        walked = float(np.count_nonzero(moving) / rate)
        stood = self.view.stood_s if walked and not standing.stood_s else standing.stood_s
        self._walked, previous = walked, self._walked
        self.view = replace(self.view, stood_s=stood, walked_s=walked, checks=self._checks(standing))
        if walked and standing.stood_s >= p.stand_s and (moved := self._moved(recording)):
            message = Message(
                "{moved}: the sensor has moved since the last quiet standing. The walk so far is discarded; "
                "this quiet standing is used.",
                moved=", ".join(moved),
            )
            self._stand(recording, standing)
            self.view = replace(self.view, problem=Notice("sensor_moved", message, moved[0]))
            return None
        if not walked:
            self._attempt.keep_last(round(p.kept_s * rate))
            if standing.longest_s < p.stand_s:
                self.stage = "stand"
            return None
        # swings and bows are looked at when they end
        look = not ongoing and (walked > previous or before_ongoing)
        completed = self._calibration(recording) if walked >= p.first_look_s and look else None
        if completed is None and self.stage == "walk" and len(self._attempt) >= p.longest_s * rate:
            message = Message(
                "Only {walked:.0f} s of walking in {longest_s:.0f} s; {walk_s:.0f} s or {steps} straight "
                "steps are needed. Stand still again, then walk straight ahead.",
                walked=walked,
                longest_s=p.longest_s,
                walk_s=p.walk_s,
                steps=p.steps,
            )
            self._restart(Notice("walk_too_short", message))
        return completed

    def _moved(self, recording: UniformRecording) -> list[Segment]:
        """Segments whose sensor has rotated relative to the vertical since the standing that began the
        attempt.
        """
        now = find_upward_axes(recording)
        limit = np.cos(self.params.moved)
        return [s for s, x in self._up.items() if s in now and float(x @ now[s]) < limit]

    def _calibration(self, recording: UniformRecording) -> LiveCalibration | None:
        """The calibration if possible and sufficiently supported; a walk without result restarts the
        attempt.
        """
        p = self.params
        # who swings a leg or bows has the other leg and the trunk still to come
        late = self.view.walked_s >= p.walk_s and not self._functional
        try:
            calibrated = calibrate(recording, p.mounting.calibration)
            details = calibrated.calibration
            steps = details.straight_steps or 0
            self.view = replace(self.view, steps=steps)
            if details.posture != "standing":
                raise SignalError(
                    "not_still",
                    "A sensor moved slowly or one foot was in front during quiet standing. Stand still "
                    "for 3 s with both feet side by side, then walk straight ahead.",
                )
            least = p.least_steps if late else p.steps
            if details.straight_steps is None and late:
                least = 0  # a trunk sensor shows none
            if all(x.method in FUNCTIONAL for x in details.segments.values()):
                least = 0 if all(_is_enough(x) for x in details.diagnostics.values()) else steps + 1
            if steps < least or len(details.segments) < len(recording.sensors):
                if late:
                    self._restart(_why(details, steps, p))
                return None
            finished = finish_calibration(
                calibrated, self._attempt.first, self.wearer.segments, p.mounting, self._out
            )
        except SagittalError as error:
            if late:
                self._restart(Notice(error.code, error.message, error.sensor))
            return None
        self.stage = "running"
        self._attempt = CalibrationSamples(self.wearer, self._length)
        self.view = replace(
            self.view, checks=finished.checks, ok=finished.ok, problem=None, score=finished.score
        )
        return finished

    def _checks(self, standing: StandingNow) -> tuple[SegmentCheck, ...]:
        return tuple(SegmentCheck(s, s in standing.still) for s in self.wearer.segments)


def _is_enough(facts: object) -> bool:
    """Whether a segment was swung or bowed as often as required."""
    return isinstance(facts, Mapping) and facts["repetitions"] >= facts["asked"]


def _why(calibration: Calibration, steps: int, params: CalibratingParams) -> Notice:
    """Why a calibration from this much walking is rejected."""
    unknown = (
        n for n in calibration.notices if n.sensor is not None and n.sensor not in calibration.segments
    )
    if (notice := next(unknown, None)) is not None:
        return notice
    message = Message(
        "{walk_s:.0f} s of movement contained about {steps} straight "
        f"{plural(steps, 'step', 'steps')}; {{least_steps}} are needed. Stand still again, "
        "then walk straight ahead.",
        walk_s=params.walk_s,
        steps=steps,
        least_steps=params.least_steps,
    )
    return Notice("few_steps", message)
