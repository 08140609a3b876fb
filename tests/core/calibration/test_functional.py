"""Swings of the legs and bows of the trunk: found where they are, and the mountings they show."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import radians

import numpy as np
import pytest

from sagittal.core.agreement import check_agreement
from sagittal.core.angles.measure import measure_angles
from sagittal.core.calibration import calibrate
from sagittal.core.calibration.functional import FunctionalParams, find_functional_movements
from sagittal.core.calibration.live_attempt import WornSensors
from sagittal.core.calibration.score import score_calibration
from sagittal.core.errors import ParameterError
from sagittal.core.frames import SEGMENTS, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.online.calibrating import LiveCalibrator
from sagittal.core.rotation import to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import find_runs
from sagittal.core.simulate import FunctionalTruth, RecordingSetup, SwingsAndBows, simulate_swings_and_bows
from sagittal.core.timeline import synchronise
from tests.helpers.live_agreement import cut_blocks
from tests.helpers.walks import only, rms_deg, simulated

LEGS = tuple(s for s in SEGMENTS if s not in ("pelvis", "chest"))


@cache
def take(seed: int = 0, does: SwingsAndBows | None = None) -> tuple[UniformRecording, FunctionalTruth]:
    swings_and_bows = simulate_swings_and_bows(does, seed=seed, setup=RecordingSetup())
    return synchronise(swings_and_bows.recording), swings_and_bows.truth


def find_errors(calibrated: CalibratedRecording, truth: FunctionalTruth) -> dict[Segment, float]:
    """Helical angle between the found and the true mounting, degrees."""
    errors = {}
    for s, x in calibrated.calibration.segments.items():
        off = x.R_segment_sensor @ to_matrix(truth.mounts[s].q_segment_sensor).T
        errors[s] = float(np.degrees(np.arccos(np.clip(0.5 * (np.trace(off) - 1.0), -1.0, 1.0))))
    return errors


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_random_mountings_come_out_within_two_degrees(seed: int) -> None:
    recording, truth = take(seed)
    calibrated = calibrate(recording)
    errors = find_errors(calibrated, truth)
    assert set(errors) == set(truth.mounts)
    assert max(errors.values()) < 2.0, errors
    calibration = calibrated.calibration
    assert {calibration.segments[s].method for s in LEGS} == {"hip_swing"}
    assert calibration.segments["pelvis"].method == "trunk_bow"
    assert calibration.walking == ()
    assert calibration.notices == ()


@pytest.mark.slow
def test_windows_and_repetitions_are_those_that_were_done() -> None:
    recording, truth = take()
    functional_movements = find_functional_movements(recording, FunctionalParams())
    masks = {
        "swing_left": functional_movements.swings["left"],
        "swing_right": functional_movements.swings["right"],
        "bow": functional_movements.bows,
    }
    for kind, mask in masks.items():
        (phase,) = [p for p in truth.phases if p.kind == kind]
        ((a, b),) = find_runs(mask)
        assert a / recording.rate_hz == pytest.approx(phase.start_s, abs=1.0)
        assert b / recording.rate_hz == pytest.approx(phase.end_s, abs=1.0)
    facts = calibrate(recording).calibration.diagnostics
    assert [facts[s]["repetitions"] for s in ("thigh_r", "foot_l", "pelvis")] == [12, 12, 6]  # type: ignore[index]


def test_a_walk_holds_none_and_a_walk_beside_swings_keeps_its_own() -> None:
    walk, _ = simulated()
    assert not find_functional_movements(walk, FunctionalParams()).anywhere.any()
    assert "hip_swing" not in {x.method for x in calibrate(walk).calibration.segments.values()}


def test_what_was_not_done_is_not_known() -> None:
    recording, truth = take(3, SwingsAndBows(bows=0))
    calibrated = calibrate(recording)
    assert set(calibrated.calibration.segments) == set(LEGS)
    assert max(find_errors(calibrated, truth).values()) < 2.0
    assert [n.code for n in calibrated.calibration.notices] == ["no_walking"]
    score = score_calibration(calibrated)
    assert score.judge_segment("pelvis") == "redo"
    assert score.judge_segment("thigh_l") == "pass"


def test_few_repetitions_are_used_and_told() -> None:
    recording, truth = take(4, SwingsAndBows(swings=7, bows=5))
    calibrated = calibrate(recording)
    assert max(find_errors(calibrated, truth).values()) < 2.0
    notices = [n for n in calibrated.calibration.notices if n.code == "few_repetitions"]
    assert {n.sensor for n in notices} == set(LEGS)
    checks = score_calibration(calibrated).checks
    redo = {c.segment for c in checks if c.name == "repetitions" and c.verdict == "redo"}
    assert redo == set(LEGS)
    assert not any(c.segment is None for c in checks)


def test_equal_swings_forward_and_back_have_a_weak_sign() -> None:
    does = SwingsAndBows(forward_rad=radians(20.0), backward_rad=radians(20.0), knee_rad=0.0, bows=0)
    recording, _ = take(5, does)
    codes = {n.code for n in calibrate(recording).calibration.notices}
    assert "calibration_sign_weak" in codes


def test_swings_that_go_aside_each_time_bend_the_axis_by_as_much() -> None:
    """A single movement cannot be distinguished from a rotated sensor."""
    does = SwingsAndBows(aside_rad=radians(4.0), aside_per_swing=1.0, bows=0)
    recording, truth = take(6, does)
    worst = max(find_errors(calibrate(recording), truth).values())
    assert 1.0 < worst < 15.0


@pytest.mark.slow
def test_labels_hold_and_the_angles_of_swings_come_out() -> None:
    recording, truth = take(1)
    agreed = check_agreement(recording)
    assert agreed.recording is recording
    calibrated = calibrate(recording)
    assert score_calibration(calibrated, None, agreed).verdict == "pass"
    angles = measure_angles(estimate_orientations(calibrated), calibrated.calibration.zero)
    for name in ("hip_flexion_r", "knee_flexion_l"):
        true = truth.angles[name] - truth.angles[name][0]
        assert rms_deg(angles.angles[name][: len(true)] - true) < 2.0


@pytest.mark.slow
def test_live_it_is_the_same_calibration() -> None:
    whole, truth = take(0, SwingsAndBows(swings=10, bows=5))
    recording = only(whole, "pelvis", "shank_l", "shank_r")
    segments = WornSensors(tuple(recording.sensors), recording.rate_hz, recording.subject, "walk", {})
    live = LiveCalibrator(segments)
    results, names = [], set()
    for block in cut_blocks(recording):
        results.append(live.push(block))
        names.add(live.view.problem)
    (result,) = [x for x in results if x is not None]
    assert names == {None}
    assert {c.method for c in result.checks} == {"hip_swing", "trunk_bow"}
    assert max(find_errors(result.calibrated, truth).values()) < 2.0


def test_impossible_movements_are_refused() -> None:
    with pytest.raises(ParameterError, match="expected 0 or more"):
        replace(SwingsAndBows(), swings=-1)
