"""The calibration stage on simulated walks: truth, invariances, subsets, and every failure by its code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.calibration import CalibrationParams, calibrate
from sagittal.core.calibration.anterior import Method
from sagittal.core.errors import CalibrationError, SignalError
from sagittal.core.frames import SEGMENTS, Floats, Segment
from sagittal.core.rotation import exp, from_matrix, log, normalise, rotate, to_matrix
from sagittal.core.signals.calibrated import Calibration
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import Arc, Pivot, Stand, Straight, WalkTruth
from tests.helpers.walks import TOGETHER, cut, only, scripted, simulated, turned

LEGS: tuple[Segment, ...] = ("thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r")


def axial_error_deg(calibration: Calibration, truth: WalkTruth, segment: Segment) -> float:
    """Error of the anterior axis about the segment's long axis."""
    R = to_matrix(truth.mounts[segment].q_segment_sensor)
    E = calibration.segments[segment].R_segment_sensor @ R.T
    return float(np.degrees(log(from_matrix(E))[1]))


def codes(calibration: Calibration) -> set[str]:
    return {n.code for n in calibration.notices}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comfortable", "slow", "fast_with_turns", "five_minutes"])
def test_forward_is_found_on_every_segment(name: str) -> None:
    """Against the truth's axes, which at standing are turned out: feet by 10°, legs by a little."""
    recording, truth = simulated(name)
    result = calibrate(recording).calibration
    assert abs(axial_error_deg(result, truth, "pelvis")) <= 6.0
    for segment in LEGS:
        out = {"foot": 10.0, "shank": 5.0, "thigh": 4.0}[segment.split("_")[0]]
        outward = axial_error_deg(result, truth, segment) * (1 if segment.endswith("_l") else -1)
        assert abs(outward - out) <= 8.0, f"{segment}: {outward:.1f}"
        assert result.segments[segment].score > 0.8


def test_gyro_bias_is_the_drawn_one() -> None:
    recording, truth = simulated("comfortable")
    for segment, mounted in calibrate(recording).calibration.segments.items():
        off = np.degrees(np.linalg.norm(mounted.gyro_bias - truth.errors[segment].gyr_bias))
        assert off < 0.1, segment


@pytest.mark.slow
@pytest.mark.parametrize("method", ["walking_direction", "gyro_pca"])
def test_any_mounting_gives_the_same_segment_frames(method: Method) -> None:
    """The same signals in turned sensors: R_segment_sensor takes the turn up."""
    recording, _ = simulated("comfortable")
    rng = np.random.default_rng(7)
    by_segment: dict[Segment, Floats] = {s: normalise(rng.standard_normal(4)) for s in recording.sensors}
    params = replace(CalibrationParams(), method=method)
    one, second = calibrate(recording, params), calibrate(turned(recording, by_segment), params)
    for s in recording.sensors:
        R = second.calibration.segments[s].R_segment_sensor @ to_matrix(by_segment[s])
        off = log(from_matrix(R @ one.calibration.segments[s].R_segment_sensor.T))
        assert np.degrees(np.linalg.norm(off)) < 0.1, s


def test_half_a_turn_about_the_vertical_is_recognised() -> None:
    recording, _ = simulated("comfortable")
    up = recording.sensors["shank_l"].acc[100:400].mean(axis=0)
    by_segment: dict[Segment, Floats] = {"shank_l": exp(np.pi * up / np.linalg.norm(up))}
    one = calibrate(recording).calibration.segments["shank_l"].R_segment_sensor
    other_R_segment_sensor = (
        calibrate(turned(recording, by_segment)).calibration.segments["shank_l"].R_segment_sensor
    )
    np.testing.assert_allclose(other_R_segment_sensor @ to_matrix(by_segment["shank_l"]), one, atol=1e-6)


@pytest.mark.parametrize(
    "segments",
    [("foot_l", "foot_r"), ("foot_l",), ("pelvis",), ("pelvis", "foot_l", "foot_r"), ("thigh_r", "shank_r")],
)
def test_any_subset_of_segments_works(segments: tuple[Segment, ...]) -> None:
    recording, truth = simulated("comfortable")
    result = calibrate(only(recording, *segments)).calibration
    assert set(result.segments) == set(segments)
    for s in segments:
        assert abs(axial_error_deg(result, truth, s)) < 20.0
    assert len(result.walking) >= 1


@pytest.mark.slow
def test_rest_only_at_the_end_works() -> None:
    """As on gaitmap_foot: the take starts in the middle of the walk."""
    recording, truth = scripted((Stand(3.0), Straight(14.4, 0.45, 0.68), *TOGETHER, Stand(5.0)))
    late = cut(recording, truth.stands[-1][0] - 12.0, recording.t_s[-1])
    result = calibrate(late).calibration
    assert len(result.rest) == 1
    assert result.zero[0] > 11.0
    for s in ("pelvis", *LEGS):
        assert abs(axial_error_deg(result, truth, s)) < 20.0, s


def test_turning_before_walking_does_not_turn_the_segments() -> None:
    """Standing across the walkway: forward is where the person faces, not where the walk goes."""
    recording, truth = scripted(
        (Stand(5.0), Pivot(np.pi / 2, np.pi / 4, 0.55), Straight(12.0, 0.64, 0.54), Stand(4.0))
    )
    result = calibrate(recording).calibration
    (notices,) = (n.message for n in result.notices if n.code == "facing_not_walking")
    assert "between standing and walking" in notices
    for s in ("pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r"):
        assert abs(axial_error_deg(result, truth, s)) < 20.0, s


def test_turning_after_walking_is_told_as_such() -> None:
    """As on gaitmap_foot, where the only standing follows a turn at the end."""
    recording, truth = scripted(
        (Stand(5.0), Straight(12.0, 0.64, 0.54), Pivot(np.pi / 2, np.pi / 4, 0.55), *TOGETHER, Stand(5.0))
    )
    result = calibrate(cut(recording, truth.stands[0][1] + 1.0, recording.t_s[-1])).calibration
    assert result.posture == "standing"
    (notices,) = (n.message for n in result.notices if n.code == "facing_not_walking")
    assert "between walking and standing" in notices
    assert "Start" not in notices


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_walk_that_begins_with_an_arc_still_tells_where_the_pelvis_faces(seed: int) -> None:
    script = (Stand(5.0), Arc(1.5, np.pi / 2, 0.52, 0.56), Straight(12.0, 0.64, 0.54), Stand(4.0))
    recording, truth = scripted(script, seed)
    result = calibrate(cut(recording, 0.0, truth.stands[-1][0] - 0.5)).calibration
    assert abs(axial_error_deg(result, truth, "pelvis")) <= 20.0


@pytest.mark.slow
def test_turns_are_not_straight_walking() -> None:
    recording, _ = simulated("fast_with_turns")
    result = calibrate(recording).calibration
    assert len(result.walking) >= 4
    assert 0.05 < result.turning.mean() < 0.5
    for a, b in result.walking:
        assert not result.turning[round(a * 100) : round(b * 100)].any()


def standing_only() -> UniformRecording:
    return cut(simulated("comfortable")[0], 0.0, 5.0)


def test_no_walking_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(CalibrationError) as caught:
        calibrate(standing_only())
    assert caught.value.code == "no_walking"
    assert "8 steps" in caught.value.message


def test_without_walking_a_declared_mounting_is_enough() -> None:
    _, truth = simulated("comfortable")
    single = only(standing_only(), "pelvis")
    face = rotate(truth.mounts["pelvis"].q_segment_sensor, np.array([0.0, 0.0, 1.0]))
    along = {"forward": face[0], "back": -face[0], "right": face[2], "left": -face[2]}
    way = max(along, key=lambda w: along[w])
    result = calibrate(replace(single, mounting={"pelvis": f"sacrum, face {way}"})).calibration
    assert result.segments["pelvis"].method == "declared"
    assert abs(axial_error_deg(result, truth, "pelvis")) < 50.0


def test_a_mounting_declared_the_wrong_way_round_leaves_the_sensor_out() -> None:
    recording, truth = simulated("comfortable")
    face = rotate(truth.mounts["pelvis"].q_segment_sensor, np.array([0.0, 0.0, 1.0]))
    along = {"forward": face[0], "back": -face[0], "right": face[2], "left": -face[2]}
    wrong = min(along, key=lambda w: along[w])
    contradicted = replace(recording, mounting={"pelvis": f"face {wrong}"})
    result = calibrate(contradicted).calibration
    assert [n.sensor for n in result.notices if n.code == "calibration_sign_conflict"] == ["pelvis"]
    assert set(result.segments) == set(recording.sensors) - {"pelvis"}
    with pytest.raises(CalibrationError) as single_error:
        calibrate(only(contradicted, "pelvis"))
    assert single_error.value.code == "calibration_sign_conflict"


@pytest.mark.slow
def test_a_pelvis_without_a_rest_near_the_walk_is_left_out_and_the_legs_stay() -> None:
    """Rest, then 8 s of fidgeting, then the walk: the pelvis direction is undetermined."""
    recording, _ = simulated("slow")
    order = np.concatenate((np.arange(100, 500), np.tile(np.arange(100, 500), 2), np.arange(530, 1800)))
    fidget = np.zeros((len(order), 3))
    fidget[400:1200] = 0.3 * np.sin(np.arange(800) * 0.5)[:, None]
    sensors = {
        s: replace(
            x,
            acc=x.acc[order],
            gyr=x.gyr[order] + fidget,
            mag=None,
            valid=x.valid[order],
            interpolated=x.interpolated[order],
        )
        for s, x in recording.sensors.items()
    }
    restless = replace(recording, t_s=np.arange(len(order)) / recording.rate_hz, sensors=sensors)
    result = calibrate(restless).calibration
    assert "pelvis_heading_unknown" in codes(result)
    assert set(result.segments) == set(recording.sensors) - {"pelvis"}


def test_neither_rest_nor_enough_of_a_walk_and_no_sensor_are_errors() -> None:
    recording, _ = simulated("comfortable")
    walking = cut(recording, 9.0, 12.0)
    with pytest.raises(SignalError) as caught:
        calibrate(walking)
    assert caught.value.code == "no_rest"
    with pytest.raises(CalibrationError) as empty:
        calibrate(replace(recording, sensors={}))
    assert empty.value.code == "no_segment"


def test_few_steps_are_told_with_their_number() -> None:
    recording, _ = scripted((Stand(5.0), Straight(3.2, 0.64, 0.54), Stand(4.0)))
    few = [n for n in calibrate(recording).calibration.notices if n.code == "few_steps"]
    assert len(few) == 1
    assert "8 or more" in few[0].message


def test_all_segments_have_a_calibration_that_is_a_rotation() -> None:
    result = calibrate(simulated("comfortable")[0]).calibration
    assert set(result.segments) <= set(SEGMENTS)
    for mounted in result.segments.values():
        np.testing.assert_allclose(
            mounted.R_segment_sensor @ mounted.R_segment_sensor.T, np.eye(3), atol=1e-9
        )
        assert 0.0 <= mounted.score <= 1.0
