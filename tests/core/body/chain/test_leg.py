"""A take of squats, calibrated by the fixed offset, through the chain to joint angles."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import radians

import numpy as np
import pytest

from sagittal.core.angles.measure import measure_angles
from sagittal.core.body.chain.leg import estimate_leg
from sagittal.core.calibration.fixed_offset import make_fixed_mounts
from sagittal.core.calibration.known_mounts import FIXED_OFFSET, calibrate_with_mounts
from sagittal.core.errors import CalibrationError, EstimationError
from sagittal.core.frames import Segment, Side
from sagittal.core.rotation import about, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.simulate import SquatSimulation
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.squat_chain import measure_leg
from sagittal.core.squat.joints import JOINTS
from sagittal.core.timeline import synchronise
from tests.core.body.chain.squats import HEIGHT_M, squat_on


@cache
def recorded(side: Side) -> tuple[SquatSimulation, CalibratedRecording]:
    simulation = squat_on(side, 100.0, MEMS, repetitions=3)
    return simulation, calibrate_with_mounts(
        synchronise(simulation.recording), make_fixed_mounts(side), "fixed_offset", FIXED_OFFSET
    )


@pytest.mark.slow
@pytest.mark.parametrize("side", ["right", "left"])
def test_squats_from_a_recording_with_noise_and_biases(side: Side) -> None:
    recording, calibrated = recorded(side)
    leg = estimate_leg(calibrated, measure_leg(HEIGHT_M, side))
    angles = measure_angles(leg.orientations, calibrated.calibration.zero)
    truth = recording.truth.subtract_standing()
    for joint in JOINTS:
        name = f"{joint}_{side[0]}"
        error = angles.angles[name] - truth[name][: len(angles.t_s)]
        assert np.degrees(np.sqrt(np.nanmean(error**2))) < (2.0 if joint == "hip_rotation" else 1.0), name
    assert np.isfinite(angles.angles[f"knee_flexion_{side[0]}"][leg.first :]).all()
    assert np.isnan(angles.angles[f"knee_flexion_{side[0]}"][: leg.first]).all()


@pytest.mark.slow
def test_after_a_silence_uncertain_angles_are_withheld() -> None:
    _, calibrated = recorded("right")
    sensors = dict(calibrated.recording.sensors)
    valid = sensors["thigh_r"].valid.copy()
    valid[800:900] = False
    sensors["thigh_r"] = replace(sensors["thigh_r"], valid=valid)
    lost = replace(calibrated, recording=replace(calibrated.recording, sensors=sensors))
    known_valid = estimate_leg(lost, measure_leg(HEIGHT_M, "right")).orientations.valid
    assert known_valid["shank_r"][800:900].all()
    assert not known_valid["thigh_r"][800:900].any()
    assert not known_valid["pelvis"][800:900].any()
    assert known_valid["thigh_r"][1000:].all(), "gravity shows the knee again"


@pytest.mark.parametrize(
    ("segment", "axis", "deg", "refused"),
    [
        ("shank_r", 2, 50.0, True),
        ("shank_r", 1, 50.0, True),
        ("thigh_r", 1, 180.0, True),
        ("shank_r", 1, 180.0, True),
        ("pelvis", 0, 90.0, True),
        ("thigh_r", 2, 15.0, False),
        ("shank_r", 1, -15.0, False),
    ],
)
def test_a_mounting_that_was_not_kept_is_refused(
    segment: Segment, axis: int, deg: float, refused: bool
) -> None:
    _, calibrated = recorded("right")
    mounts = {s: m.R_segment_sensor for s, m in calibrated.calibration.segments.items()}
    mounts[segment] = to_matrix(about(axis, radians(deg))) @ mounts[segment]
    if not refused:
        assert calibrate_with_mounts(
            calibrated.recording, mounts, "fixed_offset", FIXED_OFFSET
        ).calibration.segments
        return
    with pytest.raises(CalibrationError) as caught:
        calibrate_with_mounts(calibrated.recording, mounts, "fixed_offset", FIXED_OFFSET)
    assert (caught.value.code, caught.value.sensor) == ("mounting_not_as_agreed", segment)


def test_what_the_chain_needs_is_said() -> None:
    _, calibrated = recorded("right")
    with pytest.raises(EstimationError) as caught:
        estimate_leg(calibrated, measure_leg(HEIGHT_M, "left"))
    assert caught.value.code == "segments_missing"
    sensors = dict(calibrated.recording.sensors)
    silent = np.zeros(len(calibrated.recording.t_s), bool)
    sensors["pelvis"] = replace(sensors["pelvis"], valid=silent)
    lost = replace(calibrated, recording=replace(calibrated.recording, sensors=sensors))
    with pytest.raises(EstimationError) as caught:
        estimate_leg(lost, measure_leg(HEIGHT_M, "right"))
    assert caught.value.code == "no_standing"
    with pytest.raises(CalibrationError) as refused:
        calibrate_with_mounts(calibrated.recording, {"chest": np.eye(3)}, "fixed_offset", FIXED_OFFSET)
    assert refused.value.code == "no_segment"
