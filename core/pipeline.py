"""The whole chain: Recording → Analysis, in named stages.

A stage is a pure function; this module only calls them in order, says which one is running, and keeps what
was reached when one of them cannot go on. The same code serves the command line, the worker and the tests.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal, get_args

import numpy as np

from core import angles, body, calibration, quality, timeline
from core.angles import JointAngles
from core.body.estimate import PoseEstimate, PoseParams, estimate_poses
from core.body.feet import FootTracks
from core.body.l7s.poses import free_acceleration
from core.body.poses import Poses
from core.body.walking_frame import in_walking_frame
from core.calibration import CalibrationParams
from core.calibration.result import Calibration
from core.errors import Notice, ParameterError, SagittalError
from core.events import FootPitchParams, StrideParams
from core.events.consensus import ConsensusParams, all_detectors, consensus, with_confidence
from core.events.lumbar import LumbarParams, about_up, detect_steps, trunk_sensor
from core.events.result import GaitEvents, Strides
from core.events.turns import TurnParams, body_yaw_rate, turns
from core.frames import FOOT, SIDES, Segment
from core.fusion.mahony import MahonyParams, estimate_orientations
from core.fusion.orientations import Orientations
from core.measure import Measured, Tracks, measure
from core.parameters.result import Parameter
from core.parameters.spatial import surface_of
from core.quality import QualityReport
from core.quality.stuck import mark_stuck, working
from core.recording import Recording, UniformRecording
from core.timeline import TimelineParams
from core.withheld import withhold, withhold_distances

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


TRUNK: Final[tuple[Segment, ...]] = ("pelvis", "chest")
"""Segments whose acceleration tells how regular the gait is."""


Detector = Literal["foot_pitch", "consensus"]
"""Whose contacts count: the foot-pitch rule's own, or what most detectors agree on."""


@dataclass(frozen=True)
class PipelineConfig:
    """Parameters of every stage; its hash is part of each result's provenance.

    Parameters
    ----------
    detector : the foot-pitch rule has the smallest error and refuses feet that hardly pitch; the consensus
        finds those by the shanks (tests/accuracy/test_events_consensus.py).

    Raises
    ------
    ParameterError : `unknown_detector`.
    """

    timeline: TimelineParams = field(default_factory=TimelineParams)
    calibration: CalibrationParams = field(default_factory=CalibrationParams)
    fusion: MahonyParams = field(default_factory=MahonyParams)
    events: FootPitchParams = field(default_factory=FootPitchParams)
    detector: Detector = "foot_pitch"
    consensus: ConsensusParams = field(default_factory=ConsensusParams)
    lumbar: LumbarParams = field(default_factory=LumbarParams)
    turns: TurnParams = field(default_factory=TurnParams)
    strides: StrideParams = field(default_factory=StrideParams)
    poses: PoseParams = field(default_factory=PoseParams)

    def __post_init__(self) -> None:
        if self.detector not in get_args(Detector):
            raise ParameterError(
                "unknown_detector",
                f"Detector '{self.detector}' is not one of {', '.join(get_args(Detector))}.",
            )

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
    tracks : what events, strides and parameters were measured on, and after an edit are measured on again.
    notices : all notices of all stages in order of the chain.
    provenance : input sha256 by file, digest of the parameters, version of the code.
    """

    recording: UniformRecording
    quality: QualityReport
    calibration: Calibration | None
    orientations: Orientations | None
    poses: Poses | None
    feet: FootTracks | None
    angles: JointAngles | None
    problem: Notice | None
    notices: tuple[Notice, ...]
    provenance: Mapping[str, object]
    tracks: Tracks | None = None
    measured: Measured | None = None

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
        """All parameters, empty when no events were reached."""
        return () if self.measured is None else self.measured.parameters


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
    uniform = mark_stuck(uniform)
    report = quality.assess(recording, uniform, working=working(uniform).sensors)
    reached: dict[str, object] = {}
    problem = next((n for n in report.notices if n.severity == "error"), None)
    if problem is None:
        try:
            _run_stages(uniform, config, start, reached)
        except SagittalError as error:
            problem = Notice(error.code, error.message, error.sensor, error.t_s, severity="error")
    tracks = reached.get("tracks")
    if isinstance(tracks, Tracks):
        start("parameters")
        reached["measured"] = measure(tracks)
    progress("done", 1.0)
    return _bundle(recording, uniform, report, reached, problem, config, version)


def _run_stages(
    uniform: UniformRecording,
    config: PipelineConfig,
    start: Callable[[str], None],
    reached: dict[str, object],
) -> None:
    """Fill `reached` stage by stage, so that an error leaves everything before it."""
    whole, uniform = uniform, working(uniform)
    if all(s in TRUNK for s in uniform.sensors):
        start("events")
        reached["tracks"] = _of_trunk(uniform, config)
        return
    start("calibration")
    calibrated = calibration.calibrate(uniform, config.calibration)
    reached["calibration"] = calibrated.calibration
    # the poses say what could not be had for want of a sensor that failed
    calibrated = replace(calibrated, recording=whole)
    start("orientation")
    orientations = estimate_orientations(calibrated, config.fusion)
    reached["orientations"] = orientations
    start("events")
    found = _contacts(orientations, config)
    feet = [s for s in FOOT.values() if s in orientations.q]
    tracks = Tracks(
        t_s=uniform.t_s,
        rate_hz=uniform.rate_hz,
        events=found,
        q={s: orientations.q[s] for s in feet},
        valid={s: orientations.valid[s] for s in feet},
        turning=calibrated.calibration.turning,
        surface=surface_of(uniform),
        params=config.strides,
        rests=calibrated.calibration.rest,
        turns=turns(*body_yaw_rate(orientations, uniform.rate_hz), uniform.rate_hz, config.turns),
        steps=None if found.events or trunk_sensor(uniform) is None else detect_steps(uniform, config.lumbar),
    )
    reached |= {"events": found, "tracks": tracks}
    start("poses")
    lengths, assumed = body.nominal_body(
        uniform.subject.height_m, uniform.subject.standing_width_m, uniform.subject.shoe
    )
    contacts = {
        side: body.contact_mask(uniform.t_s, found.times(side, "ic"), found.times(side, "tc"))
        for side in SIDES
    }
    reached["body"] = assumed
    posed = withhold_distances(estimate_poses(calibrated, orientations, contacts, lengths, config.poses))
    calibrated = posed.calibrated
    reached |= {"poses": posed.poses, "orientations": posed.orientations, "feet": posed.feet}
    reached["calibration"] = calibrated.calibration
    start("angles")
    joint = angles.joint_angles(
        posed.orientations, calibrated.calibration.zero, posed.poses, uniform.subject.standing_angles_deg
    )
    joint = withhold(joint, posed.poses, posed.orientations)
    reached |= {"angles": joint, "tracks": _whole(tracks, posed, joint)}


def _contacts(orientations: Orientations, config: PipelineConfig) -> GaitEvents:
    """Contacts of the chosen detector, each with the share of all detectors that saw it.

    Without a foot sensor there is no foot-pitch rule: the shanks' detectors agree among themselves.
    """
    found = all_detectors(orientations, config.events, config.consensus)
    feet = any(s in orientations.q for s in FOOT.values())
    agreed = with_confidence if feet and config.detector == "foot_pitch" else consensus
    return agreed(found, config.consensus)


def _of_trunk(uniform: UniformRecording, config: PipelineConfig) -> Tracks:
    """Steps and turns of a single trunk sensor: they need neither rest nor calibration."""
    steps = detect_steps(uniform, config.lumbar)
    signals = uniform.sensors[steps.source]
    vertical, yaw_rate = about_up(signals, uniform.rate_hz, config.lumbar)
    # which way is forward nobody knows without a calibration
    upwards = np.full((len(vertical), 3), np.nan)
    upwards[:, 2] = np.where(signals.valid, vertical, np.nan)
    return Tracks(
        t_s=uniform.t_s,
        rate_hz=uniform.rate_hz,
        events=GaitEvents(()),
        q={},
        valid={},
        surface=surface_of(uniform),
        params=config.strides,
        trunk={steps.source: upwards},
        turns=turns(yaw_rate, signals.valid, uniform.rate_hz, config.turns),
        steps=steps,
    )


def _whole(tracks: Tracks, posed: PoseEstimate, joint: JointAngles) -> Tracks:
    """The tracks with all that the later stages gave; a foot whose sensor failed keeps what it had."""
    better = {s: q for s, q in posed.orientations.q.items() if s in tracks.q}
    acceleration = free_acceleration(posed.calibrated, posed.orientations)
    return replace(
        tracks,
        q={**tracks.q, **better},
        feet=posed.feet,
        angles=joint,
        trunk={
            s: np.where(
                posed.orientations.valid[s][:, None],
                in_walking_frame(acceleration[s], posed.orientations.q[s], tracks.rate_hz),
                np.nan,
            )
            for s in TRUNK
            if s in posed.orientations.q
        },
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
    for name in ("calibration", "orientations", "events", "measured", "poses", "angles"):
        notices.extend(getattr(reached.get(name), "notices", ()))
    notices.extend(reached.get("body", ()))  # type: ignore[arg-type]
    if problem is not None:
        notices.append(problem)
    return Analysis(
        recording=uniform,
        quality=report,
        **{
            name: reached.get(name)  # type: ignore[arg-type]
            for name in ("calibration", "orientations", "poses", "feet", "angles", "tracks", "measured")
        },
        problem=problem,
        notices=tuple(dict.fromkeys(notices)),
        provenance={
            "input_sha256": dict(recording.sha256),
            "parameters_sha256": config.digest,
            "version": version,
            "schema": SCHEMA,
        },
    )
