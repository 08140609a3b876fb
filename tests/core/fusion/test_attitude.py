"""The six-axis filter: exact turns, an undisturbed vertical while walking, blocks, gaps."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import GRAVITY, Bools, Floats
from sagittal.core.fusion.attitude import AttitudeParams, AttitudeState, advance, estimate_orientation
from sagittal.core.rotation import about, angle_between, conjugate, exp, multiply, rotate

RATE = 100.0
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
PARAMS = AttitudeParams()


def motion(n: int, seed: int = 0) -> tuple[Floats, Floats, Floats]:
    """Orientations (n, 4), rates and specific force (n, 3) of a smoothly turning, not accelerated sensor."""
    rng = np.random.default_rng(seed)
    t = np.arange(n)[:, None] / RATE
    phases, speeds = rng.uniform(0, 6, 3), rng.uniform(3, 6, 3)
    rate = np.sin(speeds * t + phases) * np.array([2.0, 1.0, 3.0])
    q = np.empty((n, 4))
    q[0] = LEVEL
    for k in range(1, n):
        q[k] = multiply(q[k - 1], exp(0.5 * (rate[k - 1] + rate[k]) / RATE))
    return q, rate, rotate(conjugate(q), np.array([0.0, 0.0, GRAVITY]))


def all_valid(n: int) -> Bools:
    return np.ones(n, bool)


def test_it_follows_a_motion_without_acceleration_exactly() -> None:
    q, rate, force = motion(2000)
    orientation = estimate_orientation(q[0], 0, rate, force, all_valid(2000), RATE, GRAVITY, PARAMS)
    assert angle_between(orientation, q).max() < 1e-6


@pytest.mark.parametrize("at", [0, 700, 1999])
def test_it_starts_from_any_sample_of_the_take(at: int) -> None:
    q, rate, force = motion(2000, seed=3)
    orientation = estimate_orientation(q[at], at, rate, force, all_valid(2000), RATE, GRAVITY, PARAMS)
    assert angle_between(orientation, q).max() < 1e-6


@pytest.mark.slow
@given(st.lists(st.integers(1, 399), max_size=6, unique=True), st.integers(0, 5))
@settings(max_examples=25, deadline=None)
def test_one_run_equals_any_split_into_blocks_bit_for_bit(cuts: list[int], seed: int) -> None:
    _, rate, force = motion(400, seed)
    rng = np.random.default_rng(seed)
    force = force + rng.standard_normal(force.shape)
    valid = rng.random(400) > 0.05
    valid[150:180] = False
    start = AttitudeState(LEVEL, rate[0])
    whole, end = advance(start, rate, force, valid, RATE, GRAVITY, PARAMS)
    pieces, state = [], start
    for a, b in pairwise([0, *sorted(cuts), 400]):
        q, state = advance(state, rate[a:b], force[a:b], valid[a:b], RATE, GRAVITY, PARAMS)
        pieces.append(q)
    assert np.array_equal(np.concatenate(pieces), whole)
    assert np.array_equal(state.q, end.q)
    assert (state.age_s, state.lost_s) == (end.age_s, end.lost_s)


def test_walking_does_not_tip_the_vertical() -> None:
    """Acceleration that averages to zero over a stride leaves no mean tilt, however its norm changes."""
    t = np.arange(6000) / RATE
    forward = 6.0 * np.sin(2 * np.pi * t)
    upward = 4.0 * np.sin(2 * np.pi * t) + 2.0 * np.sin(4 * np.pi * t)
    force = np.column_stack((forward, np.zeros_like(t), GRAVITY + upward))
    q = estimate_orientation(LEVEL, 0, np.zeros((6000, 3)), force, all_valid(6000), RATE, GRAVITY, PARAMS)
    tilt = rotate(conjugate(q), np.array([0.0, 0.0, 1.0]))[1000:5000, 0]
    assert abs(np.degrees(tilt.mean())) < 0.05
    unit = force / np.linalg.norm(force, axis=1, keepdims=True)
    tipped = estimate_orientation(LEVEL, 0, np.zeros((6000, 3)), unit, all_valid(6000), RATE, 1.0, PARAMS)
    assert abs(np.degrees(rotate(conjugate(tipped), np.array([0.0, 0.0, 1.0]))[1000:5000, 0].mean())) > 1.0


def test_a_small_gyro_bias_tilts_by_bias_over_gain() -> None:
    bias = np.radians([0.05, 0.0, 0.0])
    n = 12000
    force = np.tile([0.0, 0.0, GRAVITY], (n, 1))
    q, _ = advance(
        AttitudeState(LEVEL, bias), np.tile(bias, (n, 1)), force, all_valid(n), RATE, GRAVITY, PARAMS
    )
    assert angle_between(q[-1], LEVEL) == pytest.approx(np.radians(0.05) / PARAMS.kp, rel=0.02)


def test_no_gain_is_pure_integration() -> None:
    q, rate, _ = motion(500)
    wild = np.random.default_rng(0).standard_normal((500, 3)) * 50
    orientation = estimate_orientation(
        q[0], 0, rate, wild, all_valid(500), RATE, GRAVITY, AttitudeParams(kp=0.0)
    )
    assert angle_between(orientation, q).max() < 1e-9


def test_inside_a_gap_the_orientation_is_held_and_after_it_the_tilt_is_relearnt() -> None:
    q, rate, force = motion(3000, seed=1)
    valid = all_valid(3000)
    valid[1000:1400] = False
    rate, force = rate.copy(), force.copy()
    rate[1000:1400], force[1000:1400] = rate[999], force[999]
    orientation = estimate_orientation(q[0], 0, rate, force, valid, RATE, GRAVITY, PARAMS)
    assert np.array_equal(orientation[1000:1400], np.tile(orientation[999], (400, 1)))
    assert angle_between(orientation[:1000], q[:1000]).max() < 1e-6
    up = np.array([0.0, 0.0, 1.0])
    tilt = rotate(conjugate(orientation), up) - rotate(conjugate(q), up)
    assert np.degrees(np.linalg.norm(tilt[1450:], axis=1).max()) < 1.0


def test_a_first_stretch_before_a_gap_is_estimated_backwards() -> None:
    q, rate, force = motion(3000, seed=2)
    valid = all_valid(3000)
    valid[1000:1200] = False
    orientation = estimate_orientation(q[2500], 2500, rate, force, valid, RATE, GRAVITY, PARAMS)
    assert angle_between(orientation[1200:], q[1200:]).max() < 1e-6
    up = np.array([0.0, 0.0, 1.0])
    tilt = rotate(conjugate(orientation), up) - rotate(conjugate(q), up)
    assert np.degrees(np.linalg.norm(tilt[:900], axis=1).max()) < 1.0


def test_a_sensor_that_never_was_valid_keeps_its_start() -> None:
    _, rate, force = motion(50)
    orientation = estimate_orientation(LEVEL, 10, rate, force, np.zeros(50, bool), RATE, GRAVITY, PARAMS)
    assert np.array_equal(orientation, np.tile(LEVEL, (50, 1)))


def test_norm_stays_one_and_the_result_is_deterministic() -> None:
    _, rate, force = motion(3000, seed=5)
    noisy = force + np.random.default_rng(0).standard_normal(force.shape) * 5
    orientation = estimate_orientation(LEVEL, 0, rate, noisy, all_valid(3000), RATE, GRAVITY, PARAMS)
    second_orientation = estimate_orientation(LEVEL, 0, rate, noisy, all_valid(3000), RATE, GRAVITY, PARAMS)
    assert np.array_equal(orientation, second_orientation)
    assert np.abs(np.linalg.norm(orientation, axis=1) - 1).max() < 1e-9


def test_a_large_turn_between_two_samples_is_exact() -> None:
    rate = np.tile([0.0, 0.0, 40.0], (51, 1))
    force = np.tile([0.0, 0.0, GRAVITY], (51, 1))
    q, _ = advance(AttitudeState(LEVEL, rate[0]), rate, force, all_valid(51), RATE, GRAVITY, PARAMS)
    assert angle_between(q[-1], about(2, 40.0 * 51 / RATE)) < 1e-9


def test_a_number_that_is_none_is_an_error_and_a_wild_gain_too() -> None:
    _, rate, force = motion(50)
    rate[20, 1] = np.nan
    with pytest.raises(EstimationError) as caught:
        advance(AttitudeState(LEVEL, rate[0]), rate, force, all_valid(50), RATE, GRAVITY, PARAMS)
    assert caught.value.code == "filter_diverged"
    with pytest.raises(ParameterError) as wild:
        AttitudeParams(kp=-1.0)
    assert wild.value.code == "gain_out_of_range"
