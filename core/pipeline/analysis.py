"""Results of the stages: one record, one field per stage, and derived properties."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, TypeVar

from sagittal.core.activity.parameters import measure_day
from sagittal.core.activity.result import ActivityResult
from sagittal.core.agreement import Agreement
from sagittal.core.angles import JointAngles
from sagittal.core.body.chain.leg import LegMotion
from sagittal.core.body.estimate import PoseEstimate
from sagittal.core.body.feet import FootTracks
from sagittal.core.body.mounting import MountedSensors
from sagittal.core.body.poses import Poses
from sagittal.core.calibration.score import CalibrationScore
from sagittal.core.errors import Notice, ParameterError
from sagittal.core.events.result import GaitEvents, Strides
from sagittal.core.events.steps import Steps
from sagittal.core.events.turns import Turn
from sagittal.core.frames import Side
from sagittal.core.functional_tests.result import FunctionalTest
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.parameters.measure import MeasuredGait, Tracks
from sagittal.core.parameters.result import Parameter
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.quality import QualityReport
from sagittal.core.setup import SetupRepair
from sagittal.core.signals.calibrated import CalibratedRecording, Calibration
from sagittal.core.signals.recording import Recording, UniformRecording
from sagittal.core.squat.measures import SquatSide

SCHEMA: Final = 1
"""Version of the Analysis bundle and of analysis.json."""

Result = TypeVar("Result")


def require_stage(result: Result | None, stage: str) -> Result:
    """The result of a stage required by another one.

    Raises
    ------
    ParameterError : `stage_not_reached`.
    """
    if result is None:
        raise ParameterError("stage_not_reached", Message("The stage '{stage}' gave no result.", stage=stage))
    return result


@dataclass(frozen=True, eq=False)
class DetectedContacts:
    """Result of the stage `events`.

    Parameters
    ----------
    turns : of the body. steps : of a trunk sensor, None if foot contacts are known or there is no trunk
        sensor.
    """

    events: GaitEvents
    turns: tuple[Turn, ...]
    steps: Steps | None


@dataclass(frozen=True, eq=False)
class TakeAnalysis:
    """Complete result of one recording; results not reached are None, with the reason in `problem`.

    Each stage sets only its own fields, so that the chain can be resumed from any stage
    (`sagittal.core.pipeline.resume`). Users read the properties.

    Parameters
    ----------
    source : as read from the files.
    uniform : stage timeline; samples of sensors that do not measure are invalid.
    setup : stages agreement and calibration; proposed correction of the set-up, None = no errors detected.
    agreed : stage agreement; contains the corrected recording.
    report : stage quality.
    calibrated : stage calibration, with the alignment estimated for each sensor independently.
    calibration_score : of stage calibration, replaced in stage mounting by that of the final alignment.
        fused : stage orientation, with the alignment of stage calibration.
    contacts : stage events.
    mounted : stage mounting; None also for a single trunk sensor.
    posed : stage poses.
    angles : stage angles.
    tracks : stage parameters, input data for measuring strides and parameters, also after an edit.
    measured : stage parameters.
    activity : stage activity of daily life, which has no common axis and of the stages above only quality.
    legs : stage poses of squats, side → result of its chain. squats : stage parameters of squats, one for
        each leg.
    functional : stage test of a functional test.
    problem : the error that stopped the chain, None if every stage ran. stopped_at : that stage's name.
    """

    source: Recording
    config: PipelineConfig = field(default_factory=PipelineConfig)
    version: str = ""
    uniform: UniformRecording | None = None
    setup: SetupRepair | None = None
    agreed: Agreement | None = None
    report: QualityReport | None = None
    calibrated: CalibratedRecording | None = None
    calibration_score: CalibrationScore | None = None
    fused: Orientations | None = None
    contacts: DetectedContacts | None = None
    mounted: MountedSensors | None = None
    posed: PoseEstimate | None = None
    angles: JointAngles | None = None
    tracks: Tracks | None = None
    measured: MeasuredGait | None = None
    legs: Mapping[Side, LegMotion] | None = None
    squats: tuple[SquatSide, ...] | None = None
    functional: FunctionalTest | None = None
    activity: ActivityResult | None = None
    problem: Notice | None = None
    stopped_at: str | None = None

    @property
    def recording(self) -> UniformRecording:
        """The recording on its uniform axis, with late sensors shifted; present in every result of
        `analyse`.
        """
        return require_stage(self.uniform, "timeline") if self.agreed is None else self.agreed.recording

    @property
    def quality(self) -> QualityReport:
        """The quality report; present in every result of `analyse`."""
        return require_stage(self.report, "quality")

    @property
    def calibration(self) -> Calibration | None:
        """The final alignment, with leg inclination and joint-based forward axes."""
        last = self.calibrated if self.mounted is None else self.mounted.calibrated
        return None if last is None else last.calibration

    @property
    def orientations(self) -> Orientations | None:
        """As used for the angles: refined if the pose estimator does so."""
        return self.fused if self.posed is None else self.posed.orientations

    @property
    def poses(self) -> Poses | None:
        """Poses of the segments, None before they have been estimated."""
        return None if self.posed is None else self.posed.poses

    @property
    def feet(self) -> FootTracks | None:
        """Paths of the feet used for distances; None without a foot sensor."""
        return None if self.posed is None else self.posed.feet

    @property
    def events(self) -> GaitEvents | None:
        """Contacts as detected."""
        return None if self.measured is None else self.measured.events

    @property
    def strides(self) -> Strides | None:
        """The stride list."""
        return None if self.measured is None else self.measured.strides

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, those of a functional test first; empty if not reached."""
        if self.squats is not None:
            return tuple(p for of_leg in self.squats for p in of_leg.parameters)
        if self.activity is not None:
            return measure_day(self.activity)
        of_test = () if self.functional is None else self.functional.parameters
        return (*of_test, *(() if self.measured is None else self.measured.parameters))

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Notices of all stages without duplicates."""
        detected = None if self.contacts is None else self.contacts.events
        speaking = (
            self.source, None if self.uniform is None else self.recording, self.report, self.calibration,
            self.orientations, detected, self.measured, self.poses, self.angles, self.functional,
            self.activity,
        )  # fmt: skip
        all_notices = [notice for part in speaking if part is not None for notice in part.notices]
        all_notices += () if self.mounted is None else self.mounted.assumed
        all_notices += () if self.problem is None else (self.problem,)
        return tuple(dict.fromkeys(all_notices))

    @property
    def provenance(self) -> Mapping[str, object]:
        """SHA-256 of every input file, digest of the parameters, version of the code."""
        return {
            "input_sha256": dict(self.source.sha256),
            "parameters_sha256": self.config.digest,
            "version": self.version,
            "schema": SCHEMA,
        }
