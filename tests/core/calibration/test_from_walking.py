"""Calibration without standing: simulated walks that begin and end in the middle of the walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.calibration import CalibrationParams, calibrate
from sagittal.core.calibration.heading import HeadingParams, pendulum_agreement
from sagittal.core.calibration.sensor_in_walk import WalkRungParams, find_flat_moments
from sagittal.core.errors import CalibrationError
from sagittal.core.frames import Floats, Segment
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.rotation import angle_between, exp, rotate, wrap_angle, yaw
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.walks import cut, only, simulated, turned

START_S, END_S = 8.0, 20.0
LEGS: tuple[Segment, ...] = ("shank_l", "shank_r", "foot_l", "foot_r", "thigh_l", "thigh_r")


def mid_walk(name: str = "comfortable") -> UniformRecording:
    return cut(simulated(name)[0], START_S, END_S)


@pytest.fixture(scope="module")
def legs() -> UniformRecording:
    return only(mid_walk(), *LEGS)


@pytest.mark.slow
def test_the_walk_gives_what_standing_gives_but_for_the_neutral_posture(legs: UniformRecording) -> None:
    calibration = calibrate(legs).calibration
    whole = calibrate(simulated()[0]).calibration
    assert calibration.posture == "walking"
    assert calibration.rest == ()
    assert set(calibration.segments) == set(LEGS)
    for s in LEGS:
        off = np.degrees(calibration.segments[s].gyro_bias - whole.segments[s].gyro_bias)
        up = calibration.segments[s].R_segment_sensor[1]
        assert np.linalg.norm(off - (off @ up) * up) < 0.5, s
        # about the vertical nothing but straight walking tells
        assert abs(off @ up) < 1.5, s
        assert calibration.segments[s].rest_norm == pytest.approx(whole.segments[s].rest_norm, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comfortable", "hemiparetic", "crouch"])
def test_segments_are_where_they_are_but_for_a_fixed_turn(name: str) -> None:
    """Whatever posture is called neutral: against the truth a segment is off by one turn, all the time."""
    recording, truth = simulated(name)
    q = estimate_orientations(calibrate(only(mid_walk(name), *LEGS))).q
    part = slice(round(START_S * recording.rate_hz), round(END_S * recording.rate_hz))
    for s in LEGS:
        true = truth.q[s][part]
        k = slice(200, 1000, 10)
        mean_up = rotate(np.array([1.0, -1.0, -1.0, -1.0]) * true[k], np.array([0.0, 0.0, 1.0]))
        ours = rotate(np.array([1.0, -1.0, -1.0, -1.0]) * q[s][k], np.array([0.0, 0.0, 1.0]))
        # the turn that lays one set of verticals upon the other, and what it leaves
        U, _, V = np.linalg.svd(ours.T @ mean_up)
        turn = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
        left = np.degrees(np.arccos(np.clip((ours * (mean_up @ turn.T)).sum(axis=1), -1.0, 1.0)))
        assert np.sqrt(np.mean(left**2)) < 2.0, s


@pytest.mark.slow
def test_the_foot_is_flat_where_it_is_flat_in_standing(legs: UniformRecording) -> None:
    calibration, whole = calibrate(legs).calibration, calibrate(simulated()[0]).calibration
    feet: tuple[Segment, ...] = ("foot_l", "foot_r")
    for s in feet:
        a, b = (c.segments[s].R_segment_sensor[1] for c in (calibration, whole))
        assert np.degrees(np.arccos(a @ b)) < 3.0


def test_any_mounting_gives_the_same_posture(legs: UniformRecording) -> None:
    rng = np.random.default_rng(3)
    by_segment: dict[Segment, Floats] = {s: exp(rng.normal(0.0, 1.5, 3)) for s in LEGS}
    q, second = (estimate_orientations(calibrate(r)).q for r in (legs, turned(legs, by_segment)))
    for s in LEGS:
        # headings are means of a twist, which another mounting sees a little otherwise
        assert np.degrees(np.median(angle_between(q[s], second[s]))) < 4.0


def test_all_segments_walk_ahead(legs: UniformRecording) -> None:
    result = calibrate(legs)
    q = estimate_orientations(result).q
    a, b = (round(t * legs.rate_hz) for t in result.calibration.zero)
    for s in LEGS:
        heading = np.angle(np.mean(np.exp(1j * yaw(q[s][a:b]))))
        assert abs(np.degrees(wrap_angle(float(heading)))) < 5.0, s


def test_a_thigh_alone_does_not_know_forward_and_a_declared_one_does() -> None:
    single = only(mid_walk(), "thigh_r")
    with pytest.raises(CalibrationError) as caught:
        calibrate(single)
    assert caught.value.code == "forward_unknown"
    known_variant = replace(single, mounting={"thigh_r": "face right"})
    assert calibrate(known_variant).calibration.segments["thigh_r"].method == "walking_direction"


def test_a_pelvis_that_does_not_vault_is_left_out_and_said() -> None:
    calibration = calibrate(mid_walk()).calibration
    assert "pelvis" not in calibration.segments
    assert {n.code for n in calibration.notices} >= {"pelvis_heading_unknown", "from_walking"}
    sure = CalibrationParams(heading=HeadingParams(pendulum=0.0))
    assert "pelvis" in calibrate(mid_walk(), sure).calibration.segments


@pytest.mark.parametrize("forward", [0.3, 0.3 + np.pi])
def test_a_trunk_that_vaults_tells_forward_from_backward(forward: float) -> None:
    """An inverted pendulum: highest where it is slowest."""
    rate, n = 100.0, 1000
    phase = 2.0 * np.pi * np.arange(n) / (0.55 * rate)
    height, speed = np.cos(phase), -np.cos(phase)
    up = np.gradient(np.gradient(height))
    a = np.gradient(speed) * np.exp(1j * forward)
    agrees = pendulum_agreement(a, up, 0.3, [(0, n)], [0.0], rate, [0.55])
    assert agrees == pytest.approx(1.0 if forward < 1.0 else -1.0, abs=0.02)
    assert pendulum_agreement(a, up, 0.3, [(0, n)], [0.0], rate, [0.0]) == 0.0


def test_every_stance_has_a_flat_moment() -> None:
    recording, truth = simulated()
    walked = np.zeros(len(recording.t_s), np.bool_)
    walked[800:2000] = True
    flats = find_flat_moments(recording.sensors["foot_r"].gyr, walked, recording.rate_hz, WalkRungParams())
    steps = np.diff(np.concatenate(([0], truth.flat["right"][800:2000].astype(int), [0])))
    whole = int((steps > 0).sum()) - 2
    assert truth.flat["right"][flats].mean() > 0.9
    assert whole <= len(flats) <= 2 * whole + 4


@pytest.mark.filterwarnings("error")
def test_a_foot_whose_sensor_holds_zeros_for_a_while_is_flat_only_at_numbers() -> None:
    gyr = np.random.default_rng(0).normal(0.0, 3.0, (4000, 3))
    gyr[np.arange(4000) // 50 % 2 == 1] = 0.0
    flats = find_flat_moments(gyr, np.ones(4000, np.bool_), 100.0, WalkRungParams())
    assert len(flats) > 20
