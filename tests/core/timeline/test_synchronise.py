"""Common axis of all sensors: alignment, gaps, rates, and impossible trials."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.errors import Notice, SignalError
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.frames import Floats, Segment
from sagittal.core.signals.recording import ImuStream, SensorSignals
from sagittal.core.timeline import TimelineParams, synchronise
from tests.core.formats.making import signals, stream, take
from tests.core.formats.test_samples import gaitmap
from tests.data import data_folder

ACC, GYR = signals(1000)


def lost(device: str, missing: slice, seed: int = 0) -> ImuStream:
    """A stream whose packets of a range were lost."""
    acc, gyr = signals(1000, seed)
    keep = np.ones(1000, bool)
    keep[missing] = False
    return stream(device, acc[keep], gyr[keep], t_s=np.flatnonzero(keep) / 100.0)


def test_samples_on_the_axis_are_copied_bit_for_bit() -> None:
    u = synchronise(take({"pelvis": stream("a", ACC, GYR)}))
    np.testing.assert_array_equal(u.sensors["pelvis"].acc, ACC)
    np.testing.assert_array_equal(u.sensors["pelvis"].gyr, GYR)
    assert u.sensors["pelvis"].valid.all()
    assert not u.sensors["pelvis"].interpolated.any()


def test_signals_without_a_hole_are_held_once() -> None:
    def laid(acc: Floats, t_s: Floats) -> tuple[ImuStream, SensorSignals]:
        inputs = stream("a", acc, GYR, t_s=t_s)
        return inputs, synchronise(take({"pelvis": inputs})).sensors["pelvis"]

    on_axis, gap = np.arange(1000) / 100.0, np.arange(1000) / 100.0 + 0.002 * (np.arange(1000) > 500)
    inputs, whole = laid(ACC, on_axis)
    assert inputs.gyr is not None
    assert np.shares_memory(whole.acc, inputs.acc)
    assert np.shares_memory(whole.gyr, inputs.gyr)
    inputs, moved = laid(ACC.copy(), gap)
    assert not np.shares_memory(moved.acc, inputs.acc)
    # by columns in memory: sums over the rows would round otherwise
    inputs, turned = laid(np.asfortranarray(ACC), on_axis)
    assert not np.shares_memory(turned.acc, inputs.acc)
    assert turned.acc.flags.c_contiguous
    np.testing.assert_array_equal(turned.acc, ACC)


def test_sensors_are_aligned_on_time_not_on_rows() -> None:
    early = stream("a", ACC, GYR)
    late = stream("b", ACC[137:].copy(), GYR[137:] + 0.001, t_s=1.37 + np.arange(863) / 100.0)
    u = synchronise(take({"foot_l": early, "foot_r": late}))
    assert len(u.t_s) == 863
    assert u.t_s[0] == 0.0
    np.testing.assert_array_equal(u.sensors["foot_l"].acc, u.sensors["foot_r"].acc)
    assert [n.code for n in u.notices] == ["cropped"]


@pytest.mark.parametrize("n_lost", [1, 5, 10])
def test_a_hole_of_up_to_a_tenth_of_a_second_is_interpolated_and_flagged(n_lost: int) -> None:
    s = synchronise(take({"pelvis": lost("a", slice(300, 300 + n_lost))})).sensors["pelvis"]
    assert s.valid.all()
    np.testing.assert_array_equal(np.flatnonzero(s.interpolated), np.arange(300, 300 + n_lost))
    share = (np.arange(n_lost) + 1) / (n_lost + 1)
    expected = ACC[299] + share[:, None] * (ACC[300 + n_lost] - ACC[299])
    np.testing.assert_allclose(s.acc[300 : 300 + n_lost], expected, atol=1e-9)


@pytest.mark.parametrize("n_lost", [11, 30, 200])
def test_a_longer_hole_is_invalid_and_holds_the_last_value(n_lost: int) -> None:
    s = synchronise(take({"pelvis": lost("a", slice(300, 300 + n_lost))})).sensors["pelvis"]
    np.testing.assert_array_equal(np.flatnonzero(~s.valid), np.arange(300, 300 + n_lost))
    assert not s.interpolated.any()
    np.testing.assert_array_equal(s.acc[300 : 300 + n_lost], np.tile(ACC[299], (n_lost, 1)))
    np.testing.assert_array_equal(s.acc[300 + n_lost :], ACC[300 + n_lost :])


def test_missing_values_are_holes_like_lost_packets() -> None:
    acc, gyr = ACC.copy(), GYR.copy()
    acc[100:105, 1] = np.nan
    gyr[400:420, 0] = np.nan
    acc[:3] = np.nan
    acc[-30:] = np.nan
    s = synchronise(take({"pelvis": stream("a", acc, gyr)})).sensors["pelvis"]
    np.testing.assert_array_equal(np.flatnonzero(s.interpolated), np.arange(100, 105))
    np.testing.assert_array_equal(np.flatnonzero(~s.valid), [0, 1, 2, *range(400, 420), *range(970, 1000)])


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**31), share=st.floats(0.0, 0.9), rate=st.sampled_from([60.0, 100.0, 204.8, 512.0])
)
def test_whatever_is_lost_the_axis_is_uniform_finite_and_honest(seed: int, share: float, rate: float) -> None:
    rng = np.random.default_rng(seed)
    n = int(8 * rate)
    keep = rng.random(n) >= share
    keep[[0, -1]] = True
    acc = rng.normal(0, 5, (n, 3))
    whole = stream("a", acc, acc[:, ::-1].copy(), rate_hz=rate)
    t = np.arange(n)[keep] / rate
    holes = stream("b", acc[keep] + 1.0, acc[keep], t_s=t, rate_hz=rate)
    u = synchronise(take({"foot_l": whole, "foot_r": holes}))
    assert len(u.t_s) == n
    np.testing.assert_allclose(np.diff(u.t_s), 1 / rate, rtol=1e-9)
    s = u.sensors["foot_r"]
    measured = s.valid & ~s.interpolated
    np.testing.assert_array_equal(measured, keep)
    np.testing.assert_array_equal(s.acc[keep], acc[keep] + 1.0)


def test_a_jittered_clock_is_laid_on_the_axis_within_its_curvature() -> None:
    rng = np.random.default_rng(4)
    t = np.arange(1000) / 100.0 + rng.uniform(-0.003, 0.003, 1000)
    wave = np.stack([np.sin(2 * np.pi * t), np.cos(2 * np.pi * t), np.full_like(t, 9.81)], axis=1)
    s = stream("a", wave, wave.copy(), t_s=t, clock="device")
    u = synchronise(take({"pelvis": s}))
    on_axis = u.t_s + t[0]
    np.testing.assert_allclose(u.sensors["pelvis"].acc[:, 0], np.sin(2 * np.pi * on_axis), atol=1.5e-3)
    assert u.sensors["pelvis"].valid.all()


def test_different_rates_meet_at_the_highest() -> None:
    t = np.arange(600) / 60.0
    slow = np.stack([np.sin(2 * np.pi * t), t, np.full_like(t, 9.81)], axis=1)
    u = synchronise(
        take({"foot_l": stream("a", ACC, GYR), "foot_r": stream("b", slow, slow.copy(), t_s=t, rate_hz=60.0)})
    )
    assert u.rate_hz == 100.0
    assert [n.code for n in u.notices] == ["rates_differ"]
    assert u.sensors["foot_r"].valid.all()
    np.testing.assert_allclose(u.sensors["foot_r"].acc[:, 1], u.t_s, atol=1e-9)


def test_a_sensor_that_stops_early_does_not_cut_the_others() -> None:
    short = stream("b", ACC[:400] + 1, GYR[:400])
    u = synchronise(
        take({"foot_l": stream("a", ACC, GYR), "pelvis": stream("c", ACC + 2, GYR), "foot_r": short})
    )
    assert len(u.t_s) == 1000
    np.testing.assert_array_equal(u.sensors["foot_r"].valid, np.arange(1000) < 400)
    (notice,) = u.notices
    assert (notice.code, notice.sensor) == ("unequal_lengths", "foot_r")
    assert "4.0 s" in notice.message


def test_notices_of_files_and_sensors_travel_with_the_axis() -> None:
    recording = take({"pelvis": stream("a", ACC, GYR)}, other=stream("b", ACC + 1, None))
    message = Notice("ignored_file", "readme.txt is a text and was not used.", severity="info")
    object.__setattr__(recording, "notices", (message,))
    assert message in synchronise(recording).notices


def test_a_worn_sensor_without_gyroscope_is_left_out() -> None:
    segments: dict[Segment, ImuStream] = {
        "pelvis": stream("a", ACC, GYR),
        "foot_l": stream("b", ACC + 1, None),
    }
    assert list(synchronise(take(segments)).sensors) == ["pelvis"]


def test_a_magnetometer_has_its_own_holes() -> None:
    mag = np.tile([0.5, 0.1, 0.8], (1000, 1))
    mag[1::2] = np.nan
    s = synchronise(take({"pelvis": stream("a", ACC, GYR, mag=mag)})).sensors["pelvis"]
    assert s.valid.all()
    assert s.mag is not None
    np.testing.assert_allclose(s.mag, np.tile([0.5, 0.1, 0.8], (1000, 1)))
    rare = mag.copy()
    rare[:900] = np.nan
    assert synchronise(take({"pelvis": stream("a", ACC, GYR, mag=rare)})).sensors["pelvis"].mag is None


def at(t0: float, device: str = "b", clock: str = "counter", rate: float = 100.0) -> ImuStream:
    return stream(device, ACC + 1, GYR, t_s=t0 + np.arange(1000) / rate, rate_hz=rate, clock=clock)


@pytest.mark.parametrize(
    ("worn", "code"),
    [
        ({}, "no_mapping"),
        ({"pelvis": stream("a", ACC, None)}, "missing_gyro"),
        ({"foot_l": stream("a", ACC, GYR), "foot_r": stream("b", ACC, GYR)}, "duplicate_stream"),
        ({"foot_l": stream("a", ACC, GYR), "foot_r": at(0.0, clock="device")}, "no_common_clock"),
        ({"foot_l": stream("a", ACC, GYR), "foot_r": at(20.0)}, "no_overlap"),
        ({"foot_l": stream("a", ACC, GYR), "foot_r": at(8.0)}, "too_short"),
        ({"foot_l": at(0.0, rate=25.0)}, "sample_rate_too_low"),
        ({"foot_l": stream("a", ACC[:300], GYR[:300])}, "too_short"),
        ({"foot_l": stream("a", ACC, np.where(ACC > 0, np.nan, np.nan))}, "bad_signal"),
    ],
)
def test_what_cannot_be_aligned_is_refused_with_a_sentence(worn: dict[Segment, ImuStream], code: str) -> None:
    with pytest.raises(SignalError) as e:
        synchronise(take(worn, spare=stream("z", ACC + 9, GYR)))
    assert e.value.code == code
    assert len(e.value.message) > 40


def test_the_limits_are_parameters() -> None:
    short = take({"foot_l": stream("a", ACC[:300], GYR[:300])})
    assert len(synchronise(short, TimelineParams(min_duration_s=1.0)).t_s) == 300


@pytest.mark.parametrize("rate", [60.0, 512.0])
def test_slow_and_fast_sensors_keep_their_rate(rate: float) -> None:
    acc, gyr = signals(int(10 * rate))
    assert synchronise(take({"pelvis": stream("a", acc, gyr, rate_hz=rate)})).rate_hz == rate


@pytest.mark.recorded
def test_real_sensors_with_unequal_ends_meet_on_the_counter() -> None:
    folder = data_folder("opensense_xsens_apdm", "walk_8imu_noGyr")
    recording = read_recording([SourceFile.of_path(p) for p in sorted(folder.iterdir())])
    with pytest.raises(SignalError, match="gyroscope"):
        synchronise(recording)
    lengths = {s.device_id: len(s.t_s) for s in recording.streams.values()}
    with_gyro = take(
        {
            segment: stream(d, recording.streams[d].acc, recording.streams[d].acc / 10)
            for d, segment in recording.segments.items()
            if segment
        }
    )
    u = synchronise(with_gyro)
    assert len(u.t_s) == min(lengths.values()) == 2432
    assert all(s.valid.all() for s in u.sensors.values())


def test_both_feet_of_gaitmap_keep_every_sample() -> None:
    recording = gaitmap("imu_sample.csv")
    u = synchronise(recording)
    assert (len(u.t_s), u.rate_hz) == (7928, 204.8)
    np.testing.assert_array_equal(u.sensors["foot_r"].gyr, recording.streams["foot_r"].gyr)
