"""The stages of the chain: each takes the analysis so far and the parameters, and adds its result.

A stage is a pure function (Analysis, PipelineConfig) → Analysis that sets its own field. Failures are raised
as SagittalError; recipes.py keeps the earlier results.
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
from sagittal.core.consistency.court import judge_sensors
from sagittal.core.errors import Notice
from sagittal.core.events.alternation import tell_foot_lag
from sagittal.core.events.bouts import find_bouts
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
    "No sensor could be calibrated. Cadence, step times and turns are from the trunk sensor alone, which "
    "needs no calibration."
)


@dataclass(frozen=True)
class PipelineStage:
    """One step of a recipe.

    Parameters
    ----------
    name : shown in progress and on pages. share : fraction of a typical run completed before it, 0 to 1.
    run : (Analysis, PipelineConfig) → Analysis with `results` set; raises SagittalError.
    results : fields of Analysis that it sets. reads : fields of PipelineConfig that it uses.
        runs_after_problem : runs even if an earlier stage failed, on partial results. tells_share : `run`
        takes a third argument, a callback for its own progress, 0 to 1. let_go : removes data not needed by
        later stages; None = nothing to remove.
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
    """All sensors on one time axis; samples of a sensor that does not measure are invalid."""
    uniform = timeline.synchronise(analysis.source, config.timeline)
    return replace(analysis, uniform=mark_stuck(uniform, config.stuck))


def compare_clocks(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Check the set-up and the consistency of the sensors; late sensors are shifted.

    An incorrect set-up with a known correction is an error, since results based on it would be wrong.
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
    notice = setup.tell("error" if setup.is_sure and config.setup.refuse else "warning")
    spoken = replace(agreed.recording, notices=(*agreed.recording.notices, notice))
    return replace(analysis, setup=setup, agreed=replace(agreed, recording=spoken))


def judge_signals(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """The quality report; an error among its notices becomes the problem of the analysis."""
    uniform, agreed = analysis.recording, analysis.agreed
    # what a slipped sensor measures is left out, not lost
    uniform = uniform if agreed is None or agreed.whole is None else agreed.whole
    report = quality.assess(analysis.source, uniform, config.quality, drop_stuck_sensors(uniform).sensors)
    problem = next((n for n in report.notices if n.severity == "error"), None)
    return replace(analysis, report=report, problem=problem)


def calibrate_sensors(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Sensor-to-segment alignment of each working sensor."""
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
    """Orientation of every segment independently."""
    calibrated = require_stage(analysis.calibrated, "calibration")
    return replace(analysis, fused=estimate_orientations(calibrated, config.fusion))


def detect_contacts(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Contacts of the feet, turns of the body, and steps of the trunk if there are no contacts.

    If no sensor could be calibrated, steps of the trunk remain possible: they need no calibration.
    """
    fused, uniform = analysis.fused, drop_stuck_sensors(analysis.recording)
    if fused is None:
        if analysis.stopped_at != CALIBRATION.name or trunk_sensor(uniform) is None:
            return analysis
        return _fall_back_on_trunk(detect_trunk_steps(analysis, config))
    calibrated = require_stage(analysis.calibrated, "calibration")
    events = _contacts(fused, calibrated, config)
    if not set(uniform.sensors) >= CHAIN:
        lag_notices = tell_foot_lag(events, config.alternation)
        events = replace(events, notices=(*events.notices, *lag_notices)) if lag_notices else events
    trunk_alone = not events.events and trunk_sensor(uniform) is not None
    contacts = DetectedContacts(
        events,
        find_turns(*body_yaw_rate(fused, uniform.rate_hz), uniform.rate_hz, config.turns),
        detect_steps(uniform, config.lumbar) if trunk_alone else None,
    )
    return replace(analysis, contacts=contacts)


def _fall_back_on_trunk(analysis: TakeAnalysis) -> TakeAnalysis:
    """The analysis with the steps of its trunk sensor, noting what stopped the calibration."""
    contacts, problem = require_stage(analysis.contacts, "events"), analysis.problem
    cause = () if problem is None else (replace(problem, severity="warning"),)
    events = replace(contacts.events, notices=(*cause, Notice("trunk_alone", TRUNK_ALONE)))
    return replace(analysis, contacts=replace(contacts, events=events))


def detect_trunk_steps(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Steps and turns from a single trunk sensor: they need neither rest nor calibration."""
    uniform = drop_stuck_sensors(analysis.recording)
    steps = detect_steps(uniform, config.lumbar)
    signals = uniform.sensors[steps.source]
    _, yaw_rate = split_about_vertical(signals, uniform.rate_hz, config.lumbar)
    detected_turns = find_turns(yaw_rate, signals.valid, uniform.rate_hz, config.turns)
    return replace(analysis, contacts=DetectedContacts(GaitEvents(()), detected_turns, steps))


def mount_on_segments(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Alignment refined by standing width and joints; used by all later stages."""
    calibrated = require_stage(analysis.calibrated, "calibration")
    mounted = mount_sensors(calibrated, require_stage(analysis.fused, "orientation"), config.poses)
    give_memory_back()
    used = replace(mounted.calibrated, recording=drop_stuck_sensors(analysis.recording))
    score = score_calibration(used, config.calibration.score, analysis.agreed, mounted.turned_rad)
    return replace(analysis, mounted=mounted, calibration_score=score)


def build_figure(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Poses of the segments and paths of the feet; unreliable distances are suppressed."""
    mounted = require_stage(analysis.mounted, "mounting")
    events, t_s = require_stage(analysis.contacts, "events").events, analysis.recording.t_s
    contacts = {
        side: body.contact_mask(t_s, events.times(side, "ic"), events.times(side, "tc")) for side in SIDES
    }
    return replace(analysis, posed=withhold_distances(estimate_poses(mounted, contacts, config.poses)))


def compute_angles(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Joint angles; unreliable ones are suppressed."""
    posed, mounted = require_stage(analysis.posed, "poses"), require_stage(analysis.mounted, "mounting")
    standing = analysis.recording.subject.standing_angles_deg
    calibration = mounted.calibrated.calibration
    fixed = list_fixed(posed.poses)
    joint = measure_angles(
        posed.orientations, calibration.zero, posed.poses, standing, calibration.posture, fixed
    )
    reliable = withhold(joint, posed.poses, posed.orientations)
    doubtful = {} if analysis.agreed is None else analysis.agreed.doubtful
    return replace(analysis, angles=withhold_at_slips(reliable, doubtful) if doubtful else reliable)


def measure_walk(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Strides and parameters from the results so far; none before the contacts are known."""
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
    tracks = _judge_tracks(analysis, tracks)
    give_memory_back()
    return replace(analysis, tracks=tracks, measured=measure_gait(tracks))


def _judge_tracks(analysis: TakeAnalysis, tracks: Tracks) -> Tracks:
    """The tracks with what the signals of the sensors contradict."""
    steps = None if tracks.events.events else tracks.steps
    bouts = (
        find_bouts(tracks.events, tracks.rests, tracks.bout_params, tracks.standing)
        if steps is None
        else steps.bouts
    )
    treadmill = analysis.source.protocol == "treadmill"
    doubts = judge_sensors(analysis.recording, tracks.events, bouts, treadmill=treadmill)
    return replace(tracks, doubts=doubts) if doubts else tracks


def measure_trunk(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Parameters from the steps of a single trunk sensor."""
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
    tracks = _judge_tracks(analysis, tracks)
    return replace(analysis, tracks=tracks, measured=measure_gait(tracks))


def _contacts(
    orientations: Orientations, calibrated: CalibratedRecording, config: PipelineConfig
) -> GaitEvents:
    """Contacts of the selected detector, each with the fraction of detectors that found it.

    Without a foot sensor there is no foot-pitch rule: the detectors of the shanks form a consensus.
    """
    refined = None
    if config.detector != "foot_pitch":
        motions = measure_foot_movements(calibrated)
        refined = detect_foot_contacts(orientations, config.events, config.contacts, motions)
    detected = all_detectors(orientations, config.events, config.consensus, refined)
    feet = any(s in orientations.q for s in FOOT.values())
    agree = rate_confidence if feet and config.detector != "consensus" else agree_on_contacts
    return agree(detected, config.consensus)


def _standing(analysis: TakeAnalysis) -> tuple[Window, ...]:
    """Windows without movement of the feet; of shanks without foot sensors, else thighs."""
    working = drop_stuck_sensors(analysis.recording)
    for level in (FOOT, SHANK, THIGH):
        instrumented = [s for s in level.values() if s in working.sensors]
        if instrumented:
            return find_rest_windows(working, STANDING, instrumented)
    return ()


def _vertical_acceleration(uniform: UniformRecording, segment: Segment, config: PipelineConfig) -> Floats:
    """Vertical acceleration as (n, 3) of a trunk sensor with unknown forward axis; NaN = unknown."""
    signals = uniform.sensors[segment]
    vertical, _ = split_about_vertical(signals, uniform.rate_hz, config.lumbar)
    upwards = np.full((len(vertical), 3), np.nan)
    upwards[:, 2] = np.where(signals.valid, vertical, np.nan)
    return upwards


def _trunk_acceleration(analysis: TakeAnalysis, config: PipelineConfig) -> dict[Segment, Floats]:
    """Segment → (n, 3) gravity-free acceleration, forward, left, up, m/s²; NaN = not measured."""
    mounted, posed = analysis.mounted, analysis.posed
    if mounted is None or posed is None:
        return {}
    orientations = posed.orientations
    signals, mounts = mounted.calibrated.recording.sensors, mounted.calibrated.calibration.segments
    uniform = drop_stuck_sensors(analysis.recording)
    return {
        s: np.where(
            orientations.valid[s][:, None],
            in_walking_frame(
                remove_gravity(signals[s].acc, signals[s].valid, orientations.q[s], mounts[s]),
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
    ("events", "contacts", "detector", "consensus", "alternation", "lumbar", "turns"),
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
