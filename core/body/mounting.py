"""Refinement of the sensor alignment from the whole body: standing width, and consistency of the joints.

Calibration estimates the alignment of each sensor independently. Three quantities require the body as a
whole: the inclination of legs with the feet wider or closer than the hips (apart.py), forward axes
inconsistent with the joints (headings.py), and sensor positions on the segments (arms.py). Live and offline
use the same function.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from sagittal.core.body.apart import lean_legs_apart
from sagittal.core.body.arms import MeasuredArms, measure_arms
from sagittal.core.body.choice import Choice, choose
from sagittal.core.body.erkf.headings import align_forward_axes
from sagittal.core.body.kinematics import nominal_body
from sagittal.core.body.model import BodyModel
from sagittal.core.body.pose_params import PoseParams
from sagittal.core.errors import EstimationError, Notice
from sagittal.core.estimators import ERKF
from sagittal.core.frames import Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.signals.calibrated import CalibratedRecording


@dataclass(frozen=True, eq=False)
class MountedSensors:
    """A recording with final sensor alignment, which later stages use instead of that of the calibration.

    Parameters
    ----------
    calibrated : the recording with this alignment. orientations : with it, each sensor independently. body :
        lengths and standing width. assumed : notices on assumed lengths.
    choice : the sensors that work and what they allow.
    turned_rad : segment → correction of its forward axis; empty if the ErKF is not the estimator.
    arms : sensor positions and joint centres estimated from motion; None if the ErKF is not the estimator.
    failure : the error of the joint evaluation, with which the ErKF cannot run either.
    """

    calibrated: CalibratedRecording
    orientations: Orientations
    body: BodyModel
    assumed: tuple[Notice, ...]
    choice: Choice
    turned_rad: Mapping[Segment, float] = field(default_factory=dict)
    arms: MeasuredArms | None = None
    failure: EstimationError | None = None


def mount_sensors(
    calibrated: CalibratedRecording, orientations: Orientations, params: PoseParams
) -> MountedSensors:
    """Incline the legs by the standing width, rotate forward axes to agree with the joints, and estimate the
    lever arms.

    Parameters
    ----------
    calibrated, orientations : of the stages calibration and orientation.

    Raises
    ------
    EstimationError `estimator_impossible` if the requested estimator cannot run on these sensors; those of
    `headings` if the ErKF was requested explicitly.
    """
    subject = calibrated.recording.subject
    # how far apart the feet stood leans legs that stand
    stood = calibrated.calibration.posture == "standing"
    width_m = subject.standing_width_m if stood else None
    body, assumed = nominal_body(subject.height_m, width_m, subject.shoe, subject.measures)
    calibrated, orientations = lean_legs_apart(calibrated, orientations, body)
    choice = choose(calibrated, orientations, params.estimator, params.least_valid)
    mounted = MountedSensors(calibrated, orientations, body, assumed, choice)
    if choice.order[:1] != (ERKF.name,):
        return mounted
    try:
        calibrated, orientations, turned = align_forward_axes(
            calibrated, orientations, body, choice.segments, params.erkf
        )
    except EstimationError as error:
        if choice.order == (ERKF.name,):
            raise
        return replace(mounted, failure=error)
    arms = measure_arms(calibrated, orientations, body, choice.segments, params.arms)
    return replace(mounted, calibrated=calibrated, orientations=orientations, turned_rad=turned, arms=arms)
