"""The least squares of L7S over a whole take: its equations, its laws, and what it does not do."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.linalg import solveh_banded

from core.body.l7s import smoother
from core.body.l7s.filter import L7sInputs, L7sTrack, Worn, filter_block, start_l7s_state
from core.body.l7s.inputs import free_acceleration, take_of
from core.body.l7s.legs import LegModel, solve_legs
from core.body.l7s.smoother import BAND, WholeTrack, smooth_track, write_equations
from core.calibration import calibrate
from core.frames import Floats
from core.fusion.mahony import estimate_orientations
from core.rotation import about, exp, to_matrix
from tests.accuracy.l7s_walks import steps_of
from tests.walks import simulated


@cache
def walk(worn: Worn) -> tuple[L7sInputs, L7sTrack, LegModel, Floats]:
    """Inputs, the filter's track, the model, and the true places (n, 3, 3) of mid-hip and ankles."""
    recording, truth = simulated("comfortable", 2)
    calibrated = calibrate(recording)
    orientations = estimate_orientations(calibrated)
    model = LegModel.of(truth.body)
    acceleration = free_acceleration(calibrated, orientations)
    inputs = take_of(orientations, acceleration, steps_of(calibrated), model, worn).part(slice(None))
    track, _ = filter_block(start_l7s_state(inputs, model), inputs, model, 100.0)
    places = np.stack([truth.p[s][: len(inputs.step)] for s in ("pelvis", "foot_l", "foot_r")], axis=1)
    return inputs, track, model, places


def whole(worn: Worn) -> WholeTrack:
    inputs, track, model, _ = walk(worn)
    return smooth_track(track, inputs, np.ones((len(inputs.step), 3), bool), model, 100.0)


def equations(x: Floats, seed: int) -> tuple[Floats, Floats]:
    """Band and right side at places x (T, 9) of a random take."""
    rng = np.random.default_rng(seed)
    T = len(x)
    R = to_matrix(exp(rng.normal(0.0, 0.3, (T, 3, 3))))
    band, slope = np.empty((BAND + 1, x.size)), np.empty(x.size)
    write_equations(
        x, np.zeros_like(x), R, rng.normal(0.0, 0.01, x.shape), rng.uniform(0.1, 1.0, (T, 3)),
        rng.random((T, 2)) < 0.5, 0.04, np.array([0.09, 0.07, 0.84, 0.837]), np.array([0.9, 0.03]), band,
    slope, )  # fmt: skip
    return band, slope


def test_the_equations_are_the_derivatives_of_what_is_made_small() -> None:
    """Right side: gradient; band: its derivative, up to the bend of the legs that Gauss–Newton leaves out."""
    rng = np.random.default_rng(1)
    x = rng.normal(0.0, 0.2, (6, 9)) + np.array([0.0, 0.0, 0.7, 0.0, 0.1, 0.0, 0.0, -0.1, 0.0])
    band, slope = equations(x, 7)
    full = np.zeros((x.size, x.size))
    for below in range(BAND + 1):
        for j in range(x.size - below):
            full[j + below, j] = full[j, j + below] = band[below, j]
    assert np.linalg.eigvalsh(full)[0] > 0.0
    step = rng.normal(0.0, 1e-7, x.size)
    _, after = equations(x + step.reshape(x.shape), 7)
    _, before = equations(x - step.reshape(x.shape), 7)
    np.testing.assert_allclose(0.5 * (after - before), full @ step, atol=0.2 * np.abs(full @ step).max())
    # where the legs are far from their length nothing bends: exact
    x[:, 2] = 0.3
    _, slope = equations(x, 7)
    move = solveh_banded(equations(x, 7)[0], slope, lower=True)
    assert np.isfinite(move).all()


@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_it_settles_and_meets_the_constraints(worn: Worn) -> None:
    found, (_, _, model, _) = whole(worn), walk(worn)
    legs = solve_legs(found.R, found.p, model)
    assert found.passes < smoother.PASSES
    assert legs.reach.max() < model.thigh + model.shank + 1e-5
    assert np.abs(legs.hinge).max() < 1e-5


def test_places_are_nearer_the_truth_than_the_filters() -> None:
    found, (_, track, model, places) = whole("3I"), walk("3I")
    moving = slice(600, 2400)

    def height_error(R: Floats, p: Floats) -> Floats:
        legs = solve_legs(R, p, model)
        hip = 0.5 * (legs.p[:, 1] + legs.p[:, 4])
        return np.asarray((hip - legs.p[:, [3, 6]].mean(axis=1))[moving, 2] - height[moving])

    height = places[:, 0, 2] - places[:, 1:, 2].mean(axis=1)
    before, after = height_error(track.R, track.p), height_error(found.R, found.p)
    # the pull to the standing height lifts the filter's pelvis in every step
    assert before.mean() > 0.01
    assert abs(after.mean()) < 0.5 * before.mean()
    assert after.std() < 0.75 * before.std()


@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_the_same_walk_backwards_in_the_world_and_moved_is_the_same(worn: Worn) -> None:
    inputs, track, model, _ = walk(worn)
    turn = to_matrix(about(2, 2.0))
    turned = L7sInputs(turn @ inputs.R, inputs.acc @ turn.T, inputs.step, worn)
    start = L7sTrack(turn @ track.R, track.p @ turn.T + [5.0, 7.0, 0.0], track.v, track.variance)
    found = smooth_track(start, turned, np.ones((len(inputs.step), 3), bool), model, 100.0)
    one, other = (solve_legs(x.R, x.p, model).reach for x in (whole(worn), found))
    np.testing.assert_allclose(one, other, atol=1e-6)


def test_a_lost_foot_disturbs_its_own_swing_alone() -> None:
    inputs, _, model, _ = walk("3I")
    lost = slice(1500, 1530)
    acc, valid = inputs.acc.copy(), np.ones((len(inputs.step), 3), bool)
    acc[lost, 2], valid[lost, 2] = 0.0, False
    broken = L7sInputs(inputs.R, acc, inputs.step, "3I")
    track, _ = filter_block(start_l7s_state(broken, model), broken, model, 100.0)
    told = solve_legs(*places(smooth_track(track, broken, valid, model, 100.0)), model).reach
    untold = solve_legs(
        *places(smooth_track(track, broken, ~np.zeros_like(valid), model, 100.0)), model
    ).reach
    right = solve_legs(*places(whole("3I")), model).reach
    beside = np.ones(len(right), bool)
    beside[1350:1680] = False
    assert np.abs(told - right)[beside].max() < 0.005
    assert np.abs(told - right).max() < np.abs(untold - right).max()


def places(track: WholeTrack) -> tuple[Floats, Floats]:
    return track.R, track.p


def test_a_take_of_a_few_samples_is_the_filters() -> None:
    inputs, track, model, _ = walk("3I")
    few = slice(0, 4)
    short = L7sTrack(track.R[few], track.p[few], track.v[few], track.variance[few])
    found = smooth_track(short, inputs.part(few), np.ones((4, 3), bool), model, 100.0)
    np.testing.assert_allclose(found.p, short.p, atol=0.01)
