"""What happens between sensor and receiver: lagging clocks, ranges, lost packets, sensors left at home."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats, Segment
from sagittal.core.simulate import Dropout, Lag, RecordingSetup, Simulation, Stand, Straight, simulate
from sagittal.core.timeline import synchronise

SCRIPT = (Stand(3.0), Straight(6.4, 0.64, 0.54), Stand(2.0))
EXACT = RecordingSetup(noise=None, mount_spread_rad=0.0)


@dataclass(frozen=True)
class Sent:
    """What arrived from one sensor."""

    t_s: Floats
    acc: Floats
    gyr: Floats


def _stream(result: Simulation, segment: Segment) -> Sent:
    stream = result.recording.streams[next(d for d, s in result.recording.segments.items() if s == segment)]
    assert stream.gyr is not None
    return Sent(stream.t_s, stream.acc, stream.gyr)


def _lag_s(early: Floats, late: Floats, rate_hz: float) -> float:
    """Lag of the second signal at the best match of the two, finer than a sample."""
    early, late = early - early.mean(), late - late.mean()
    match = np.correlate(late, early, "full")
    k = int(np.argmax(match))
    initial, position, final = match[k - 1 : k + 2]
    return float(
        (k - len(early) + 1 + 0.5 * (initial - final) / (initial - 2.0 * position + final)) / rate_hz
    )


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.010, 0.0137, -0.025])
def test_a_lagging_clock_shows_everything_later(late_s: float) -> None:
    plain = simulate(SCRIPT, seed=4, setup=EXACT)
    lagging = simulate(SCRIPT, seed=4, setup=replace(EXACT, lags=(Lag("thigh_l", late_s),)))
    a, b = _stream(plain, "thigh_l"), _stream(lagging, "thigh_l")
    assert np.array_equal(a.t_s, b.t_s)
    assert _lag_s(a.gyr[:, 2], b.gyr[:, 2], 100.0) == pytest.approx(late_s, abs=5e-4)
    assert np.array_equal(_stream(plain, "thigh_r").gyr, _stream(lagging, "thigh_r").gyr)
    assert np.array_equal(plain.truth.q["thigh_l"], lagging.truth.q["thigh_l"])


def test_a_lag_of_whole_samples_moves_them() -> None:
    plain = simulate(SCRIPT, seed=4, setup=EXACT)
    lagging = simulate(SCRIPT, seed=4, setup=replace(EXACT, lags=(Lag("foot_r", 0.05),)))
    a, b = _stream(plain, "foot_r"), _stream(lagging, "foot_r")
    # the grid of nodes differs in places, so the two splines do by less than the noise of a sensor
    assert b.gyr[10:-10] == pytest.approx(a.gyr[5:-15], abs=1e-3)
    assert b.acc[10:-10] == pytest.approx(a.acc[5:-15], abs=0.05)


def test_a_lag_survives_the_common_time_axis() -> None:
    """Counters alone cannot show it: this is what makes it dangerous
    (docs/science/simulation.md, "Devices")."""
    recording = simulate(SCRIPT, seed=4, setup=replace(EXACT, lags=(Lag("thigh_l", 0.02),))).recording
    plain = synchronise(simulate(SCRIPT, seed=4, setup=EXACT).recording)
    uniform = synchronise(recording)
    lag = _lag_s(plain.sensors["thigh_l"].gyr[:, 2], uniform.sensors["thigh_l"].gyr[:, 2], uniform.rate_hz)
    assert lag == pytest.approx(0.02, abs=1e-3)


def test_readings_beyond_the_range_are_cut_and_marked() -> None:
    simulation = simulate(SCRIPT, seed=4, setup=RecordingSetup(acc_range=30.0, gyr_range=4.0))
    stream, clipped = _stream(simulation, "foot_l"), simulation.clipped["foot_l"]
    assert np.abs(stream.acc).max() == 30.0
    assert np.abs(stream.gyr).max() == 4.0
    at_limit = (np.abs(stream.acc) == 30.0).any(axis=1) | (np.abs(stream.gyr) == 4.0).any(axis=1)
    assert np.array_equal(at_limit, clipped)
    assert 0.02 < clipped.mean() < 0.5


def test_a_quiet_walk_stays_in_the_range_of_a_real_sensor() -> None:
    simulation = simulate(SCRIPT, seed=4, setup=RecordingSetup(impacts=True))
    assert not simulation.clipped["shank_r"].any()
    assert not simulation.clipped["pelvis"].any()


def test_sensors_not_worn_have_no_stream_and_leave_the_others_as_they_are() -> None:
    whole, feet = (
        simulate(SCRIPT, seed=4, setup=setup)
        for setup in (RecordingSetup(), RecordingSetup(worn=("foot_l", "foot_r")))
    )
    assert set(feet.recording.segments.values()) == {"foot_l", "foot_r"}
    assert np.array_equal(_stream(whole, "foot_l").acc, _stream(feet, "foot_l").acc)


def test_a_sensor_that_fails_halfway_is_known_as_lost() -> None:
    simulation = simulate(
        SCRIPT, seed=4, setup=RecordingSetup(dropouts=(Dropout("shank_l", 4.0, float("inf")),))
    )
    valid = synchronise(simulation.recording).sensors["shank_l"].valid
    t = np.arange(len(valid)) / 100.0
    assert valid[t < 3.9].all()
    assert not valid[t > 4.1].any()


@pytest.mark.parametrize(
    ("wrong", "code"),
    [
        ({"acc_range": 0.0}, "range_not_positive"),
        ({"gyr_range": float("nan")}, "range_not_positive"),
    ],
)
def test_an_impossible_setup_is_refused(wrong: dict[str, object], code: str) -> None:
    with pytest.raises(ParameterError) as caught:
        RecordingSetup(**wrong)  # type: ignore[arg-type]
    assert caught.value.code == code


def test_a_lag_of_seconds_is_refused() -> None:
    with pytest.raises(ParameterError) as caught:
        Lag("foot_l", 3.0)
    assert caught.value.code == "clock_offset_range"
