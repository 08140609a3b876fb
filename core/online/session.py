"""One live recording: batches in, frames out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np

from sagittal.core.agreement.live import LiveAgreement, compile_live_agreement
from sagittal.core.agreement.params import LiveAgreementParams
from sagittal.core.body.live_still import StillnessDetector
from sagittal.core.body.model import NOMINAL_HEIGHT_M, BodyModel
from sagittal.core.body.tree import PRESETS
from sagittal.core.calibration.live_attempt import WornSensors
from sagittal.core.calibration.score import CalibrationScore
from sagittal.core.errors import Notice, SagittalError
from sagittal.core.formats.live_log import Hello, SampleBatch
from sagittal.core.frames import GRAVITY, R_NEUTRAL, Protocol, Segment
from sagittal.core.functional_tests.guided import GUIDED, GuidedTest
from sagittal.core.functional_tests.result import GuidedTestView
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.online.calibrated import LiveCalibration, compile_calibration_kernels
from sagittal.core.online.calibrating import CalibratingParams, LiveCalibrator
from sagittal.core.online.chain import ChainOutput, ChainParams, LiveChain
from sagittal.core.online.frame import EMPTY_TRAIL, AngleTrail, LiveFrame
from sagittal.core.online.health import SensorHealthMonitor
from sagittal.core.parameters.spatial import Surface
from sagittal.core.quality.live_stuck import StuckSensors
from sagittal.core.quality.stuck import compile_stuck_kernel
from sagittal.core.rotation import from_matrix
from sagittal.core.signals.calibrated import CalibratedRecording, Calibration, SegmentCalibration
from sagittal.core.signals.recording import GivenLimits, SensorSignals, Subject, UniformRecording, check_belt
from sagittal.core.timeline.live import LiveAxis, LiveAxisParams, UniformBlock, compile_axis_kernels


@dataclass(frozen=True)
class OnlineParams:
    """Parameters of every stage."""

    axis: LiveAxisParams = field(default_factory=LiveAxisParams)
    calibrating: CalibratingParams = field(default_factory=CalibratingParams)
    chain: ChainParams = field(default_factory=ChainParams)
    agreement: LiveAgreementParams = field(default_factory=LiveAgreementParams)


class OnlineSession:
    """A live recording: a pure function of its batches and commands in order.

    Parameters
    ----------
    hello : its streams. subject : height, standing width, shoe. protocol : task and surface. mounting :
        segment → declared placement. belt_speed_mps : of a treadmill, None = not entered.

    Raises
    ------
    SignalError `no_mapping`, `sample_rate_too_low`. ParameterError as `check_belt`.
    """

    def __init__(
        self,
        hello: Hello,
        subject: Subject | None = None,
        protocol: Protocol = "walk",
        params: OnlineParams | None = None,
        *,
        mounting: Mapping[str, str] | None = None,
        belt_speed_mps: float | None = None,
    ) -> None:
        check_belt(belt_speed_mps, protocol)
        self.params = params or OnlineParams()
        self._axis = LiveAxis(hello, self.params.axis)
        self._surface = Surface(protocol, belt_speed_mps)
        self._calibrating = LiveCalibrator(
            WornSensors(
                self._axis.segments, self._axis.rate_hz, subject or Subject(), protocol, mounting or {}
            ),
            self.params.calibrating,
        )
        self._health = SensorHealthMonitor(hello)
        self._still = StillnessDetector(len(self._axis.segments), self._axis.rate_hz)
        self._stuck = StuckSensors(self._axis.segments, self._axis.rate_hz)
        self._agreement = LiveAgreement(self._axis.segments, self._axis.rate_hz, self.params.agreement)
        self.chain: LiveChain | None = None
        self._guided: GuidedTest | None = None
        if protocol in GUIDED:
            self._guided = GuidedTest(protocol, self._axis.segments, self._axis.rate_hz, subject)

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Segments with a sensor in the order of the axis columns."""
        return self._axis.segments

    def push(self, batch: SampleBatch) -> LiveFrame | None:
        """Process the next batch of the log; returns the state after the samples it completes, None without
        any.

        After the returned state has been delivered the caller should call `compare_sensors`.
        """
        self._health.push(batch)
        block = self._axis.push(batch)
        if block is None:
            return None
        block, stuck = self._stuck.push(block)
        rests = self._still.push(block.acc, block.gyr, block.valid)[-1, :, 1]
        notices = [*self._axis.drain_notices(), *stuck]
        outcomes: list[ChainOutput] = []
        start = 0
        if self.chain is None:
            start = len(block)
            completed = self._calibrating.push(block)
            if completed is not None:
                notices += completed.notices
                start = completed.past - block.first
                outcomes += self._begin(completed, notices)
        self._agreement.push(block, self._calibrating.drain_standings())
        if self.chain is not None and start < len(block):
            k = slice(start, None)
            outcomes.append(
                self.chain.push(block.acc[k], block.gyr[k], block.valid[k], block.interpolated[k])
            )
        if self._guided is not None:
            strides = [s for x in outcomes for s in x.strides]
            self._guided.push(block, strides, [e for x in outcomes for e in x.events])
        resting = [s for s, x in zip(self.segments, rests.tolist(), strict=True) if x]
        frame_fields = {} if self.chain is None or not outcomes else _tell(block, self.chain, outcomes)
        return LiveFrame(
            t_s=float(block.t_s[-1]),
            seq=batch.seq,
            stage=self._calibrating.stage,
            health=self._health.read_health(resting, self._stuck.now, self._agreement.doubts),
            calibration=self._calibrating.view,
            notices=(*notices, *(n for x in outcomes for n in x.notices)) if frame_fields else tuple(notices),
            **frame_fields,
        )

    def compare_sensors(self) -> list[Notice]:
        """Run the sensor consistency checks on the seconds completed by the last push; takes milliseconds."""
        return self._agreement.compare()

    def guide_test(self) -> GuidedTestView | None:
        """State of the functional test; None for other protocols. Takes milliseconds once per second."""
        return None if self._guided is None else self._guided.advance()

    def command(self, name: str, value: object = None) -> None:
        """Execute a command of the therapist, from the next sample on; unknown commands are ignored.

        Parameters
        ----------
        name : "redo_calibration" or "test". value : for a test, "go", "repeat" or start_s and end_s.
        """
        if name == "redo_calibration":
            self.chain = None
            self._calibrating.redo()
            self._agreement.forget()
        elif name == "test" and self._guided is not None:
            self._guided.advance()
            if value == "go":
                self._guided.go()
            elif value == "repeat":
                self._guided.repeat()
            elif isinstance(value, Mapping):
                self._guided.correct(GivenLimits(value["start_s"], value["end_s"]))

    def _begin(self, calibration: LiveCalibration, notices: list[Notice]) -> list[ChainOutput]:
        """Start the chain and catch up; calibration restarts if no chain can run with its result."""
        try:
            self.chain = LiveChain(calibration, self.segments, self._surface, self.params.chain)
        except SagittalError as error:
            notices.append(Notice(error.code, error.message, error.sensor))
            self._calibrating.redo()
            return []
        return [self.chain.caught_up]


def _tell(block: UniformBlock, chain: LiveChain, outcomes: Sequence[ChainOutput]) -> dict[str, Any]:
    """Content of a frame from the chain after the block's last sample."""
    placed, angles = outcomes[-1].placed, outcomes[-1].angles
    count = min(len(angles), len(block))
    p = placed.p[-1]
    columns = zip(chain.estimator.segments, placed.known[-1].tolist(), strict=True)
    segments_known = [s if k else None for s, k in columns]
    positions = zip(segments_known, p, p[:, 0].tolist(), strict=True)
    return {
        "method": chain.estimator.method,
        "q": {s: x for s, x in zip(segments_known, placed.q[-1], strict=True) if s is not None},
        "p": {s: x for s, x, first in positions if s is not None and isfinite(first)},
        "valid": bool(placed.whole[-1]),
        "contact": dict(chain.contact),
        "angles": dict(zip(chain.names, angles[-1].tolist(), strict=True)),
        "trail": AngleTrail(block.t_s[-count:], chain.names, angles[-count:]) if count else EMPTY_TRAIL,
        "events": tuple(e for x in outcomes for e in x.events),
        "strides": tuple(s for x in outcomes for s in x.strides),
    }


def compile_live_kernels() -> None:
    """Compile every kernel of the chain or load it from the cache, so that the first recording is not
    delayed.
    """
    compile_calibration_kernels()
    compile_axis_kernels()
    compile_stuck_kernel()
    compile_live_agreement()
    for preset in ("lower_body7", "feet_pelvis3", "feet2"):
        _compile_chain(PRESETS[preset])


def _compile_chain(segments: tuple[Segment, ...]) -> None:
    chain = LiveChain(_standing(segments), segments)
    acc = np.tile([0.0, GRAVITY, 0.0], (10, len(segments), 1))
    is_valid = np.ones(acc.shape[:2], np.bool_)
    chain.push(acc, np.zeros_like(acc), is_valid, ~is_valid)


def _standing(segments: tuple[Segment, ...], samples: int = 150, rate_hz: float = 100.0) -> LiveCalibration:
    """Calibration of a simulated person in quiet standing, sensors aligned with the segments."""
    acc = np.tile([0.0, GRAVITY, 0.0], (samples, 1))
    is_valid = np.ones(samples, np.bool_)
    sensors = {
        s: SensorSignals(s, acc.copy(), np.zeros_like(acc), None, is_valid.copy(), ~is_valid)
        for s in segments
    }
    t_s = np.arange(samples) / rate_hz
    zero = (0.0, samples / rate_hz)
    recording = UniformRecording(t_s, rate_hz, sensors, Subject(), "walk", {})
    mounted = {s: SegmentCalibration(np.eye(3), np.zeros(3), GRAVITY, "declared", 1.0) for s in segments}
    calibration = Calibration(mounted, (zero,), (), zero, ~is_valid, "declared")
    upright = np.tile(from_matrix(R_NEUTRAL), (samples, 1))
    return LiveCalibration(
        calibrated=CalibratedRecording(recording, calibration),
        orientations=Orientations(
            t_s, rate_hz, dict.fromkeys(segments, upright), dict.fromkeys(segments, is_valid), "declared"
        ),
        first=0,
        past=samples,
        body=BodyModel.from_height(NOMINAL_HEIGHT_M),
        turned={},
        checks=(),
        notices=(),
        ok=True,
        score=CalibrationScore(()),
    )
