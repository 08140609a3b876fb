from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats, Segment
from sagittal.core.rotation import multiply, rotate
from sagittal.core.simulate import Dipole, RecordingSetup, SensorNoise, Simulation, Stand, Straight, simulate
from sagittal.core.simulate.magnetics import FIELD_DIP, IRON_SIZE_M, earth_field, field_at

SCRIPT = (Stand(3.0), Straight(6.4, 0.64, 0.54), Stand(2.0))
BESIDE = Dipole((3.0, 0.6, 0.4), (0.0, 0.05, 0.0))
"""Something like a steel cabinet beside the walkway: 0.2 to 0.5 of the Earth's field at the nearest leg."""


def _world_field(result: Simulation, segment: Segment) -> Floats:
    q = multiply(result.truth.q[segment], result.truth.mounts[segment].q_segment_sensor)
    return rotate(q, result.ideal[segment].mag)


def test_the_earth_field_points_down_in_the_north() -> None:
    field = earth_field(0.5)
    assert np.linalg.norm(field) == pytest.approx(1.0)
    assert np.arctan2(field[1], field[0]) == pytest.approx(0.5)
    assert np.arcsin(-field[2]) == pytest.approx(FIELD_DIP)


def test_a_dipole_has_the_field_of_a_dipole() -> None:
    """Twice the moment on the axis at 1 m, minus the moment at its side, an eighth at double the distance."""
    thing = (Dipole((1.0, 2.0, 0.5), (0.0, 0.0, 0.03)),)
    places = np.array([[1.0, 2.0, 1.5], [2.0, 2.0, 0.5], [1.0, 2.0, 2.5]])
    extra = field_at(places, 0.0, thing) - earth_field(0.0)
    expected = np.array([[0.0, 0.0, 0.06], [0.0, 0.0, -0.03], [0.0, 0.0, 0.06 / 8.0]])
    assert extra == pytest.approx(expected, abs=1e-12)


def test_its_field_has_no_sources_and_no_currents() -> None:
    """Divergence and curl by central differences vanish outside the thing."""
    thing, values, h = (BESIDE,), np.array([2.2, 0.1, 0.9]), 1e-4
    jacobian = np.empty((3, 3))
    for k in range(3):
        step = h * np.eye(3)[k]
        ahead, details = field_at(np.array([values + step, values - step]), 0.0, thing)
        jacobian[:, k] = (ahead - details) / (2.0 * h)
    assert np.trace(jacobian) == pytest.approx(0.0, abs=1e-6)
    assert jacobian == pytest.approx(jacobian.T, abs=1e-6)


def test_the_field_stays_finite_in_the_thing_itself() -> None:
    places = np.array([BESIDE.position_m, np.add(BESIDE.position_m, [0.0, 0.3 * IRON_SIZE_M, 0.0])])
    assert np.isfinite(field_at(places, 0.0, (BESIDE,))).all()


def test_the_field_bends_where_the_iron_is_and_nowhere_else() -> None:
    simulation = simulate(SCRIPT, seed=5, setup=RecordingSetup(noise=None, dipoles=(BESIDE,)))
    field = _world_field(simulation, "shank_l")
    offset = np.linalg.norm(simulation.truth.p["shank_l"] - BESIDE.position_m, axis=1)
    strength = np.abs(np.linalg.norm(field, axis=1) - 1.0)
    assert strength[offset < 0.9].max() > 0.1
    assert strength[offset > 2.5].max() < 0.01
    assert np.corrcoef(offset[offset < 2.0], strength[offset < 2.0])[0, 1] < -0.5


def test_iron_in_the_room_leaves_the_other_signals_alone() -> None:
    plain, disturbed = (simulate(SCRIPT, seed=5, setup=RecordingSetup(dipoles=d)) for d in ((), (BESIDE,)))
    for device, stream in plain.recording.streams.items():
        other_streams = disturbed.recording.streams[device]
        assert np.array_equal(stream.acc, other_streams.acc)
        assert stream.gyr is not None
        assert other_streams.gyr is not None
        assert np.array_equal(stream.gyr, other_streams.gyr)
        assert stream.mag is not None
        assert other_streams.mag is not None
        assert not np.array_equal(stream.mag, other_streams.mag)


def test_hard_iron_is_a_constant_in_the_sensor() -> None:
    noise = SensorNoise(mag_density=0.0, hard_iron=0.1)
    simulation = simulate(SCRIPT, seed=6, setup=RecordingSetup(noise=noise))
    for device, segment in simulation.recording.segments.items():
        assert segment is not None
        mag = simulation.recording.streams[device].mag
        assert mag is not None
        drawn = simulation.truth.errors[segment].hard_iron
        assert mag - simulation.ideal[segment].mag == pytest.approx(np.tile(drawn, (len(mag), 1)), abs=1e-12)
        assert np.abs(drawn).max() > 0.0


def test_a_dipole_that_is_not_a_number_is_refused() -> None:
    with pytest.raises(ParameterError) as caught:
        Dipole((float("nan"), 0.0, 0.0), (0.0, 0.0, 1.0))
    assert caught.value.code == "dipole_not_finite"
