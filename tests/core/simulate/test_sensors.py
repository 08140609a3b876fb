from __future__ import annotations

import hashlib

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import FOOT, GRAVITY, SIDES, Floats, Segment
from sagittal.core.rotation import angle_between, conjugate, exp, multiply, rotate
from sagittal.core.simulate import (
    Dropout,
    Pivot,
    RecordingSetup,
    Script,
    SensorNoise,
    Simulation,
    Stand,
    Straight,
    Walker,
    simulate,
)
from sagittal.core.simulate.gait.soft_tissue import SoftTissue
from sagittal.core.simulate.mems import add_sensor_errors
from sagittal.core.simulate.sensors import SimulatedSignals

SHORT: Script = (Stand(3.0), Straight(5.0, 0.6, 0.54), Stand(2.0))


def _sensor_orientation(simulation: Simulation, segment: Segment) -> Floats:
    return multiply(simulation.truth.q[segment], simulation.truth.mounts[segment].q_segment_sensor)


def _streams(seed: int) -> tuple[np.random.Generator, np.random.Generator]:
    return np.random.default_rng(seed), np.random.default_rng(seed + 1000)


def _fingerprint(simulation: Simulation) -> str:
    h = hashlib.sha256()
    for device, stream in simulation.recording.streams.items():
        h.update(device.encode() + stream.digest.encode() + stream.t_s.tobytes())
    for values in simulation.truth.angles.values():
        h.update(values.tobytes())
    return h.hexdigest()


def test_the_same_seed_gives_the_same_bits_and_another_seed_does_not() -> None:
    assert _fingerprint(simulate(SHORT, seed=3)) == _fingerprint(simulate(SHORT, seed=3))
    assert _fingerprint(simulate(SHORT, seed=3)) != _fingerprint(simulate(SHORT, seed=4))


def test_noise_and_losses_do_not_change_the_walk() -> None:
    plain = simulate(SHORT, seed=3, setup=RecordingSetup(noise=None))
    rough = simulate(SHORT, seed=3, setup=RecordingSetup(noise=SensorNoise().times(5.0), packet_loss=0.1))
    for segment, p in plain.truth.p.items():
        assert np.array_equal(p, rough.truth.p[segment])
        assert np.array_equal(plain.ideal[segment].acc, rough.ideal[segment].acc)


def test_the_orientation_of_a_sensor_is_that_of_its_bone_and_with_skin_what_its_gyroscope_felt() -> None:
    stiff = simulate(SHORT, seed=3)
    for segment, q in stiff.sensor_q.items():
        assert angle_between(q, _sensor_orientation(stiff, segment)).max() < 1e-7
    setup = RecordingSetup(tissue=SoftTissue(), impacts=True, sampling="increment")
    soft = simulate(SHORT, seed=3, setup=setup)
    q, gyr = soft.sensor_q["thigh_r"], soft.ideal["thigh_r"].gyr
    assert angle_between(q, _sensor_orientation(soft, "thigh_r")).max() > 0.01
    turned = multiply(q[:-1], exp(gyr[1:] / 100.0))
    assert angle_between(turned, q[1:]).max() < 1e-9


def test_sensors_at_rest_read_gravity_upwards_and_no_rate(mixed: Simulation) -> None:
    remainder = mixed.truth.t_s < 2.0
    for segment, signals in mixed.ideal.items():
        up = rotate(_sensor_orientation(mixed, segment)[remainder], signals.acc[remainder])
        assert np.allclose(up, [0.0, 0.0, GRAVITY], atol=1e-7)
        assert np.abs(signals.gyr[remainder]).max() < 1e-8


def test_a_flat_foot_reads_gravity_and_no_rate(mixed: Simulation) -> None:
    """docs/science/simulation.md, "Limits on construction"; two samples at each end see the spline bend into
    the movement."""
    for side in SIDES:
        flat = mixed.truth.flat[side].copy()
        for shift in (1, 2):
            flat[shift:] &= mixed.truth.flat[side][:-shift]
            flat[:-shift] &= mixed.truth.flat[side][shift:]
        signals = mixed.ideal[FOOT[side]]
        assert flat.mean() > 0.2
        assert np.linalg.norm(signals.gyr[flat], axis=1).max() < 1e-6
        assert np.abs(np.linalg.norm(signals.acc[flat], axis=1) - GRAVITY).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("impacts", [False, True])
def test_increments_integrate_back_to_the_truth(impacts: bool) -> None:
    """Limits of docs/science/simulation.md, "Signals", shocks or not."""
    script = (
        Stand(3.0),
        Straight(10.0, 0.6, 0.54),
        Pivot(np.pi, 0.7, 0.55),
        Straight(10.0, 0.6, 0.54),
        Stand(2.0),
    )
    setup = RecordingSetup(noise=None, sampling="increment", impacts=impacts)
    simulation = simulate(script, seed=6, setup=setup)
    dt = 1.0 / simulation.truth.rate_hz
    for segment in ("shank_r", "foot_l"):
        truth, signals = _sensor_orientation(simulation, segment), simulation.ideal[segment]
        place = rotate(simulation.truth.q[segment], simulation.truth.mounts[segment].position_m)
        position = simulation.truth.p[segment] + place
        q, v, p = truth[0], np.zeros(3), position[0]
        for k in range(1, len(truth)):
            a = rotate(q, signals.acc[k]) - [0.0, 0.0, GRAVITY]
            p = p + v * dt + 0.5 * a * dt**2
            v = v + a * dt
            q = multiply(q, exp(signals.gyr[k] * dt))
        assert np.degrees(angle_between(q, truth[-1])) < 1e-9
        assert np.abs(v).max() < 1e-9
        assert np.abs(p - position[-1]).max() < 1e-3


def test_instant_signals_are_derivatives_of_the_truth() -> None:
    fine = simulate(SHORT, seed=6, setup=RecordingSetup(noise=None, rate_hz=400.0))
    dt = 1.0 / fine.truth.rate_hz
    q = _sensor_orientation(fine, "thigh_l")
    gyr = fine.ideal["thigh_l"].gyr
    gap = multiply(conjugate(q[:-2]), q[2:])
    central = 2.0 * gap[:, 1:] * np.sign(gap[:, :1]) / (2.0 * dt)
    assert np.sqrt(np.mean((central - gyr[1:-1]) ** 2)) < 0.005 * np.sqrt(np.mean(gyr**2))


def test_the_field_is_constant_in_the_world(mixed: Simulation) -> None:
    for segment, signals in mixed.ideal.items():
        world = rotate(_sensor_orientation(mixed, segment), signals.mag)
        assert np.ptp(world, axis=0).max() < 1e-12
        assert np.linalg.norm(world[0]) == pytest.approx(1.0)


@pytest.mark.slow
def test_errors_are_of_the_declared_size() -> None:
    still = SimulatedSignals(*(np.zeros((20_000, 3)) for _ in range(3)))
    noise = SensorNoise(gyr_walk=0.0, acc_walk=0.0)
    measured, drawn = add_sensor_errors(still, noise, 100.0, *_streams(1))
    assert measured.gyr.mean(axis=0) == pytest.approx(drawn.gyr_bias, abs=1e-4)
    assert (measured.gyr - drawn.gyr_bias).std() == pytest.approx(10.0 * noise.gyr_density, rel=0.02)
    assert (measured.acc - drawn.acc_bias).std() == pytest.approx(10.0 * noise.acc_density, rel=0.02)
    biases = [add_sensor_errors(still, noise, 100.0, *_streams(s))[1].gyr_bias for s in range(60)]
    assert np.std(biases) == pytest.approx(noise.gyr_bias, rel=0.2)


def test_lost_packets_have_no_row() -> None:
    simulation = simulate(
        SHORT, seed=8, setup=RecordingSetup(packet_loss=0.05, dropouts=(Dropout("shank_r", 4.0, 5.0),))
    )
    n = len(simulation.truth.t_s)
    device = {segment: d for d, segment in simulation.recording.segments.items()}
    lost = {s: 1.0 - len(simulation.recording.streams[device[s]].t_s) / n for s in simulation.ideal}
    assert np.mean([share for s, share in lost.items() if s != "shank_r"]) == pytest.approx(0.05, abs=0.02)
    t = simulation.recording.streams[device["shank_r"]].t_s
    assert not ((t >= 4.0) & (t < 5.0)).any()
    assert np.isin(np.round(t * 100), np.arange(n)).all()


@pytest.mark.parametrize("rate", [60.0, 100.0, 512.0])
def test_other_rates_sample_the_same_walk(rate: float) -> None:
    simulation = simulate(
        (Stand(2.0), Straight(1.2, 0.6, 0.54), Stand(1.0)), setup=RecordingSetup(rate_hz=rate)
    )
    stream = next(iter(simulation.recording.streams.values()))
    assert np.allclose(np.diff(stream.t_s), 1.0 / rate)
    assert stream.rate_hz == rate
    assert len(stream.t_s) == len(simulation.truth.t_s)
    knee = np.degrees(simulation.truth.angles["knee_flexion_r"]).max()
    assert 55.0 < knee < 85.0


def test_mounts_without_spread_follow_the_segment() -> None:
    simulation = simulate(SHORT, Walker(), setup=RecordingSetup(mount_spread_rad=0.0))
    for mount in simulation.truth.mounts.values():
        assert angle_between(mount.q_segment_sensor, np.array([1.0, 0.0, 0.0, 0.0])) < 1e-12


@pytest.mark.parametrize(
    ("rate", "loss", "code"),
    [(5.0, 0.0, "rate_range"), (4000.0, 0.0, "rate_range"), (100.0, 0.9, "loss_range")],
)
def test_a_bad_setup_is_refused(rate: float, loss: float, code: str) -> None:
    with pytest.raises(ParameterError) as caught:
        RecordingSetup(rate_hz=rate, packet_loss=loss)
    assert caught.value.code == code
