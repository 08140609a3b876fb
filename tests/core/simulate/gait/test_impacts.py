from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import FOOT, GRAVITY, SIDES, Floats, Segment
from sagittal.core.simulate import Pivot, RecordingSetup, Simulation, Stand, Straight, Walker, simulate
from sagittal.core.simulate.gait.human import Motion
from sagittal.core.simulate.gait.impacts import SHAKES, Impact, draw_impacts, shake_sensor
from sagittal.core.simulate.sensors import PLACES, SensorPath, draw_mounts, ideal_signals, place_sensor

SCRIPT = (Stand(3.0), Straight(12.8, 0.64, 0.54), Stand(3.0))
BARE = RecordingSetup(noise=None)
FAST = replace(Walker(), impact=2.0)


@pytest.fixture(scope="module")
def soft() -> Simulation:
    return simulate(SCRIPT, seed=4, setup=BARE)


@pytest.fixture(scope="module")
def hard() -> Simulation:
    return simulate(SCRIPT, seed=4, setup=replace(BARE, impacts=True))


def test_bones_do_not_know_about_impacts(soft: Simulation, hard: Simulation) -> None:
    """docs/science/simulation.md, "Limits on construction"."""
    for segment, q in soft.truth.q.items():
        assert np.array_equal(q, hard.truth.q[segment])
        assert np.array_equal(soft.truth.p[segment], hard.truth.p[segment])
        assert not np.array_equal(soft.ideal[segment].acc, hard.ideal[segment].acc)


def test_a_person_who_lands_without_weight_shakes_nothing(soft: Simulation) -> None:
    feather = simulate(SCRIPT, Walker(impact=0.0), 4, replace(BARE, impacts=True))
    for segment, signals in soft.ideal.items():
        assert np.array_equal(signals.acc, feather.ideal[segment].acc)
        assert np.array_equal(signals.gyr, feather.ideal[segment].gyr)


def test_a_flat_foot_is_still_again_after_the_shock(hard: Simulation) -> None:
    for side in SIDES:
        flat = hard.truth.flat[side].copy()
        for shift in (1, 2):
            flat[shift:] &= hard.truth.flat[side][:-shift]
            flat[:-shift] &= hard.truth.flat[side][shift:]
        signals = hard.ideal[FOOT[side]]
        assert np.linalg.norm(signals.gyr[flat], axis=1).max() < 1e-6
        assert np.abs(np.linalg.norm(signals.acc[flat], axis=1) - GRAVITY).max() < 1e-4


def _stride_maxima(simulation: Simulation, values: Floats) -> Floats:
    t, strides = simulation.truth.t_s, simulation.truth.strides
    return np.array([values[(t >= s.start_s) & (t < s.end_s)].max() for s in strides if s.side == "left"])


def test_shocks_of_a_healthy_walk_are_of_the_size_the_specification_measured(hard: Simulation) -> None:
    """Median 97 m/s² (5 to 95 %: 61 to 127) at the foot, 23 at the pelvis
    (docs/science/simulation.md, "Impacts")."""
    foot, pelvis = (np.linalg.norm(hard.ideal[s].acc, axis=1) for s in ("foot_l", "pelvis"))
    assert 75.0 < np.median(_stride_maxima(hard, foot)) < 120.0
    assert 18.0 < np.median(_stride_maxima(hard, pelvis)) < 28.0


@pytest.mark.parametrize("segment", ["foot_r", "shank_r", "thigh_r", "pelvis"])
def test_one_shock_has_the_stated_peak_and_ends(segment: Segment) -> None:
    t = np.arange(0.0, 2.0, 1e-4)
    shake = SHAKES[segment.split("_")[0]]
    shift, turn = shake_sensor(t, segment, (Impact("right", 1.0, 1.1, 0.0, 1.0),))
    up = np.gradient(np.gradient(shift[:, 2], t), t)
    assert shake.acc < np.abs(up).max() < 1.45 * shake.acc
    assert 0.8 * shake.rate < np.abs(np.gradient(turn, t)).max() < 1.45 * shake.rate
    outside = (t < 1.0 + shake.delay_s) | (t > 1.0 + shake.delay_s + shake.duration_s)
    assert np.abs(shift[outside]).max() == 0.0
    assert np.abs(turn[outside]).max() == 0.0


def test_the_other_leg_shakes_only_through_the_pelvis() -> None:
    t = np.arange(0.0, 2.0, 1e-3)
    hit = (Impact("right", 1.0, 1.1, 0.0, 1.0),)
    assert np.abs(shake_sensor(t, "shank_l", hit)[0]).max() == 0.0
    assert np.abs(shake_sensor(t, "pelvis", hit)[0]).max() > 0.0


def test_steps_on_the_spot_land_softly() -> None:
    script = (Stand(2.0), Pivot(np.pi, 0.5, 0.6), Stand(2.0))
    plain, shaking = (
        simulate(script, seed=2, setup=replace(BARE, impacts=impacts)) for impacts in (False, True)
    )
    assert np.array_equal(plain.ideal["foot_r"].acc, shaking.ideal["foot_r"].acc)


def test_shocks_do_not_depend_on_the_grid(move_steadily: Callable[[float, float], Motion]) -> None:
    """docs/science/simulation.md, "Limits on construction", with shocks."""
    rng = np.random.default_rng
    mount = draw_mounts(PLACES, 1.0, 0.0, rng(0))["foot_r"]

    def peak(rate: float) -> float:
        motion = move_steadily(rate, 1.745)
        path: SensorPath = place_sensor(motion, "foot_r", mount, None, draw_impacts(motion, rng(1)))
        return float(np.linalg.norm(ideal_signals(path, 1, "instant").acc, axis=1).max())

    assert peak(400.0) == pytest.approx(peak(1600.0), rel=0.12)


@pytest.mark.slow
def test_hard_steps_leave_the_range_of_a_real_sensor_and_are_cut_off() -> None:
    """docs/science/simulation.md, "Impacts": at 200 Hz and twice the impact 0.3 % of the foot's samples."""
    script = (Stand(3.0), Straight(24.0, 0.72, 0.5), Stand(3.0))
    result = simulate(script, FAST, 3, RecordingSetup(rate_hz=200.0, impacts=True))
    device = next(d for d, s in result.recording.segments.items() if s == "foot_r")
    acc = result.recording.streams[device].acc
    clipped = result.clipped["foot_r"]
    assert 0.0005 < clipped.mean() < 0.01
    assert np.abs(acc).max() == 16.0 * GRAVITY
    assert np.abs(result.ideal["foot_r"].acc).max() > 16.0 * GRAVITY
    assert (np.abs(acc[~clipped]) < 16.0 * GRAVITY).all()
