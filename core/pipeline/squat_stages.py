"""The stages of a squat on one leg (docs/science/squat.md)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from core.angles.measure import measure_angles
from core.body.chain.geometry import LegGeometry
from core.body.chain.leg import estimate_leg
from core.body.chain.model import leg_segments
from core.body.model import NOMINAL_HEIGHT_M
from core.calibration.fixed_offset import make_fixed_mounts
from core.calibration.known_mounts import FIXED_OFFSET, TABLE_TOP, calibrate_with_mounts
from core.calibration.score import score_calibration
from core.calibration.table_top import calibrate_table_top, crop, find_worn_standing
from core.errors import Notice
from core.pipeline.analysis import TakeAnalysis, require_stage
from core.pipeline.config import PipelineConfig
from core.pipeline.stages import PipelineStage
from core.quality.stuck import drop_stuck_sensors
from core.squat.measures import measure_squats
from core.squat.side import find_squat_side

AGREED: Final = Notice(
    "mounting_agreed",
    "The sensors are taken to sit as agreed for squats: on the flat of the shin, the front of the thigh, the "
    "back. Ten degrees beside it turn the angles by as much.",
    severity="info",
)


NO_HEIGHT: Final = Notice(
    "height_assumed",
    f"Body height is not given; {NOMINAL_HEIGHT_M:.2f} m is taken. The way of the hip down depends on it, "
    "the angles hardly.",
    severity="info",
)


def calibrate_squat(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Mountings by the fixed offset or from the table, biases and zero from standing."""
    working = drop_stuck_sensors(analysis.recording)
    side, rest = find_squat_side(working), config.calibration.rest
    if config.squat.mounting == "table_top":
        leg = {s: working.sensors[s] for s in leg_segments(side)}
        taken = replace(require_stage(analysis.uniform, "timeline"), sensors=leg)
        standing = find_worn_standing(taken, config.squat.table_top)
        found = calibrate_table_top(crop(taken, standing[1]), config.squat.table_top)
        told = found.notices
        calibrated = calibrate_with_mounts(
            working, found.R_segment_sensor, "table_top", TABLE_TOP, rest, standing[0]
        )
    else:
        told = (AGREED,)
        mounts = make_fixed_mounts(side)
        calibrated = calibrate_with_mounts(working, mounts, "fixed_offset", FIXED_OFFSET, rest)
    assumed = () if analysis.recording.subject.height_m is not None else (NO_HEIGHT,)
    calibration = replace(calibrated.calibration, notices=(*told, *assumed))
    calibrated = replace(calibrated, calibration=calibration)
    leg_alone = replace(working, sensors={s: working.sensors[s] for s in calibration.segments})
    score = score_calibration(
        replace(calibrated, recording=leg_alone), config.calibration.score, analysis.agreed
    )
    calibrated = replace(calibrated, recording=analysis.recording)
    return replace(analysis, calibrated=calibrated, calibration_score=score)


def estimate_squat(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Orientations of the leg that stands on its foot."""
    calibrated = require_stage(analysis.calibrated, "calibration")
    side = find_squat_side(drop_stuck_sensors(analysis.recording))
    geometry = LegGeometry.from_height(analysis.recording.subject.height_m, side)
    return replace(analysis, leg=estimate_leg(calibrated, geometry, config.squat.chain))


def compute_squat_angles(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Joint angles of the leg, from standing; the other leg is not asked for."""
    leg = require_stage(analysis.leg, "poses")
    zero = require_stage(analysis.calibrated, "calibration").calibration.zero
    standing = analysis.recording.subject.standing_angles_deg
    angles = measure_angles(leg.orientations, zero, standing_deg=standing)
    told = tuple(n for n in angles.notices if n.code != "joint_missing")
    return replace(analysis, angles=replace(angles, notices=told))


def measure_squat(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Repetitions, depth, times, how the knee falls inward."""
    leg, angles = require_stage(analysis.leg, "poses"), require_stage(analysis.angles, "angles")
    recording = drop_stuck_sensors(analysis.recording)
    squats = measure_squats(angles, leg, leg.side, recording, config.squat.repetitions)
    return replace(analysis, squats=squats)


SQUAT_CALIBRATION: Final = PipelineStage(
    "calibration", 0.3, calibrate_squat, ("calibrated",), ("calibration", "squat")
)
SQUAT_LEG: Final = PipelineStage("poses", 0.4, estimate_squat, ("leg",), ("squat",))
SQUAT_ANGLES: Final = PipelineStage("angles", 0.8, compute_squat_angles, ("angles",))
SQUAT_PARAMETERS: Final = PipelineStage("parameters", 0.9, measure_squat, ("squats",), ("squat",))
