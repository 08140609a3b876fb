"""Forward axes that calibration took wrongly are found by the joints, and turned."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, radians

import numpy as np
import pytest

from sagittal.core import calibration
from sagittal.core.body import nominal_body
from sagittal.core.body.erkf.headings import (
    align_forward_axes,
    heading_errors,
    judge_turned_axes,
    turn_forward_axes,
)
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.tree import PRESETS
from sagittal.core.frames import R_NEUTRAL, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, angle_between, from_matrix, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import index_window
from tests.helpers.walks import simulated

WHOLE = PRESETS["lower_body7"]


def take(
    seed: int, wrong: dict[Segment, float]
) -> tuple[CalibratedRecording, Orientations, dict[Segment, float]]:
    """Calibrated walk with some wrong anterior axes, and the errors found, degrees."""
    recording, _ = simulated("fast_with_turns", seed)
    calibrated = calibration.calibrate(recording)
    segments = dict(calibrated.calibration.segments)
    for segment, angle in wrong.items():
        was = segments[segment]
        mount = to_matrix(about(1, radians(angle))) @ was.R_segment_sensor
        segments[segment] = replace(was, R_segment_sensor=mount)
    calibrated = replace(calibrated, calibration=replace(calibrated.calibration, segments=segments))
    orientations = estimate_orientations(calibrated)
    body, _ = nominal_body(recording.subject.height_m)
    result = heading_errors(calibrated, orientations, body, WHOLE, ErkfParams.offline())
    return calibrated, orientations, {s: degrees(x) for s, x in result.items()}


@pytest.mark.sweep
@pytest.mark.parametrize("wrong", [{"thigh_l": 25.0}, {"shank_r": -20.0, "foot_l": 15.0}, {"pelvis": 20.0}])
def test_a_wrong_forward_axis_is_found_by_its_size_and_sign(wrong: dict[Segment, float]) -> None:
    _, _, without = take(3, {})
    _, _, trial = take(3, wrong)
    change = {s: trial[s] - without[s] for s in WHOLE}
    for segment, angle in wrong.items():
        assert change[segment] == pytest.approx(-angle, abs=4.0)
    for segment in set(WHOLE) - set(wrong):
        assert abs(change[segment]) < 4.0


@pytest.mark.sweep
def test_a_good_calibration_is_left_nearly_as_it_is() -> None:
    for seed in (2, 3, 4):
        _, _, trial = take(seed, {})
        assert max(abs(x) for x in trial.values()) < 8.0
        assert np.median(list(trial.values())) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.sweep
def test_after_turning_everybody_still_faces_ahead_at_rest() -> None:
    calibrated, orientations, trial = take(3, {"thigh_l": 25.0})
    calibrated, orientations = turn_forward_axes(
        calibrated, orientations, {s: radians(x) for s, x in trial.items()}
    )
    zero = index_window(calibrated.calibration.zero, orientations.rate_hz)
    middle = (zero.start + zero.stop) // 2
    for segment in WHOLE:
        apart = angle_between(orientations.q[segment][middle : middle + 1], from_matrix(R_NEUTRAL)[None])
        assert degrees(float(apart[0])) < 1.0


@pytest.mark.sweep
def test_nobody_walking_means_nothing_is_found() -> None:
    recording, _ = simulated("fast_with_turns", 3)
    calibrated = calibration.calibrate(recording)
    still = replace(calibrated, calibration=replace(calibrated.calibration, walking=()))
    body, _ = nominal_body(recording.subject.height_m)
    assert heading_errors(still, estimate_orientations(calibrated), body, WHOLE, ErkfParams.offline()) == {}


@pytest.mark.sweep
def test_passes_are_repeated_until_a_large_error_is_gone() -> None:
    calibrated, orientations, without = take(3, {})
    body, _ = nominal_body(calibrated.recording.subject.height_m)
    wrong, turned_wrong, _ = take(3, {"shank_r": -30.0})
    right, _, small = align_forward_axes(calibrated, orientations, body, WHOLE, ErkfParams.offline())
    second, _, large = align_forward_axes(wrong, turned_wrong, body, WHOLE, ErkfParams.offline())
    assert degrees(small["shank_r"]) == pytest.approx(without["shank_r"], abs=0.5)
    assert degrees(large["shank_r"] - small["shank_r"]) == pytest.approx(30.0, abs=0.5)
    for segment in WHOLE:
        mounts = (c.calibration.segments[segment].R_segment_sensor for c in (right, second))
        q, p = (from_matrix(m)[None] for m in mounts)
        assert degrees(float(angle_between(q, p)[0])) < 1.0, segment


def test_what_was_turned_is_told_as_health() -> None:
    notices = {
        f.of: f
        for f in judge_turned_axes({"pelvis": 0.0, "thigh_r": radians(-20.0), "foot_l": radians(170.0)})
    }
    assert [notices[s].verdict for s in ("pelvis", "thigh_r", "foot_l")] == ["good", "warn", "bad"]
    assert notices["thigh_r"].value == pytest.approx(20.0)


@pytest.mark.sweep
def test_an_axis_turned_right_round_is_not_told_as_more_than_half_a_turn() -> None:
    wrong, orientations, _ = take(3, {"shank_r": 180.0})
    body, _ = nominal_body(wrong.recording.subject.height_m)
    _, _, total = align_forward_axes(wrong, orientations, body, WHOLE, ErkfParams.offline())
    assert 170.0 < abs(degrees(total["shank_r"])) <= 180.0
