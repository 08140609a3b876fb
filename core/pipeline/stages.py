"""The stages of the chain: each takes what was reached and the parameters, and adds what it gives.

A stage is a pure function (Analysis, PipelineConfig) → Analysis that sets its own field. What it cannot do it
raises as a SagittalError; recipes.py keeps what was reached before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core import body, calibration, quality, timeline
from sagittal.core.agreement import Agreement, check_agreement
from sagittal.core.agreement.joints import LEG_JOINTS
from sagittal.core.angles.measure import measure_angles
from sagittal.core.angles.withheld import list_fixed, withhold, withhold_at_slips, withhold_distances
from sagittal.core.body.estimate import estimate_poses
from sagittal.core.body.l7s.inputs import remove_gravity
from sagittal.core.body.mounting import mount_sensors
from sagittal.core.body.walking_frame import in_walking_frame
from sagittal.core.calibration.declared import propose_mountings
from sagittal.core.calibration.score import score_calibration
from sagittal.core.errors import Notice
from sagittal.core.events.alternation import tell_foot_lag
from sagittal.core.events.consensus import agree_on_contacts, all_detectors, rate_confidence
from sagittal.core.events.detection import detect_contacts as detect_foot_contacts
from sagittal.core.events.foot_movement import measure_foot_movements
from sagittal.core.events.lumbar import TRUNK, detect_steps, split_about_vertical, trunk_sensor
from sagittal.core.events.result import GaitEvents
from sagittal.core.events.turns import body_yaw_rate, find_turns
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Floats, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.parameters.measure import Tracks, measure_gait
from sagittal.core.parameters.spatial import surface_of
from sagittal.core.pipeline.analysis import DetectedContacts, TakeAnalysis, require_stage
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.pipeline.let_go import (
    forget_magnetometers,
    keep_refined_alone,
    keep_what_is_measured,
    keep_what_poses_read,
)
from sagittal.core.quality.stuck import drop_stuck_sensors, mark_stuck
from sagittal.core.setup.propose import propose_labels, propose_repair
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.memory import give_memory_back
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import STANDING, Window, find_rest_windows

CHAIN: Final[frozenset[Segment]] = frozenset(s for joint in LEG_JOINTS for s in joint)
"""With all of these worn the joints compare the clocks of both feet."""

TRUNK_ALONE: Final = (
    "No sensor could be calibrated. Cadence, step times and turns come from the trunk sensor alone, which "
    "needs no calibration."
)


@dataclass(frozen=True)
class PipelineStage:
    """One step of a recipe.

    Parameters
    ----------
    name : as progress and pages tell it. share : of a typical run that lies before it, 0 to 1.
    run : (Analysis, PipelineConfig) → Analysis with `results` set; raises SagittalError.
    results : fields of Analysis that it sets. reads : fields of PipelineConfig that it takes.
    runs_after_problem : also when an earlier stage could not go on; it takes what was reached.
    tells_share : `run` takes a third argument, a function that it tells the share of its own work, 0 to 1.
    let_go : an Analysis without what no stage behind this one reads; None = all of it is read.
    """

    name: str
    share: float
    run: Callable[..., TakeAnalysis]
    results: tuple[str, ...]
    reads: tuple[str, ...] = ()
    runs_after_problem: bool = False
    tells_share: bool = False
    let_go: Callable[[TakeAnalysis], TakeAnalysis] | None = None


def lay_on_one_axis(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """All sensors on one time axis; samples of a sensor that does not measure are not valid."""
    uniform = timeline.synchronise(analysis.source, config.timeline)
    return replace(analysis, uniform=mark_stuck(uniform, config.stuck))


def compare_clocks(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Whether the set-up is right, and what the sensors say about each other; late ones are laid right.

    A set-up that is wrong, and known how, is an error: numbers of it would be wrong.
    """
    uniform = require_stage(analysis.uniform, "timeline")
    setup = propose_repair(analysis.source, drop_stuck_sensors(uniform), config.setup, config.agreement)
    if setup is None:
        agreed = check_agreement(uniform, config.agreement, config.timeline)
        setup = propose_labels(uniform, agreed)
    else:
        agreed = Agreement(uniform)
    if setup is None:
        return replace(analysis, setup=None, agreed=agreed)
    told = setup.tell("error" if setup.is_sure and config.setup.refuse else "warning")
    spoken = replace(agreed.recording, notices=(*agreed.recording.notices, told))
    return replace(analysis, setup=setup, agreed=replace(agreed, recording=spoken))


def judge_signals(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """The quality report; an error among its notices is the problem of the analysis."""
    uniform, agreed = analysis.recording, analysis.agreed
    # what a slipped sensor measures is left out, not lost
    uniform = uniform if agreed is None or agreed.whole is None else agreed.whole
    report = quality.assess(analysis.source, uniform, config.quality, drop_stuck_sensors(uniform).sensors)
    problem = next((n for n in report.notices if n.severity == "error"), None)
    return replace(analysis, report=report, problem=problem)


def calibrate_sensors(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """How each working sensor sits on its segment."""
    working = drop_stuck_sensors(analysis.recording)
    calibrated = calibration.calibrate(working, config.calibration)
    setup = analysis.setup
    if setup is None or setup.mounting:
        setup = propose_mountings(working, config.calibration)
    if setup is not None and setup.mounting:
        notices = (*calibrated.calibration.notices, setup.tell("warning"))
        calibrated = replace(calibrated, calibration=replace(calibrated.calibration, notices=notices))
    score = score_calibration(calibrated, config.calibration.score, analysis.agreed)
    # the poses say what could not be had for want of a sensor that failed
    calibrated = replace(calibrated, recording=analysis.recording)
    return replace(analysis, setup=setup, calibrated=calibrated, calibration_score=score)


def orient_segments(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Orientation of every segment on its own."""
    calibrated = require_stage(analysis.calibrated, "calibration")
    return replace(analysis, fused=estimate_orientations(calibrated, config.fusion))


def detect_contacts(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Contacts of the feet, turns of the body, and steps of the trunk where no contact was found.

    Where no sensor could be calibrated, the trunk's steps are left: they need no calibration.
    """
    fused, uniform = analysis.fused, drop_stuck_sensors(analysis.recording)
    if fused is None:
        if analysis.stopped_at != CALIBRATION.name or trunk_sensor(uniform) is None:
            return analysis
        return _fall_back_on_trunk(detect_trunk_steps(analysis, config))
    calibrated = require_stage(analysis.calibrated, "calibration")
    events = _contacts(fused, calibrated, config)
    if not set(uniform.sensors) >= CHAIN:
        told = tell_foot_lag(events, config.alternation)
        events = replace(events, notices=(*events.notices, *told)) if told else events
    alone = not events.events and trunk_sensor(uniform) is not None
    contacts = DetectedContacts(
        events,
        find_turns(*body_yaw_rate(fused, uniform.rate_hz), uniform.rate_hz, config.turns),
        detect_steps(uniform, config.lumbar) if alone else None,
    )
    return replace(analysis, contacts=contacts)


def _fall_back_on_trunk(analysis: TakeAnalysis) -> TakeAnalysis:
    """The analysis with the steps of its trunk sensor, which say what stopped the calibration."""
    contacts, problem = require_stage(analysis.contacts, "events"), analysis.problem
    told = () if problem is None else (replace(problem, severity="warning"),)
    events = replace(contacts.events, notices=(*told, Notice("trunk_alone", TRUNK_ALONE)))
    return replace(analysis, contacts=replace(contacts, events=events))


def detect_trunk_steps(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Steps and turns of a single trunk sensor: they need neither rest nor calibration."""
    uniform = drop_stuck_sensors(analysis.recording)
    steps = detect_steps(uniform, config.lumbar)
    signals = uniform.sensors[steps.source]
    _, yaw_rate = split_about_vertical(signals, uniform.rate_hz, config.lumbar)
    found = find_turns(yaw_rate, signals.valid, uniform.rate_hz, config.turns)
    return replace(analysis, contacts=DetectedContacts(GaitEvents(()), found, steps))


def mount_on_segments(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Mountings as standing width and joints show them; everything behind takes these."""
    calibrated = require_stage(analysis.calibrated, "calibration")
    mounted = mount_sensors(calibrated, require_stage(analysis.fused, "orientation"), config.poses)
    give_memory_back()
    used = replace(mounted.calibrated, recording=drop_stuck_sensors(analysis.recording))
    score = score_calibration(used, config.calibration.score, analysis.agreed, mounted.turned_rad)
    return replace(analysis, mounted=mounted, calibration_score=score)


def build_figure(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Poses of the segments and paths of the feet; distances that cannot be stood behind are withheld."""
    mounted = require_stage(analysis.mounted, "mounting")
    events, t_s = require_stage(analysis.contacts, "events").events, analysis.recording.t_s
    contacts = {
        side: body.contact_mask(t_s, events.times(side, "ic"), events.times(side, "tc")) for side in SIDES
    }
    return replace(analysis, posed=withhold_distances(estimate_poses(mounted, contacts, config.poses)))


def compute_angles(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Joint angles; those that the estimator cannot stand behind are withheld."""
    posed, mounted = require_stage(analysis.posed, "poses"), require_stage(analysis.mounted, "mounting")
    standing = analysis.recording.subject.standing_angles_deg
    calibration = mounted.calibrated.calibration
    fixed = list_fixed(posed.poses)
    joint = measure_angles(
        posed.orientations, calibration.zero, posed.poses, standing, calibration.posture, fixed
    )
    shown = withhold(joint, posed.poses, posed.orientations)
    doubtful = {} if analysis.agreed is None else analysis.agreed.doubtful
    return replace(analysis, angles=withhold_at_slips(shown, doubtful) if doubtful else shown)


def measure_walk(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Strides and parameters of what was reached; nothing before the contacts are known."""
    fused, contacts, calibrated = analysis.fused, analysis.contacts, analysis.calibration
    if fused is None or contacts is None or calibrated is None:
        steps = measure_trunk(analysis, config)
        # what stopped the calibration did not stop the analysis
        return steps if steps.measured is None else replace(steps, problem=None, stopped_at=None)
    uniform, complete = analysis.recording, analysis.angles is not None
    feet = [s for s in FOOT.values() if s in fused.q]
    # a foot whose sensor failed keeps what it had
    better = analysis.orientations if complete and analysis.orientations is not None else fused
    tracks = Tracks(
        t_s=uniform.t_s,
        rate_hz=uniform.rate_hz,
        events=contacts.events,
        q={s: better.q.get(s, fused.q[s]) for s in feet},
        valid={s: fused.valid[s] for s in feet},
        turning=calibrated.turning,
        feet=analysis.feet if complete else None,
        angles=analysis.angles,
        trunk=_trunk_acceleration(analysis, config) if complete else {},
        surface=surface_of(uniform),
        params=config.strides,
        bout_params=config.bouts,
        rests=calibrated.rest,
        standing=_standing(analysis),
        turns=contacts.turns,
        steps=contacts.steps,
    )
    give_memory_back()
    return replace(analysis, tracks=tracks, measured=measure_gait(tracks))


def measure_trunk(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Parameters of the steps of a single trunk sensor."""
    contacts, uniform = analysis.contacts, analysis.recording
    if contacts is None or contacts.steps is None:
        return analysis
    source = contacts.steps.source
    tracks = Tracks(
        t_s=uniform.t_s,
        rate_hz=uniform.rate_hz,
        events=contacts.events,
        q={},
        valid={},
        surface=surface_of(uniform),
        params=config.strides,
        bout_params=config.bouts,
        trunk={source: _vertical_acceleration(uniform, source, config)},
        turns=contacts.turns,
        steps=contacts.steps,
    )
    return replace(analysis, tracks=tracks, measured=measure_gait(tracks))


def _contacts(
    orientations: Orientations, calibrated: CalibratedRecording, config: PipelineConfig
) -> GaitEvents:
    """Contacts of the chosen detector, each with the share of all detectors that saw it.

    Without a foot sensor there is no foot-pitch rule: the shanks' detectors agree among themselves.
    """
    refined = None
    if config.detector != "foot_pitch":
        motions = measure_foot_movements(calibrated)
        refined = detect_foot_contacts(orientations, config.events, config.contacts, motions, config.ways)
    found = all_detectors(orientations, config.events, config.consensus, refined)
    feet = any(s in orientations.q for s in FOOT.values())
    agree = rate_confidence if feet and config.detector != "consensus" else agree_on_contacts
    return agree(found, config.consensus)


def _standing(analysis: TakeAnalysis) -> tuple[Window, ...]:
    """When no foot moved; shanks where no foot is worn, else thighs."""
    working = drop_stuck_sensors(analysis.recording)
    for level in (FOOT, SHANK, THIGH):
        worn = [s for s in level.values() if s in working.sensors]
        if worn:
            return find_rest_windows(working, STANDING, worn)
    return ()


def _vertical_acceleration(uniform: UniformRecording, segment: Segment, config: PipelineConfig) -> Floats:
    """Acceleration (n, 3), upwards alone, of a trunk sensor whose forward nobody knows; NaN = not known."""
    signals = uniform.sensors[segment]
    vertical, _ = split_about_vertical(signals, uniform.rate_hz, config.lumbar)
    upwards = np.full((len(vertical), 3), np.nan)
    upwards[:, 2] = np.where(signals.valid, vertical, np.nan)
    return upwards


def _trunk_acceleration(analysis: TakeAnalysis, config: PipelineConfig) -> dict[Segment, Floats]:
    """Segment → (n, 3) acceleration free of gravity, forward, left, up, m/s²; NaN = not measured."""
    mounted, posed = analysis.mounted, analysis.posed
    if mounted is None or posed is None:
        return {}
    orientations = posed.orientations
    worn, mounts = mounted.calibrated.recording.sensors, mounted.calibrated.calibration.segments
    uniform = drop_stuck_sensors(analysis.recording)
    return {
        s: np.where(
            orientations.valid[s][:, None],
            in_walking_frame(
                remove_gravity(worn[s].acc, worn[s].valid, orientations.q[s], mounts[s]),
                orientations.q[s],
                analysis.recording.rate_hz,
            ),
            np.nan,
        )
        if s in orientations.q
        else _vertical_acceleration(uniform, s, config)
        for s in TRUNK
        if s in orientations.q or s in uniform.sensors
    }


TIMELINE: Final = PipelineStage("timeline", 0.0, lay_on_one_axis, ("uniform",), ("timeline", "stuck"))
AGREEMENT: Final = PipelineStage(
    "agreement", 0.02, compare_clocks, ("agreed",), ("setup", "agreement", "timeline")
)
QUALITY: Final = PipelineStage(
    "quality", 0.03, judge_signals, ("report",), ("quality",), let_go=forget_magnetometers
)
CALIBRATION: Final = PipelineStage("calibration", 0.05, calibrate_sensors, ("calibrated",), ("calibration",))
ORIENTATION: Final = PipelineStage("orientation", 0.1, orient_segments, ("fused",), ("fusion",))
EVENTS: Final = PipelineStage(
    "events",
    0.14,
    detect_contacts,
    ("contacts",),
    ("events", "contacts", "ways", "detector", "consensus", "alternation", "lumbar", "turns"),
    runs_after_problem=True,
)
TRUNK_EVENTS: Final = PipelineStage("events", 0.14, detect_trunk_steps, ("contacts",), ("lumbar", "turns"))
MOUNTING: Final = PipelineStage(
    "mounting", 0.15, mount_on_segments, ("mounted",), ("poses", "calibration"), let_go=keep_what_poses_read
)
POSES: Final = PipelineStage("poses", 0.4, build_figure, ("posed",), ("poses",), let_go=keep_refined_alone)
ANGLES: Final = PipelineStage("angles", 0.95, compute_angles, ("angles",), let_go=keep_what_is_measured)
PARAMETERS: Final = PipelineStage(
    "parameters", 0.98, measure_walk, ("tracks", "measured"), ("strides", "bouts"), runs_after_problem=True
)
TRUNK_PARAMETERS: Final = PipelineStage(
    "parameters", 0.98, measure_trunk, ("tracks", "measured"), ("lumbar", "strides", "bouts"),
    runs_after_problem=True,
)  # fmt: skip
