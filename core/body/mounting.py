"""How the sensors sit, once more, as the whole body shows it: standing width, and joints that must meet.

Calibration finds each sensor's mounting on its own. Three things only the body as a whole tells: how far legs
lean that stand wider or closer than the hips (apart.py), which forward axes do not fit the joints
(headings.py), and where on its segment a sensor sits (arms.py). Live and from a file it is the same
function.
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
    """A take whose mountings are final: whatever follows takes these, never those of the calibration.

    Parameters
    ----------
    calibrated : the recording with these mountings. orientations : with them, each sensor on its own.
    body : lengths and standing width. assumed : notices of lengths that nobody gave.
    choice : the sensors that work and what they allow.
    turned_rad : segment → how far its forward axis was turned; empty where the ErKF is not the estimator.
    arms : where its sensors sit and its joints lie, as motion shows it; None where the ErKF is not the
        estimator.
    failure : the joints could not be asked, so the ErKF cannot run either.
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
    """Lean the legs by the standing width, turn forward axes until the joints agree, and measure the arms.

    Parameters
    ----------
    calibrated, orientations : of the stages calibration and orientation.

    Raises
    ------
    EstimationError `estimator_impossible` when the estimator asked for cannot run on these sensors; those of
    `headings` when the ErKF was asked for by name.
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
