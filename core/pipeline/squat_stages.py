"""Stages of single-leg squats, of one leg or of both (docs/science/squat.md)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from sagittal.core.angles.measure import measure_angles
from sagittal.core.body.chain.figure import draw_legs
from sagittal.core.body.chain.geometry import LegGeometry
from sagittal.core.body.chain.leg import estimate_leg
from sagittal.core.body.chain.model import leg_segments
from sagittal.core.body.model import NOMINAL_HEIGHT_M
from sagittal.core.calibration.fixed_offset import make_fixed_mounts
from sagittal.core.calibration.known_mounts import FIXED_OFFSET, TABLE_TOP, calibrate_with_mounts
from sagittal.core.calibration.score import score_calibration
from sagittal.core.calibration.standing_leg import find_standing_legs
from sagittal.core.calibration.table_top import calibrate_table_top, crop, find_worn_standing
from sagittal.core.errors import Notice
from sagittal.core.frames import SUFFIX
from sagittal.core.message import Message
from sagittal.core.pipeline.analysis import TakeAnalysis, require_stage
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.pipeline.stages import PipelineStage
from sagittal.core.quality.stuck import drop_stuck_sensors
from sagittal.core.squat.measures import measure_squats
from sagittal.core.squat.side import find_squat_sides

AGREED: Final = Notice(
    "mounting_agreed",
    "The sensors are assumed to be placed as specified for squats: flat of the shin, front of the thigh, "
    "lower back. A misplacement of ten degrees rotates the angles by as much.",
    severity="info",
)


NO_HEIGHT: Final = Notice(
    "height_assumed",
    Message(
        "Body height is missing; {NOMINAL_HEIGHT_M:.2f} m is assumed. Hip displacement depends on it; "
        "angles hardly do.",
        NOMINAL_HEIGHT_M=NOMINAL_HEIGHT_M,
    ),
    severity="info",
)


def calibrate_squat(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Alignment by the fixed offset or from the table, biases and zero from standing."""
    working = drop_stuck_sensors(analysis.recording)
    sides, rest_params = find_squat_sides(working), config.calibration.rest
    if config.squat.mounting == "table_top":
        leg_sensors = {s: working.sensors[s] for side in sides for s in leg_segments(side)}
        on_table = replace(require_stage(analysis.uniform, "timeline"), sensors=leg_sensors)
        standing = find_worn_standing(on_table, config.squat.table_top)
        table_mounts = calibrate_table_top(crop(on_table, standing[1]), config.squat.table_top)
        alignment_notices = table_mounts.notices
        calibrated = calibrate_with_mounts(
            working, table_mounts.R_segment_sensor, "table_top", TABLE_TOP, rest_params, standing[0]
        )
    else:
        alignment_notices = (AGREED,)
        mounts = make_fixed_mounts(*sides)
        calibrated = calibrate_with_mounts(working, mounts, "fixed_offset", FIXED_OFFSET, rest_params)
    assumed = () if analysis.recording.subject.height_m is not None else (NO_HEIGHT,)
    calibration = replace(calibrated.calibration, notices=(*alignment_notices, *assumed))
    calibrated = replace(calibrated, calibration=calibration)
    legs_alone = replace(working, sensors={s: working.sensors[s] for s in calibration.segments})
    score = score_calibration(
        replace(calibrated, recording=legs_alone), config.calibration.score, analysis.agreed
    )
    calibrated = replace(calibrated, recording=analysis.recording)
    return replace(analysis, calibrated=calibrated, calibration_score=score)


def estimate_squat(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Orientations of the legs, each from its supporting foot up, and the poses."""
    calibrated = require_stage(analysis.calibrated, "calibration")
    height, stands = analysis.recording.subject.height_m, find_standing_legs(calibrated)
    legs = {
        side: estimate_leg(
            calibrated, LegGeometry.from_height(height, side), config.squat.chain, stands[side]
        )
        for side in find_squat_sides(drop_stuck_sensors(analysis.recording))
    }
    return replace(analysis, legs=legs, posed=draw_legs(legs, height))


def compute_squat_angles(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Joint angles of each leg by its own chain, relative to standing; only for legs with sensors."""
    legs, posed = require_stage(analysis.legs, "poses"), require_stage(analysis.posed, "poses")
    zero = require_stage(analysis.calibrated, "calibration").calibration.zero
    standing = analysis.recording.subject.standing_angles_deg
    joined = measure_angles(posed.orientations, zero, standing_deg=standing)
    merged, offset = dict(joined.angles), dict(joined.zero_offset)
    notices = joined.notices
    if len(legs) > 1:
        # the shared pelvis is a mean: hips are measured against that of their own chain
        own = {side: measure_angles(leg.orientations, zero) for side, leg in legs.items()}
        for side, of_leg in own.items():
            hip = [n for n in of_leg.angles if n.startswith("hip_") and n.endswith(f"_{SUFFIX[side]}")]
            merged |= {name: of_leg.angles[name] for name in hip}
            offset |= {name: of_leg.zero_offset[name] for name in hip}
        notices = tuple(dict.fromkeys((*notices, *(n for a in own.values() for n in a.notices))))
    other_notices = tuple(n for n in notices if n.code != "joint_missing")
    return replace(analysis, angles=replace(joined, angles=merged, zero_offset=offset, notices=other_notices))


def measure_squat(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Repetitions of each leg with depth, times and knee valgus."""
    legs, angles = require_stage(analysis.legs, "poses"), require_stage(analysis.angles, "angles")
    recording = drop_stuck_sensors(analysis.recording)
    squats = tuple(
        measure_squats(angles, leg, side, recording, config.squat.repetitions) for side, leg in legs.items()
    )
    return replace(analysis, squats=squats)


SQUAT_CALIBRATION: Final = PipelineStage(
    "calibration", 0.3, calibrate_squat, ("calibrated",), ("calibration", "squat")
)
SQUAT_LEG: Final = PipelineStage("poses", 0.4, estimate_squat, ("legs", "posed"), ("squat",))
SQUAT_ANGLES: Final = PipelineStage("angles", 0.8, compute_squat_angles, ("angles",))
SQUAT_PARAMETERS: Final = PipelineStage("parameters", 0.9, measure_squat, ("squats",), ("squat",))
