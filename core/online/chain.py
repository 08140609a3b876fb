"""The live chain after calibration: samples in, poses, angles, contacts and strides out.

It starts at the standing period, processes the samples recorded since, and continues with every new sample.
Every part keeps its own state, so that results are bit-identical for any division into blocks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from sagittal.core.angles.kernel import AngleKernel, mean_angles, subtract_zero
from sagittal.core.body.choice import WHOLE, list_possible_estimators
from sagittal.core.body.erkf.live_erkf import HEADING_SD, live_params
from sagittal.core.body.erkf.live_figure import LinkedBody, UnlinkedSensors
from sagittal.core.body.erkf.live_sensors import FilteredSensors, FootPaths
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.l7s.filter import L7sParams
from sagittal.core.body.l7s.live_figure import LiveL7s
from sagittal.core.body.live_estimator import BodyBlock, LivePoseEstimator, MeasuredBlock, list_worn_feet
from sagittal.core.body.live_still import StillnessDetector
from sagittal.core.body.still import FOOT_STILL
from sagittal.core.errors import Notice
from sagittal.core.estimators import ERKF, L7S_2I, L7S_3I
from sagittal.core.events.flags import StrideParams
from sagittal.core.events.foot_contact import FootContactParams
from sagittal.core.events.foot_movement import FootMovement
from sagittal.core.events.foot_pitch import FootPitchParams
from sagittal.core.events.live_contacts import ContactDetector
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import Bools, Floats, Segment, Side
from sagittal.core.fusion.attitude import AttitudeParams
from sagittal.core.fusion.live_attitude import AttitudeTracker
from sagittal.core.fusion.live_drift import HeadingHold
from sagittal.core.message import Message
from sagittal.core.online.calibrated import LiveCalibration
from sagittal.core.parameters.live.live_history import MOST, SampleHistory
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.core.parameters.live.live_strides import HistoryColumns, LiveStrides
from sagittal.core.parameters.spatial import Surface
from sagittal.core.signals.rest import index_window
from sagittal.core.timeline.columns import find_columns, take_columns, take_mask

NOT_LIVE: Final = (
    "The sensors in use ({sensors}) do not allow a live avatar: this requires both feet, or the pelvis "
    "and a whole leg. Everything is recorded and can be analysed afterwards."
)
BROKEN: Final = (
    "The live filter diverged and the avatar is no longer shown; recording continues. Stand still and "
    "calibrate again; check which sensor is on which segment."
)
COURSES: Final[tuple[Segment, ...]] = ("pelvis", "foot_l", "foot_r")
"""Segments whose orientation parameters of a stride want."""


@dataclass(frozen=True)
class ChainParams:
    """Parameters of the live chain."""

    erkf: ErkfParams = field(default_factory=live_params)
    l7s: L7sParams = field(default_factory=L7sParams)
    attitude: AttitudeParams = field(default_factory=AttitudeParams)
    events: FootPitchParams = field(default_factory=FootPitchParams)
    contacts: FootContactParams = field(default_factory=FootContactParams)
    strides: StrideParams = field(default_factory=StrideParams)


class ChainOutput(NamedTuple):
    """Output of a block: body poses, angles (T, names) in rad, events and strides in order of detection."""

    placed: BodyBlock
    angles: Floats
    events: tuple[GaitEvent, ...]
    strides: tuple[LiveStride, ...]
    notices: tuple[Notice, ...]


class LiveChain:
    """All stages after calibration.

    Parameters
    ----------
    calibration : its samples are processed immediately (`caught_up`).
    columns : segments of the axis columns, of which the calibrated ones are used.
    first : its first sample on the axis, where standing begins. surface : walking surface.

    Raises
    ------
    EstimationError, SignalError if not even contacts can be detected.
    """

    def __init__(
        self,
        calibration: LiveCalibration,
        columns: Sequence[Segment],
        surface: Surface | None = None,
        params: ChainParams | None = None,
    ) -> None:
        self.params = params or ChainParams()
        calibrated = calibration.calibrated
        rate = self.rate_hz = calibrated.recording.rate_hz
        mounted = calibrated.calibration.segments
        self.segments = tuple(s for s in columns if s in mounted)
        self._columns = find_columns(self.segments, columns)
        zero = index_window(calibrated.calibration.zero, rate)
        self.first = calibration.first + zero.start
        self.body = calibration.body
        self._notices: list[Notice] = []
        self.estimator = self._choose(calibration)
        feet = list_worn_feet(self.segments)
        turned = tuple(dict.fromkeys((*feet, *self.estimator.attitudes)))
        index = [self.segments.index(s) for s in turned]
        self._turned = turned
        self._index = np.array(index, np.int64)
        self._hold = HeadingHold(turned, rate, FOOT_STILL.gyr_limit)
        self._attitudes = AttitudeTracker(
            index, [mounted[s] for s in turned], rate, self.params.attitude, len(feet)
        )
        self._still = StillnessDetector(len(feet), rate)
        self._contacts = ContactDetector(feet, rate, self.params.events, self.params.contacts)
        self._feet = np.array([self.segments.index(f) for f in feet], np.int64)
        self._foot_mounts = [mounted[f] for f in feet]
        self._courses = tuple(s for s in COURSES if s in self.segments)
        self._course_columns = np.array([self.segments.index(s) for s in self._courses], np.int64)
        single_sensor, figure = self.estimator.attitudes, self.estimator.segments
        self._figured = [None if s in single_sensor else figure.index(s) for s in self._courses]
        # a pelvis that carries a sensor tilts as that says, not as a model of the legs wants it
        self._tilting = tuple(s for s in self.estimator.attitudes if s == "pelvis")
        self._angles = AngleKernel.between(self._tilting, self.estimator.segments)
        self._zero: Floats | None = None
        self._told_broken = False
        self.contact: dict[Side, bool] = dict.fromkeys(self._contacts.sides, True)
        self._strides = LiveStrides(
            HistoryColumns(
                first=self.first,
                rate_hz=rate,
                angles=self._angles.names,
                courses=self._courses,
                feet=self._contacts.sides,
                linked=self.estimator.linked,
                source=self.estimator.source,
                body=calibration.body,
                surface=surface or Surface(calibrated.recording.protocol),
            ),
            self.params.strides,
        )
        self.history = self._new_history()
        self._count = 0
        self.caught_up = self._catch_up(calibration, zero)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the angles."""
        return self._angles.names

    def push(self, acc: Floats, gyr: Floats, valid: Bools, filled: Bools) -> ChainOutput:
        """Process the next samples (T, columns, …) of the axis; filled : lost samples, as in its blocks."""
        signals = take_columns(acc, gyr, valid, self._columns)
        return self._advance(*signals, take_mask(filled, self._columns))

    def _choose(self, calibration: LiveCalibration) -> LivePoseEstimator:
        """The best estimator for the calibrated sensors, selected as offline."""
        calibrated, body, rate = calibration.calibrated, calibration.body, self.rate_hz
        mounted = calibrated.calibration.segments
        column = {s: i for i, s in enumerate(self.segments)}
        params = self.params.erkf
        if calibration.turned:
            params = replace(params, start_heading_sd=HEADING_SD)

        def filtered(segments: Sequence[Segment]) -> FilteredSensors:
            return FilteredSensors(segments, column, mounted, body, rate, params)

        best = next(iter(list_possible_estimators(self.segments)), None)
        if best == ERKF.name:
            instrumented = tuple(s for s in WHOLE if s in column)
            return LinkedBody(instrumented, filtered(instrumented), body.ankle_height, rate)
        feet_segments = list_worn_feet(self.segments)
        feet = FootPaths(filtered(feet_segments)) if feet_segments else None
        if best in (L7S_3I.name, L7S_2I.name) and feet is not None:
            return LiveL7s(column, mounted, body, rate, feet, self.params.l7s)
        message = Message(NOT_LIVE, sensors=", ".join(self.segments))
        self._notices.append(Notice("no_live_figure", message, severity="info"))
        return UnlinkedSensors(self.segments, feet)

    def _new_history(self) -> SampleHistory:
        feet = len(self._contacts.sides)
        return SampleHistory(
            self.rate_hz,
            {
                "angles": (len(self.names),),
                "course": (len(self._courses), 4),
                "feet_p": (feet, 3),
                "feet_q": (feet, 4),
            },
            {
                "course_valid": (len(self._courses),),
                "feet_still": (feet,),
                "feet_valid": (feet,),
                "feet_patched": (feet,),
            },
        )

    def _catch_up(self, calibration: LiveCalibration, zero: slice) -> ChainOutput:
        """Process the standing window as one block, then the samples of the walk."""
        signals = calibration.calibrated.recording.sensors
        acc = np.stack([signals[s].acc for s in self.segments], axis=1)
        gyr = np.stack([signals[s].gyr for s in self.segments], axis=1)
        valid = np.stack([signals[s].valid for s in self.segments], axis=1)
        filled = np.stack([signals[s].interpolated for s in self.segments], axis=1)
        outputs = [self._advance(acc[zero], gyr[zero], valid[zero], filled[zero])]
        for start in range(zero.stop, len(acc), MOST):
            k = slice(start, start + MOST)
            outputs.append(self._advance(acc[k], gyr[k], valid[k], filled[k]))
        return _joined(outputs)

    def _advance(self, acc: Floats, gyr: Floats, valid: Bools, filled: Bools) -> ChainOutput:
        if len(acc) > MOST and self._count:
            parts = [slice(k, k + MOST) for k in range(0, len(acc), MOST)]
            return _joined([self._advance(acc[k], gyr[k], valid[k], filled[k]) for k in parts])
        feet_valid = valid.take(self._feet, axis=1)
        still = self._still.push(acc.take(self._feet, axis=1), gyr.take(self._feet, axis=1), feet_valid)
        q, sure = self._attitudes.push(acc, gyr, valid, np.ascontiguousarray(still[:, :, 0]))
        if self.estimator.attitudes:
            k = self._index
            self._hold.push(q, gyr.take(k, axis=1), valid.take(k, axis=1))
        turned = {s: q[:, i] for i, s in enumerate(self._turned)}
        placed = self.estimator.push(MeasuredBlock(acc, gyr, valid, turned, filled))
        angles = self._measure(placed, turned, valid)
        motions = [
            FootMovement.of_signals(acc[:, k], gyr[:, k], mount)
            for k, mount in zip(self._feet, self._foot_mounts, strict=True)
        ]
        # a foot whose orientation is not known has no contacts
        sure = np.ascontiguousarray(sure[:, : len(self._feet)])
        contacts = self._contacts.push(q[:, : len(self._feet)], sure, motions, self.first)
        self._remember(placed, turned, valid, sure, angles)
        self._count += len(acc)
        for x in contacts:
            if x.event.first_s is None:
                self.contact[x.event.side] = x.event.kind == "ic"
        self._notices += self.estimator.drain_notices()
        if self.estimator.broken and not self._told_broken:
            self._told_broken = True
            self._notices.append(Notice("live_figure_lost", BROKEN))
        notices, self._notices = tuple(self._notices), []
        strides = tuple(self._strides.push(contacts, self.history))
        return ChainOutput(placed, angles, tuple(x.event for x in contacts), strides, notices)

    def _measure(self, placed: BodyBlock, turned: Mapping[Segment, Floats], valid: Bools) -> Floats:
        """Angles (T, names) relative to standing; the first block is the standing period."""
        q, is_known = placed.q, placed.known
        if self._tilting:
            pelvis_column = self.segments.index("pelvis")
            q = np.concatenate((turned["pelvis"][:, None], q), axis=1)
            is_known = np.concatenate((valid[:, pelvis_column, None], is_known), axis=1)
        angles = self._angles.measure(q, is_known, self._zero)
        if self._zero is None:
            self._zero = mean_angles(angles)
            angles = subtract_zero(angles, self._zero)
        return angles

    def _remember(
        self,
        placed: BodyBlock,
        turned: Mapping[Segment, Floats],
        valid: Bools,
        sure: Bools,
        angles: Floats,
    ) -> None:
        course = np.empty((len(angles), len(self._courses), 4))
        for i, s in enumerate(self._courses):
            k = self._figured[i]
            course[:, i] = turned[s] if k is None else placed.q[:, k]
        course_valid = valid.take(self._course_columns, axis=1) & np.isfinite(course[:, :, 0])
        for i, k in enumerate(self._course_columns.tolist()):
            for f in np.flatnonzero(self._feet == k).tolist():
                course_valid[:, i] &= sure[:, f]
        rows = {
            "angles": angles, "course": course, "course_valid": course_valid, "feet_p": placed.paths.p,
            "feet_q": placed.paths.q, "feet_still": placed.paths.still, "feet_valid": placed.paths.valid,
            "feet_patched": placed.paths.patched,
        }  # fmt: skip
        if len(angles) <= MOST:
            self.history.append(rows)
            return
        for start in range(0, len(angles), MOST):
            self.history.append({name: x[start : start + MOST] for name, x in rows.items()})


def _joined(found: Sequence[ChainOutput]) -> ChainOutput:
    """Concatenate the output of consecutive blocks."""
    last = found[-1]
    return ChainOutput(
        placed=last.placed,
        angles=np.concatenate([x.angles for x in found]),
        events=tuple(e for x in found for e in x.events),
        strides=tuple(s for x in found for s in x.strides),
        notices=tuple(n for x in found for n in x.notices),
    )
