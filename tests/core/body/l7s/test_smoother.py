"""The least squares of L7S over a whole take: its equations, its laws, and what it does not do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.body.l7s import smoother
from sagittal.core.body.l7s.filter import L7sInputs, L7sTrack, Worn, filter_block, start_l7s_state
from sagittal.core.body.l7s.inputs import free_acceleration, take_of
from sagittal.core.body.l7s.legs import LegModel, solve_legs
from sagittal.core.body.l7s.smoother import WholeTrack, smooth_track, solve_nodes
from sagittal.core.calibration import calibrate
from sagittal.core.errors import EstimationError
from sagittal.core.frames import Bools, Floats
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.rotation import about, exp, to_matrix
from tests.helpers.l7s_walks import steps_of
from tests.helpers.walks import simulated


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


def whole(segments: Worn) -> WholeTrack:
    inputs, track, model, _ = walk(segments)
    return smooth_track(track, inputs, np.ones((len(inputs.step), 3), bool), model, 100.0)


HOP_S = 0.04
LENGTHS = np.array([0.09, 0.07, 0.84, 0.837])
HEIGHTS = np.array([0.9, 0.03])


@dataclass(frozen=True, eq=False)
class Problem:
    """Random nodes: arguments as of `solve_nodes`."""

    x: Floats
    pull: Floats
    free: Floats
    R: Floats
    density: Floats
    still: Bools

    @classmethod
    def make(cls, T: int) -> Problem:
        rng = np.random.default_rng(7)
        return cls(
            rng.normal(0.0, 0.1, (T, 9)) + np.array([0.0, 0.0, 0.8, 0.0, 0.1, 0.0, 0.0, -0.1, 0.0]),
            rng.normal(0.0, 0.1, (T, 9)),
            rng.normal(0.0, 0.01, (T, 9)),
            to_matrix(exp(rng.normal(0.0, 0.3, (T, 3, 3)))),
            rng.uniform(0.1, 1.0, (T, 3)),
            rng.random((T, 2)) < 0.5,
        )

    def solve(self) -> tuple[Floats, int, float]:
        return solve_nodes(
            self.x, self.pull, self.free, self.R, self.density, self.still, HOP_S, LENGTHS, HEIGHTS
        )

    def rows(self, flat: Floats) -> Floats:
        """Residuals over the roots of their variances (docs/science/l7s.md, "Both ways")."""
        x, hop, last = flat.reshape(-1, 9), HOP_S, len(self.x) - 1
        values: list[float] = []

        def add(residual: Floats | float, density: float) -> None:
            values.extend(np.atleast_1d(np.asarray(residual) * np.sqrt(hop / density)))

        for k in range(last + 1):
            add(x[k] - self.pull[k], smoother.ANYWHERE)
            pelvis, left, right = x[k].reshape(3, 3)
            for b in range(3):
                part = slice(3 * b, 3 * b + 3)
                if 0 < k < last:
                    bend = np.diff(x[k - 1 : k + 2, part] - self.free[k - 1 : k + 2, part], 2, axis=0)[0]
                    add(bend, max(self.density[k - 1, b], self.density[k, b]) * hop**4)
            add((pelvis - 0.5 * left - 0.5 * right)[:2], smoother.MID_PELVIS)
            add(pelvis[2] - HEIGHTS[0], smoother.PELVIS_HEIGHT)
            for leg, foot in enumerate((left, right)):
                own, other_still = self.still[k, leg], self.still[k, 1 - leg]
                add(foot[2] - HEIGHTS[1], smoother.FOOT_HEIGHT[0 if own else 1])
                if own and k < last:
                    add(x[k + 1].reshape(3, 3)[1 + leg] - foot, smoother.REST_M**2 * hop)
                hip = pelvis + (1 - 2 * leg) * LENGTHS[0] * self.R[k, 0, :, 1]
                leg_vector = hip - foot + LENGTHS[1] * self.R[k, 1 + leg, :, 2]
                reach = float(np.linalg.norm(leg_vector))
                add(self.R[k, 1 + leg, :, 1] @ leg_vector, smoother.HINGE)
                add((reach - LENGTHS[3]) * float(own and not other_still), smoother.CARRIES)
                add(max(reach - LENGTHS[2], 0.0), smoother.LONGER)
        return np.array(values)


def test_a_pass_is_that_of_gauss_newton_on_what_is_made_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """With derivatives by differences and all equations in one matrix."""
    source = Problem.make(9)
    assert source.still.any(axis=0).all()
    assert not source.still.all(axis=1).all()
    step, flat = 1e-6, source.x.reshape(-1)
    ways = step * np.eye(flat.size)
    J = np.stack([(source.rows(flat + way) - source.rows(flat - way)) / (2.0 * step) for way in ways], axis=1)
    monkeypatch.setattr(smoother, "PASSES", 1)
    result, passes, moved = source.solve()
    assert passes == 1
    assert moved == pytest.approx(np.abs(result - source.x).max())
    expected = source.x - np.linalg.solve(J.T @ J, J.T @ source.rows(flat)).reshape(source.x.shape)
    np.testing.assert_allclose(result, expected, atol=1e-6)


def test_places_that_are_no_numbers_are_refused() -> None:
    source = Problem.make(9)
    with pytest.raises(EstimationError, match="cannot be determined"):
        replace(source, R=np.full_like(source.R, np.nan)).solve()


@pytest.mark.slow
@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_it_settles_and_meets_the_constraints(worn: Worn) -> None:
    result, (_, _, model, _) = whole(worn), walk(worn)
    legs = solve_legs(result.R, result.p, model)
    assert result.passes < smoother.PASSES
    assert result.moved < smoother.SETTLED_M
    assert legs.reach.max() < model.thigh + model.shank + 1e-5
    assert np.abs(legs.hinge).max() < 1e-5


def test_places_are_nearer_the_truth_than_the_filters() -> None:
    result, (_, track, model, places) = whole("3I"), walk("3I")
    moving = slice(600, 2400)

    def height_error(R: Floats, p: Floats) -> Floats:
        legs = solve_legs(R, p, model)
        hip = 0.5 * (legs.p[:, 1] + legs.p[:, 4])
        return np.asarray((hip - legs.p[:, [3, 6]].mean(axis=1))[moving, 2] - height[moving])

    height = places[:, 0, 2] - places[:, 1:, 2].mean(axis=1)
    initial, final = height_error(track.R, track.p), height_error(result.R, result.p)
    # the pull to the standing height lifts the filter's pelvis in every step
    assert initial.mean() > 0.01
    assert abs(final.mean()) < 0.5 * initial.mean()
    assert final.std() < 0.75 * initial.std()


@pytest.mark.slow
@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_the_same_walk_backwards_in_the_world_and_moved_is_the_same(worn: Worn) -> None:
    inputs, track, model, _ = walk(worn)
    turn = to_matrix(about(2, 2.0))
    turned = L7sInputs(turn @ inputs.R, inputs.acc @ turn.T, inputs.step, worn)
    start = L7sTrack(turn @ track.R, track.p @ turn.T + [5.0, 7.0, 0.0], track.v, track.variance)
    result = smooth_track(start, turned, np.ones((len(inputs.step), 3), bool), model, 100.0)
    one, second = (solve_legs(x.R, x.p, model).reach for x in (whole(worn), result))
    np.testing.assert_allclose(one, second, atol=1e-6)


def test_a_lost_foot_disturbs_its_own_swing_alone() -> None:
    inputs, _, model, _ = walk("3I")
    lost = slice(1500, 1530)
    acc, valid = inputs.acc.copy(), np.ones((len(inputs.step), 3), bool)
    acc[lost, 2], valid[lost, 2] = 0.0, False
    broken = L7sInputs(inputs.R, acc, inputs.step, "3I")
    track, _ = filter_block(start_l7s_state(broken, model), broken, model, 100.0)
    notices = solve_legs(*places(smooth_track(track, broken, valid, model, 100.0)), model).reach
    untold = solve_legs(
        *places(smooth_track(track, broken, ~np.zeros_like(valid), model, 100.0)), model
    ).reach
    right = solve_legs(*places(whole("3I")), model).reach
    mask = np.ones(len(right), bool)
    mask[1350:1680] = False
    assert np.abs(notices - right)[mask].max() < 0.005
    assert np.abs(notices - right).max() < np.abs(untold - right).max()


def places(track: WholeTrack) -> tuple[Floats, Floats]:
    return track.R, track.p


def test_a_take_of_a_few_samples_is_the_filters() -> None:
    inputs, track, model, _ = walk("3I")
    few = slice(0, 4)
    short = L7sTrack(track.R[few], track.p[few], track.v[few], track.variance[few])
    result = smooth_track(short, inputs.part(few), np.ones((4, 3), bool), model, 100.0)
    np.testing.assert_allclose(result.p, short.p, atol=0.01)
