"""The offline calibration on the samples of a live attempt, and its result for the live chain."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sagittal.core.agreement import Agreement
from sagittal.core.agreement.agree import compare_sensors, measure_misfits
from sagittal.core.agreement.params import JointParams
from sagittal.core.body.erkf.headings import report_turned_axes
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.estimate import compile_pose_kernels
from sagittal.core.body.model import BodyModel
from sagittal.core.body.mounting import mount_sensors
from sagittal.core.body.pose_params import PoseParams
from sagittal.core.calibration import CalibrationParams
from sagittal.core.calibration.score import CalibrationScore, score_calibration
from sagittal.core.errors import Notice
from sagittal.core.frames import Segment
from sagittal.core.fusion.attitude import compile_attitude_kernel
from sagittal.core.fusion.mahony import MahonyParams, estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.online.frame import SegmentCheck
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.peaks import compile_peak_kernel
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import compile_rest_kernels


@dataclass(frozen=True)
class MountingParams:
    """Parameters of the stages that estimate the sensor alignment: those of the offline pipeline.

    Parameters
    ----------
    erkf : of the filter used to align the forward axes, as `PoseParams.erkf`. joints : of the comparison at
        the joints, as `AgreementParams.joints`.
    """

    calibration: CalibrationParams = field(default_factory=CalibrationParams)
    fusion: MahonyParams = field(default_factory=MahonyParams)
    erkf: ErkfParams = field(default_factory=ErkfParams.people)
    joints: JointParams = field(default_factory=JointParams)


@dataclass(frozen=True, eq=False)
class LiveCalibration:
    """Sensor alignment, and the samples it was estimated from.

    Parameters
    ----------
    calibrated : samples of the working segments from `first` on, t_s from 0; its windows are in that time.
        The alignment is final: leg inclination corrected, forward axes consistent with the joints if the ErKF
        runs.
    orientations : of these samples, smoothed (not causal); for comparison, not for continuation.
    first, past : on the live axis, index of the recording's first sample and the one after its last. The
        chain processes [first, past) to catch up and continues with sample `past` of the axis.
    body : lengths, with the standing width.
    turned : segment → correction of its forward axis by the joints, rad; empty without ErKF. checks : one per
        segment with a sensor, including those that could not be calibrated. ok : none of them is doubtful.
        score : of these samples, as for any recording.
    """

    calibrated: CalibratedRecording
    orientations: Orientations
    first: int
    past: int
    body: BodyModel
    turned: Mapping[Segment, float]
    checks: tuple[SegmentCheck, ...]
    notices: tuple[Notice, ...]
    ok: bool
    score: CalibrationScore


def finish_calibration(
    calibrated: CalibratedRecording,
    first: int,
    segments: Sequence[Segment],
    params: MountingParams,
    out: Collection[Segment] = (),
) -> LiveCalibration:
    """Steps after the calibration proper, as offline: leg inclination, consistent forward axes.

    Parameters
    ----------
    calibrated : result of `sagittal.core.calibration.calibrate`. segments : all segments, including those
        without samples. out : those whose sensor does not measure, already reported.

    Raises
    ------
    EstimationError as `sagittal.core.fusion.mahony.estimate_orientations`.
    """
    recording = calibrated.recording
    # every sensor with a sample counts: which of them last, nobody knows yet
    every = PoseParams(erkf=params.erkf, least_valid=0.0)
    mounted = mount_sensors(calibrated, estimate_orientations(calibrated, params.fusion), every)
    calibrated, failure = mounted.calibrated, mounted.failure
    notices = [*calibrated.calibration.notices, *mounted.assumed, *report_turned_axes(mounted.turned_rad)]
    if failure is not None:
        notices.append(Notice(failure.code, failure.message, failure.sensor))
    notices += _missing(recording, [s for s in segments if s not in out])
    checks = tuple(_check(s, calibrated, notices) for s in segments)
    joints, _ = compare_sensors(recording, params.joints)
    agreed = Agreement(recording, misfits=measure_misfits(joints))
    return LiveCalibration(
        calibrated=calibrated,
        orientations=mounted.orientations,
        first=first,
        past=first + len(recording.t_s),
        body=mounted.body,
        turned=mounted.turned_rad,
        checks=checks,
        notices=tuple(notices),
        ok=all(c.method is not None and all(n.severity == "info" for n in c.notices) for c in checks),
        score=score_calibration(calibrated, params.calibration.score, agreed, mounted.turned_rad),
    )


def _missing(recording: UniformRecording, segments: Sequence[Segment]) -> list[Notice]:
    return [
        Notice(
            "sensor_missing",
            Message(
                "The {value} sensor sent no data during quiet standing; recording continues without it. "
                "Connect it and calibrate again.",
                value=s,
            ),
            sensor=s,
        )
        for s in segments
        if s not in recording.sensors
    ]


def _check(segment: Segment, calibrated: CalibratedRecording, notices: Sequence[Notice]) -> SegmentCheck:
    mounted = calibrated.calibration.segments.get(segment)
    own = tuple(n for n in notices if n.sensor == segment)
    if mounted is None:
        return SegmentCheck(segment, False, notices=own)
    return SegmentCheck(segment, False, mounted.method, mounted.score, own)


def compile_calibration_kernels() -> None:
    """Load and compile everything required by a calibration, so that the first one is not delayed by a
    second.
    """
    import scipy.ndimage  # noqa: F401

    low_pass(np.arange(9.0), 1.0, 100.0)
    compile_peak_kernel()
    compile_rest_kernels()
    compile_attitude_kernel()
    compile_pose_kernels()
