"""The whole chain: Recording → Analysis, in named stages.

A stage is a pure function; this module only calls them in order, says which one is running, and keeps what
was reached when one of them cannot go on. The same code serves the command line, the worker and the tests.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from core import angles, body, calibration, events, fusion, parameters, quality, timeline
from core.angles import JointAngles
from core.body.estimate import PoseParams, estimate_poses
from core.body.feet import FootTracks
from core.body.poses import Poses
from core.calibration import CalibrationParams
from core.calibration.result import Calibration
from core.errors import Notice, SagittalError
from core.events import FootPitchParams, StrideParams
from core.events.result import GaitEvents, Strides
from core.frames import SIDES
from core.fusion import MahonyParams
from core.fusion.orientations import Orientations
from core.parameters.result import Parameter
from core.quality import QualityReport
from core.recording import Recording, UniformRecording
from core.timeline import TimelineParams

SCHEMA: Final = 1
"""Version of the Analysis bundle and of analysis.json."""

Progress = Callable[[str, float], None]
"""Called with the stage that starts and the share of the work done before it, 0 to 1."""

STAGES: Final[tuple[tuple[str, float], ...]] = (
    ("timeline", 0.0),
    ("quality", 0.03),
    ("calibration", 0.05),
    ("orientation", 0.1),
    ("events", 0.14),
    ("poses", 0.15),
    ("angles", 0.95),
    ("parameters", 0.98),
)
"""Stage names in order and the share of a typical run that lies before each."""


@dataclass(frozen=True)
class PipelineConfig:
    """Parameters of every stage; its hash is part of each result's provenance."""

    timeline: TimelineParams = field(default_factory=TimelineParams)
    calibration: CalibrationParams = field(default_factory=CalibrationParams)
    fusion: MahonyParams = field(default_factory=MahonyParams)
    events: FootPitchParams = field(default_factory=FootPitchParams)
    strides: StrideParams = field(default_factory=StrideParams)
    poses: PoseParams = field(default_factory=PoseParams)

    @property
    def digest(self) -> str:
        """sha256 over all parameters; equal parameters give equal digests."""
        text = json.dumps(dataclasses.asdict(self), sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class Analysis:
    """Everything one take gave; a stage that was not reached is None and `problem` says why.

    Parameters
    ----------
    problem : the error that stopped the chain, None when every stage ran.
    orientations : as the angles take them: refined where the pose estimator does so.
    feet : paths of the feet that distances are measured on; None without a foot sensor.
    notices : all notices of all stages in order of the chain.
    provenance : input sha256 by file, digest of the parameters, version of the code.
    """

    recording: UniformRecording
    quality: QualityReport
    calibration: Calibration | None
    orientations: Orientations | None
    events: GaitEvents | None
    strides: Strides | None
    poses: Poses | None
    feet: FootTracks | None
    angles: JointAngles | None
    parameters: tuple[Parameter, ...]
    problem: Notice | None
    notices: tuple[Notice, ...]
    provenance: Mapping[str, object]


def analyse(
    recording: Recording,
    config: PipelineConfig | None = None,
    progress: Progress = lambda stage, share: None,
    version: str = "",
) -> Analysis:
    """Run all stages on one recording.

    Parameters
    ----------
    recording : streams with their segments, as core.formats reads them.
    config : parameters of the stages; None = the preset of the recording's protocol.
    progress : called before each stage.
    version : of the code, kept in the provenance.

    Raises
    ------
    SagittalError
        When not even a common time axis can be made. Later stages never raise: what stops them is
        `Analysis.problem`.
    """
    config = config or PipelineConfig()
    share = dict(STAGES)

    def start(stage: str) -> None:
        progress(stage, share[stage])

    start("timeline")
    uniform = timeline.synchronise(recording, config.timeline)
    start("quality")
    report = quality.assess(recording, uniform)
    reached: dict[str, object] = {}
    problem = next((n for n in report.notices if n.severity == "error"), None)
    if problem is None:
        try:
            _run_stages(uniform, config, start, reached)
        except SagittalError as error:
            problem = Notice(error.code, error.message, error.sensor, error.t_s, severity="error")
    progress("done", 1.0)
    return _bundle(recording, uniform, report, reached, problem, config, version)


def _run_stages(
    uniform: UniformRecording,
    config: PipelineConfig,
    start: Callable[[str], None],
    reached: dict[str, object],
) -> None:
    """Fill `reached` stage by stage, so that an error leaves everything before it."""
    start("calibration")
    calibrated = calibration.calibrate(uniform, config.calibration)
    reached["calibration"] = calibrated.calibration
    start("orientation")
    orientations = fusion.estimate(calibrated, config.fusion)
    reached["orientations"] = orientations
    start("events")
    found = events.detect(orientations, config.events)
    reached["events"] = found
    strides = events.stride_list(found, orientations, calibrated.calibration.turning, config.strides)
    reached["strides"] = strides
    start("poses")
    lengths, assumed = body.nominal_body(uniform.subject.height_m, uniform.subject.standing_width_m)
    contacts = {
        side: body.contact_mask(uniform.t_s, found.times(side, "ic"), found.times(side, "tc"))
        for side in SIDES
    }
    reached["body"] = assumed
    posed = estimate_poses(calibrated, orientations, contacts, lengths, config.poses)
    reached |= {"poses": posed.poses, "orientations": posed.orientations, "feet": posed.feet}
    start("angles")
    joint = angles.joint_angles(posed.orientations, calibrated.calibration.zero, posed.poses)
    reached["angles"] = joint
    start("parameters")
    reached["parameters"] = parameters.gait_parameters(
        strides, joint, posed.orientations, posed.feet, parameters.surface_of(uniform)
    )


def _bundle(
    recording: Recording,
    uniform: UniformRecording,
    report: QualityReport,
    reached: Mapping[str, object],
    problem: Notice | None,
    config: PipelineConfig,
    version: str,
) -> Analysis:
    notices = [*recording.notices, *uniform.notices, *report.notices]
    for name in ("calibration", "orientations", "events", "strides", "poses", "angles"):
        notices.extend(getattr(reached.get(name), "notices", ()))
    notices.extend(reached.get("body", ()))  # type: ignore[arg-type]
    if problem is not None:
        notices.append(problem)
    return Analysis(
        recording=uniform,
        quality=report,
        **{
            name: reached.get(name)  # type: ignore[arg-type]
            for name in ("calibration", "orientations", "events", "strides", "poses", "feet", "angles")
        },
        parameters=reached.get("parameters", ()),  # type: ignore[arg-type]
        problem=problem,
        notices=tuple(dict.fromkeys(notices)),
        provenance={
            "input_sha256": dict(recording.sha256),
            "parameters_sha256": config.digest,
            "version": version,
            "schema": SCHEMA,
        },
    )
