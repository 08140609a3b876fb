"""The self-calibrating filter on sensors whose faults are known."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import Floats
from sagittal.core.fusion.self_calibrating import (
    SelfCalibratingFilter,
    SelfCalibratingParams,
    smooth_orientations,
)
from sagittal.core.fusion.self_calibrating import layout as at
from sagittal.core.fusion.self_calibrating.params import GRAVITY_MPS2, MAG_NOISE
from sagittal.core.rotation import conjugate, exp, log, multiply, rotate
from tests.core.fusion.self_calibrating.moving import (
    NORTH,
    MovingSensor,
    SensorFaults,
    find_errors,
    move_sensor,
)

pytestmark = pytest.mark.slow  # compiles for half a minute what the product does not run

SETTLED = 800
"""Samples after which the calibration is judged."""


@cache
def moved(seed: int = 0, rest_s: float = 3.0, turning: float = 2.0) -> MovingSensor:
    return move_sensor(60.0, seed=seed, rest_s=rest_s, turning=turning)


def run_live(sensor: MovingSensor, *, field: bool = True) -> tuple[Floats, SelfCalibratingFilter]:
    run = SelfCalibratingFilter(sensor.rate_hz, magnetometer=field)
    q = run.advance(sensor.gyr[:, None], sensor.acc[:, None], sensor.mag[:, None] if field else None)
    return q[:, 0], run


def rms_deg(e: Floats) -> Floats:
    return np.asarray(np.degrees(np.sqrt(np.mean(e[SETTLED:] ** 2, axis=0))))


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(3))
def test_tilt_and_heading_are_the_true_ones_and_later_knowledge_helps(seed: int) -> None:
    sensor = moved(seed)
    live = rms_deg(find_errors(sensor, run_live(sensor)[0]))
    joint_orientations = smooth_orientations(
        sensor.gyr[:, None], sensor.acc[:, None], sensor.rate_hz, sensor.mag[:, None]
    )
    smoothed = rms_deg(find_errors(sensor, joint_orientations.q[:, 0]))
    assert live[:2].max() < 0.6
    assert live[2] < 1.2
    assert smoothed[:2].max() < 0.25
    assert smoothed[:2].max() < live[:2].max()


@pytest.mark.parametrize("field", [True, False])
def test_the_field_does_not_tilt(field: bool) -> None:
    sensor = moved()
    off = find_errors(sensor, run_live(sensor, field=field)[0])
    if not field:  # the heading is free: tilt is what is left after the turn about the vertical
        turned = np.zeros_like(off)
        turned[:, 2] = -off[:, 2]
        off[:, 2] = 0.0
    assert rms_deg(off)[:2].max() < 0.6


@pytest.mark.sweep
def test_what_is_wrong_with_the_sensor_is_found_as_surely_as_stated() -> None:
    result = []
    for seed in range(4):
        sensor = moved(seed, turning=4.0)
        estimates = run_live(sensor)[1].estimates
        assert estimates.mag_delay_s is not None
        result.append(estimates)
        assert estimates.mag_delay_s[0] == pytest.approx(sensor.faults.mag_delay_s, abs=0.0015)
    bias = np.mean([e.gyro_bias[0] for e in result], axis=0)
    assert np.degrees(bias) == pytest.approx(np.degrees(SensorFaults().gyro_bias), abs=0.06)


def test_a_wrong_gyroscope_matrix_is_learnt_from_turns() -> None:
    """A turn of 40 rad about each axis in turn, and back to rest: one part in a thousand is 2°."""
    rng, rate = np.random.default_rng(1), 100.0
    rows = [np.zeros((300, 3))]
    for axis in range(3):
        for sign in (1.0, -1.0):
            rows += [np.tile(sign * 4.0 * np.eye(3)[axis], (1000, 1)), np.zeros((200, 3))]
    omega = np.concatenate(rows)
    faults = SensorFaults(gyro_matrix=np.diag([0.004, -0.003, 0.002]))
    q, up, north = np.array([1.0, 0.0, 0.0, 0.0]), [], []
    for w in omega:
        q = multiply(q, exp(w / rate))
        up.append(rotate(conjugate(q), np.array([0.0, 0.0, 9.80665])))
        north.append(rotate(conjugate(q), np.array([0.0, 0.5, -0.8660254])))
    gyr = omega @ (np.eye(3) + faults.gyro_matrix).T + 3.5e-3 * rng.normal(size=omega.shape)
    run = SelfCalibratingFilter(rate, magnetometer=True)
    run.advance(gyr[:, None], np.array(up)[:, None], np.array(north)[:, None])
    diag = np.diag(run.estimates.gyro_matrix[0])
    assert diag == pytest.approx(np.diag(faults.gyro_matrix), abs=0.0012)
    # another recording of the device, begun with what this one found
    second = SelfCalibratingFilter(rate, magnetometer=True, gyro_matrix=run.estimates.gyro_matrix)
    second.advance(gyr[:100, None], np.array(up)[:100, None], np.array(north)[:100, None])
    assert np.diag(second.estimates.gyro_matrix[0]) == pytest.approx(diag, abs=1e-4)


@pytest.mark.sweep
def test_a_bias_that_comes_with_shaking_is_found_and_not_taken_for_tilt() -> None:
    """Some tenths of a degree a second while shaken; at rest nothing of it is seen."""
    true, result = np.radians([0.03, -0.025, 0.02]), []
    for seed in range(3):
        faults = SensorFaults(shaken_bias=true, gyro_matrix=np.zeros((3, 3)))
        sensor = move_sensor(60.0, seed=seed, shaking_m=0.12, faults=faults)
        q, run = run_live(sensor)
        result.append(run.estimates.shaken_bias[0])
        off, part = result[-1] - true, slice(at.SHAKEN, at.SHAKEN + 3)
        assert off @ np.linalg.solve(run._P[0, part, part], off) < 11.3  # 99 % of three
        assert rms_deg(find_errors(sensor, q))[:2].max() < 0.6
    assert np.linalg.norm(np.mean(result, axis=0) - true) < 0.5 * np.linalg.norm(true)


def test_the_field_of_another_region_is_not_taken_for_iron_or_heading() -> None:
    """Carried about and hardly turned, a sensor reads a field that is another than its table's for good."""
    region, faults = np.array([0.01, 0.06, -0.05]), SensorFaults(mag_noise=0.002)
    for seed in range(2):
        sensor = move_sensor(
            60.0, seed=seed, turning=0.4, shaking_m=0.1, field_sd=0.015, region=region, faults=faults
        )
        q, run = run_live(sensor)
        assert run.estimates.hard_iron is not None
        # read in norms of the field: 40 units a norm
        off, part = run.estimates.hard_iron[0] / 40.0 - faults.hard_iron, slice(at.IRON, at.IRON + 3)
        assert off @ np.linalg.solve(run._P[0, part, part], off) < 11.3  # 99 % of three
        sd = np.sqrt(run.estimates.orientation_covariance[0, 2, 2])
        assert abs(find_errors(sensor, q)[-1, 2]) < 3.0 * sd
        off = run._x[0, at.REGION + at.SHIFT : at.REGION + at.SHIFT + 3] - region
        part = slice(at.REGION, at.REGION + 3)
        assert off @ np.linalg.solve(run._P[0, part, part], off) < 11.3


def test_the_heading_of_the_start_is_as_sure_as_its_noisy_field_and_a_rest_averages_it() -> None:
    sensors, rng, level = 40, np.random.default_rng(0), np.zeros((2000, 40, 3))
    mag = NORTH + MAG_NOISE * np.sqrt(100.0) * rng.normal(size=level.shape)
    run = SelfCalibratingFilter(100.0, sensors, magnetometer=True)
    result = []
    for part in (slice(0, 60), slice(60, 2000)):
        q = run.advance(level[part], level[part] + [0.0, 0.0, GRAVITY_MPS2], mag[part])[-1]
        sd = np.sqrt(run.estimates.orientation_covariance[:, 2, 2])
        result.append((np.sqrt(np.mean(log(q)[:, 2] ** 2)), np.mean(sd)))
    assert result[0][0] == pytest.approx(result[0][1], rel=0.4)
    assert result[1][0] < min(result[1][1], 0.6 * result[0][0])


@pytest.mark.sweep
@pytest.mark.parametrize("back", [True, False])
def test_heading_is_surer_where_the_sensor_is_back_at_its_start(back: bool) -> None:
    """The field strays in motion; at the end it is the start's, or that of a place where it is 5° off."""
    faults = SensorFaults(gyro_matrix=np.diag([0.003, -0.003, 0.003]), mag_noise=0.002)
    place = rotate(exp(np.radians([0.0, 0.0, 5.0])), NORTH) * [1.0, 1.0, 0.96]
    for seed in range(2):
        sensor = move_sensor(
            60.0,
            seed=seed,
            last_rest_s=6.0,
            field_sd=0.05,
            last_field=NORTH if back else place,
            faults=faults,
        )
        q, run = run_live(sensor)
        sd = np.sqrt(run.estimates.orientation_covariance[0, 2, 2])
        heading = find_errors(sensor, q)[-1, 2]
        assert abs(heading) < 3.0 * sd
        assert (np.degrees(sd) < 0.7) == back


@pytest.mark.parametrize("field", [True, False])
def test_blocks_of_any_length_give_the_same_bits(field: bool) -> None:
    sensor = moved()
    part = slice(0, 1500)
    signals = [v[part, None] for v in (sensor.gyr, sensor.acc, *((sensor.mag,) if field else ()))]
    whole = SelfCalibratingFilter(sensor.rate_hz, magnetometer=field).advance(*signals)
    run, rng, k, rows = (
        SelfCalibratingFilter(sensor.rate_hz, magnetometer=field),
        np.random.default_rng(2),
        0,
        [],
    )
    while k < 1500:
        size = int(rng.choice([0, 1, 2, 7, 33, 100]))
        rows.append(run.advance(*(v[k : k + size] for v in signals)))
        k += size
    assert np.array_equal(np.concatenate(rows), whole)


def test_sensors_together_are_each_as_alone() -> None:
    sensors = [moved(seed) for seed in range(3)]
    gyr, acc, mag = (np.stack([getattr(s, k)[:2000] for s in sensors], axis=1) for k in ("gyr", "acc", "mag"))
    together = SelfCalibratingFilter(100.0, 3, magnetometer=True).advance(gyr, acc, mag)
    joint_orientations = smooth_orientations(gyr, acc, 100.0, mag)
    for k, sensor in enumerate(sensors):
        separate, _ = run_live(
            MovingSensor(
                100.0, sensor.gyr[:2000], sensor.acc[:2000], sensor.mag[:2000], sensor.q, sensor.faults
            )
        )
        assert np.array_equal(together[:, k], separate)
        single = smooth_orientations(gyr[:, k : k + 1], acc[:, k : k + 1], 100.0, mag[:, k : k + 1])
        assert np.array_equal(joint_orientations.q[:, k], single.q[:, 0])


def test_no_doubt_is_hidden() -> None:
    """Tilt and heading are within the stated 95 % at nearly as many moments."""
    for seed in range(3):
        sensor = moved(seed)
        run = SelfCalibratingFilter(sensor.rate_hz, magnetometer=True)
        inside = []
        for k in range(0, 6000, 50):
            block = [v[k : k + 50, None] for v in (sensor.gyr, sensor.acc, sensor.mag)]
            q = run.advance(*block)[-1, 0]
            e = log(multiply(sensor.q[k + 49], conjugate(q)))
            P = run.estimates.orientation_covariance[0]
            inside.append(e @ np.linalg.solve(P, e) < 7.8)  # 95 % of three degrees of freedom
            assert np.allclose(P, P.T)
            assert np.linalg.eigvalsh(P)[0] > 0.0
        assert np.mean(inside) > 0.85


def test_lost_samples_are_bridged_and_forgotten() -> None:
    sensor = moved()
    gyr, acc, mag = (v[:, None].copy() for v in (sensor.gyr, sensor.acc, sensor.mag))
    gyr[2000:2050] = np.nan
    acc[2500:2520] = np.nan
    mag[3000:3300] = np.nan
    run = SelfCalibratingFilter(100.0, magnetometer=True)
    q = run.advance(gyr, acc, mag)[:, 0]
    assert np.isfinite(q).all()
    assert np.linalg.norm(q, axis=1) == pytest.approx(1.0, abs=1e-12)
    late = np.degrees(np.sqrt(np.mean(find_errors(sensor, q)[4500:] ** 2, axis=0)))
    assert late[:2].max() < 1.0
    smoothed = smooth_orientations(gyr, acc, 100.0, mag).q[:, 0]
    assert np.isfinite(smoothed).all()


def test_a_magnet_that_comes_turns_the_heading_little() -> None:
    sensor = moved()
    mag = sensor.mag[:, None].copy()
    mag[2500:, 0] += 40.0 * np.array([0.4, -0.2, 0.3])
    run = SelfCalibratingFilter(100.0, magnetometer=True)
    off = find_errors(sensor, run.advance(sensor.gyr[:, None], sensor.acc[:, None], mag)[:, 0])
    assert rms_deg(off)[2] < 4.0
    assert rms_deg(off)[:2].max() < 0.6


@pytest.mark.parametrize("n", [0, 1, 3, 40])
def test_short_recordings_have_orientations(n: int) -> None:
    sensor = moved()
    signals = [v[:n, None] for v in (sensor.gyr, sensor.acc, sensor.mag)]
    q = smooth_orientations(signals[0], signals[1], 100.0, signals[2]).q
    assert q.shape == (n, 1, 4)
    assert np.isfinite(q).all()


def test_hours_of_rest_and_of_motion_leave_the_covariance_sound() -> None:
    sensor = moved()
    run = SelfCalibratingFilter(100.0, magnetometer=False)
    for _ in range(10):
        run.advance(sensor.gyr[:, None], sensor.acc[:, None])
    P = run._P[0]
    assert np.isfinite(P).all()
    assert np.abs(P - P.T).max() <= 1e-12 * np.abs(P).max()
    assert np.linalg.eigvalsh(P)[0] > -1e-15


def test_what_cannot_be_run_is_refused() -> None:
    with pytest.raises(ParameterError, match="rate"):
        SelfCalibratingFilter(0.0, magnetometer=True)
    with pytest.raises(ParameterError, match="sensor"):
        SelfCalibratingFilter(100.0, 0, magnetometer=True)
    with pytest.raises(ParameterError, match="matrices"):
        SelfCalibratingFilter(100.0, 2, magnetometer=True, gyro_matrix=np.zeros((1, 3, 3)))
    with pytest.raises(ParameterError, match="gyro_noise"):
        SelfCalibratingParams(gyro_noise=-1.0)
    with pytest.raises(ParameterError, match="field_length_m"):
        SelfCalibratingParams(field_length_m=0.0)
    run = SelfCalibratingFilter(100.0, magnetometer=True)
    x = np.zeros((5, 1, 3))
    with pytest.raises(EstimationError, match="magnetometer"):
        run.advance(x, x)
    with pytest.raises(EstimationError, match="Expected"):
        run.advance(x, np.zeros((4, 1, 3)), x)
    run.advance(x, x, x)
    with pytest.raises(ParameterError, match="new one"):
        run.smooth(x, x, x)
