"""The live axis: the file's axis bit for bit where the take is clean, and an answer to all that is not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from time import perf_counter

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sagittal.core.errors import Notice, SignalError
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.formats.live_log import SampleBatch, SensorInfo, StreamInfo
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.timeline import synchronise
from sagittal.core.timeline.live import LiveAxis, UniformBlock, compile_axis_kernels
from tests.helpers.live import Device, LiveTake, Samples, send, shared
from tests.helpers.walks import cut, neura_recording

FEET: tuple[Segment, ...] = ("foot_l", "foot_r")


def laid(take: LiveTake) -> tuple[UniformBlock, tuple[Notice, ...], LiveAxis]:
    """All blocks of a take as one."""
    axis = LiveAxis(take.hello)
    blocks = [block for b in take.batches if (block := axis.push(b)) is not None]
    expected = 0
    for block in blocks:
        assert block.first == expected
        assert len(block) > 0
        expected += len(block)
    assert axis.length == expected
    whole = UniformBlock(
        0,
        *(
            np.concatenate([getattr(b, name) for b in blocks])
            for name in ("t_s", "acc", "gyr", "valid", "interpolated")
        ),
    )
    assert np.isfinite(whole.acc).all()
    assert np.isfinite(whole.gyr).all()
    return whole, axis.drain_notices(), axis


def of_file(take: LiveTake) -> UniformRecording:
    return synchronise(read_recording([SourceFile.of_bytes("take.sagittal-live", take.log())]))


def assert_equal_bits(block: UniformBlock, segments: tuple[Segment, ...], file: UniformRecording) -> None:
    """A prefix of the file's axis may be missing at the end, nothing else."""
    n = len(block)
    assert len(file.t_s) - n <= 1
    assert np.array_equal(block.t_s, file.t_s[:n])
    for i, segment in enumerate(segments):
        signals = file.sensors[segment]
        for name in ("acc", "gyr", "valid", "interpolated"):
            ours: Floats | Bools = getattr(block, name)[:, i]
            assert np.array_equal(ours, getattr(signals, name)[:n]), (segment, name)


def signal(t_s: Floats, width: int, seed: int) -> Samples:
    """Smooth acc and gyr (n, width, 9), no magnetometer."""
    rng = np.random.default_rng(seed)
    f, phase = rng.uniform(0.3, 3.0, (width, 6)), rng.uniform(0, 6.0, (width, 6))
    out = np.full((len(t_s), width, 9), np.nan, np.float32)
    out[:, :, :6] = np.sin(2 * np.pi * f * t_s[:, None, None] + phase)
    return out


def device(
    number: int, rate: float, segments: tuple[Segment, ...], seconds: float = 20.0, start_s: float = 1.0
) -> Device:
    """A clean shared clock."""
    t = start_s + np.arange(round(seconds * rate)) / rate
    sensors = tuple(SensorInfo(f"{s}-id", s) for s in segments)
    info = StreamInfo(number, rate, "shared", sensors)
    return Device(info, np.rint(1e6 * t).astype(np.int64), signal(t, len(segments), number))


def own(d: Device, ahead_us: int, drift: float = 1.0, delay_us: int = 20_000) -> Device:
    """The same device on a separate clock."""
    t_us: NDArray[np.int64] = np.rint(d.t_us * drift).astype(np.int64) + ahead_us
    return replace(
        d, info=replace(d.info, clock="own"), t_us=t_us, ahead_us=ahead_us, drift=drift, delay_us=delay_us
    )


def without(d: Device, rows: slice) -> Device:
    """A device that sent nothing for a while."""
    keep = np.ones(len(d.t_us), np.bool_)
    keep[rows] = False
    return replace(d, t_us=d.t_us[keep], samples=d.samples[keep])


@cache
def neura() -> LiveTake:
    return send([shared(neura_recording())])


@pytest.mark.recorded
def test_the_axis_of_neura_walk_is_that_of_its_file_bit_for_bit() -> None:
    take = neura()
    block, notices, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    assert len(block) == len(synchronise(neura_recording()).t_s)
    assert notices == ()


@pytest.mark.recorded
def test_the_signals_of_neura_walk_are_those_of_the_vendors_export() -> None:
    block, _, axis = laid(neura())
    exported = synchronise(neura_recording())
    for i, segment in enumerate(axis.segments):
        assert np.array_equal(block.acc[:, i], exported.sensors[segment].acc.astype(np.float32))
        assert np.array_equal(block.gyr[:, i], exported.sensors[segment].gyr.astype(np.float32))


@pytest.mark.recorded
@pytest.mark.parametrize("n", [1, 3, 10, 100, 1000])
def test_however_the_samples_are_cut_into_batches_the_bits_are_the_same(n: int) -> None:
    whole, _, _ = laid(neura())
    cut, _, _ = laid(neura().cut(n))
    for name in ("t_s", "acc", "gyr", "valid", "interpolated"):
        assert getattr(cut, name).tobytes() == getattr(whole, name).tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 7, 20])
def test_streams_of_unequal_rates_meet_on_the_faster_one(n: int) -> None:
    take = send([device(0, 100.0, ("pelvis", "shank_l")), device(4, 60.0, FEET, start_s=1.007)], n)
    block, _, axis = laid(take)
    assert axis.rate_hz == 100.0
    assert axis.segments == ("pelvis", "shank_l", "foot_l", "foot_r")
    assert_equal_bits(block, axis.segments, of_file(take))
    assert block.valid.all()


@pytest.mark.slow
def test_lost_packets_are_filled_up_to_a_tenth_of_a_second_and_lost_beyond() -> None:
    clean = device(0, 100.0, FEET)
    samples = clean.samples.copy()
    samples[300:309, 0, :6] = np.nan
    samples[500:530, 0, :6] = np.nan
    samples[700, 1, 4] = np.inf
    take = send([replace(clean, samples=samples)])
    block, _, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    assert block.valid[300:309, 0].all()
    assert block.interpolated[300:309, 0].all()
    assert not block.valid[500:530, 0].any()
    assert np.array_equal(block.acc[500:530, 0], np.tile(block.acc[499, 0], (30, 1)))
    assert block.valid[:, 1].all()
    assert block.interpolated[700, 1]


@pytest.mark.parametrize("missing", [5, 9, 10, 11, 12, 40])
def test_a_hole_in_the_whole_stream_is_as_in_the_file(missing: int) -> None:
    take = send([without(device(0, 100.0, FEET), slice(400, 400 + missing))])
    block, _, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    assert block.valid.all() == (missing <= 10)


def test_jittering_samples_are_interpolated_as_in_the_file() -> None:
    clean = device(0, 100.0, FEET)
    jitter = np.random.default_rng(1).integers(-3000, 3000, len(clean.t_us))
    take = send([replace(clean, t_us=clean.t_us + jitter, jitter=True)])
    block, _, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    assert block.valid.mean() > 0.99
    repeat, _, _ = laid(take.cut(4))
    assert repeat.acc.tobytes() == block.acc.tobytes()


@pytest.mark.slow
@given(st.integers(0, 1 << 32), st.sampled_from([41.7, 60.0, 99.0, 100.0]), st.integers(1, 40))
@settings(max_examples=40, deadline=None)
@example((1 << 32) - 1, 60.0, 1)  # a sample as far beside a point as still counts as on it, but for rounding
def test_whatever_is_lost_and_however_times_jitter_the_points_are_those_of_the_file(
    seed: int, rate: float, n: int
) -> None:
    rng = np.random.default_rng(seed)
    devices = []
    for number, segments in ((0, FEET), (1, ("pelvis",))):
        d = device(number, rate if number else 100.0, segments, 8.0, 1.0 + 0.2 * rng.random())
        samples = d.samples.copy()
        samples[rng.random(samples.shape[:2]) < 0.15 * rng.random()] = np.nan
        shift = rng.integers(-4000, 4000, len(d.t_us))
        retained = rng.random(len(d.t_us)) > 0.1 * rng.random()
        retained[:3] = retained[-3:] = True
        samples[:3] = samples[-3:] = 0.5 + number
        devices.append(
            replace(d, t_us=(d.t_us + shift)[retained], samples=samples[retained], jitter=True, delay_us=1000)
        )
    take = send(devices, n)
    block, _, axis = laid(take)
    file = of_file(take)
    # a sensor may end with a hole, whose end only the file knows
    assert 0 <= len(file.t_s) - len(block) < 15
    file = cut(file, 0.0, len(block) / axis.rate_hz)
    assert_equal_bits(block, axis.segments, file)


def test_own_clocks_are_laid_over_each_other_by_when_they_were_sent() -> None:
    left, right = device(0, 60.0, ("foot_l",)), device(1, 60.0, ("foot_r",))
    right = replace(right, samples=-left.samples)
    take = send([own(left, 7_000_000_000), own(right, 40_000_000)])
    block, _, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    assert np.abs(block.acc[:, 0] + block.acc[:, 1]).max() < 1e-3
    assert block.valid.all()


def test_shared_and_own_clocks_of_one_take_meet() -> None:
    pelvis, shanks, left = (
        device(0, 100.0, ("pelvis",)),
        device(1, 60.0, ("shank_l", "shank_r"), 19.6, 1.4),
        device(2, 60.0, ("foot_l",)),
    )
    pelvis, shanks = (replace(d, t_us=d.t_us + 9_000_000, ahead_us=9_000_000) for d in (pelvis, shanks))
    take = send([pelvis, shanks, own(left, 777_000_000)], 6)
    block, notices, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    assert notices == ()
    first = {d: s.t_s[0] for d, s in read_recording([SourceFile.of_bytes("x", take.log())]).streams.items()}
    assert first["shank_l-id"] - first["pelvis-id"] == pytest.approx(0.4, abs=1e-5)
    assert first["foot_l-id"] - first["pelvis-id"] == pytest.approx(0.0, abs=1e-5)


def test_a_sender_whose_clock_is_of_no_use_does_not_stop_the_axis() -> None:
    take = send([device(0, 100.0, ("foot_l",)), device(1, 100.0, ("foot_r",))])
    mad = [replace(b, sent_us=1 << 52) if b.seq == 10 else b for b in take.batches]
    block, _, _ = laid(LiveTake(take.hello, tuple(mad)))
    assert len(block) > 1900


def test_an_own_clock_that_is_delayed_more_is_off_by_the_difference_of_the_least_delays() -> None:
    left, right = device(0, 60.0, ("foot_l",)), device(1, 60.0, ("foot_r",))
    take = send([own(left, 5_000_000, delay_us=20_000), own(right, 0, delay_us=45_000)])
    file = read_recording([SourceFile.of_bytes("x", take.log())])
    first = {d: s.t_s[0] for d, s in file.streams.items()}
    assert first["foot_r-id"] - first["foot_l-id"] == pytest.approx(0.025, abs=2e-6)
    assert [n.code for n in file.notices] == ["clocks_aligned"]


def test_an_own_clock_that_drifts_stays_within_its_drift() -> None:
    left, right = device(0, 100.0, ("foot_l",), 60.0), device(1, 100.0, ("foot_r",), 60.0)
    right = replace(right, samples=-left.samples)
    take = send([own(left, 0), own(right, 3_000_000, drift=1 + 50e-6)])
    block, _, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    slope = np.abs(np.gradient(block.acc[:, 0], 0.01, axis=0)).max()
    apart = np.abs(block.acc[:, 0] + block.acc[:, 1]).max() / slope
    assert 1e-3 < apart < 50e-6 * 60.0 + 1e-3


def test_a_silent_stream_is_passed_over_and_returns() -> None:
    quiet = without(device(1, 100.0, ("foot_r",)), slice(600, 900))
    take = send([device(0, 100.0, ("foot_l",)), quiet])
    axis = LiveAxis(take.hello)
    reached = []
    for b in take.batches:
        axis.push(b)
        sample = round((b.t0_us * 1e-6 - 1.0) * 100) + len(b.samples)
        reached.append(sample - axis.length)
    assert max(reached) <= 50, "never more than the silence and a batch behind"
    block, _, _ = laid(take)
    file = of_file(take).sensors
    assert np.array_equal(block.acc[:, 0], file["foot_l"].acc)
    # its first batch after the silence comes when the axis is past it already
    same = np.r_[0:900, 910:2000]
    assert np.array_equal(block.acc[same, 1], file["foot_r"].acc[same])
    assert np.array_equal(block.valid[same, 1], file["foot_r"].valid[same])
    assert not block.valid[600:900, 1].any()


def test_long_batches_are_not_taken_for_silence() -> None:
    first, second = device(0, 100.0, ("foot_l",)), device(1, 100.0, ("foot_r",), start_s=1.25)
    take = send([first, second], 50)
    block, _, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    assert block.valid.all()


def test_a_stream_that_never_comes_is_waited_for_three_seconds() -> None:
    first, second = device(0, 100.0, ("foot_l",)), device(1, 100.0, ("foot_r",))
    take = send([first, second])
    single = LiveTake(take.hello, tuple(b for b in take.batches if b.stream == 0))
    block, notices, _ = laid(single)
    assert [n.code for n in notices] == ["sensor_missing"]
    assert len(block) == 2000, "what was held back is not lost"
    assert block.valid[:, 0].all()
    assert not block.valid[:, 1].any()


def test_a_stream_that_comes_late_joins() -> None:
    late = device(1, 100.0, ("foot_r",), 12.0, start_s=9.0)
    block, _, _ = laid(send([device(0, 100.0, ("foot_l",)), late]))
    assert not block.valid[:800, 1].any()
    assert block.valid[811:, 1].all()


def test_samples_that_run_backwards_are_left_out_as_in_the_file() -> None:
    clean = device(0, 100.0, FEET)
    t_us = clean.t_us.copy()
    t_us[1000:] -= 50_000
    take = send([replace(clean, t_us=t_us)])
    block, notices, axis = laid(take)
    assert_equal_bits(block, axis.segments, of_file(take))
    assert [n.code for n in notices] == ["out_of_order"]


@pytest.mark.parametrize("ahead_us", [700_000_000, 1 << 50])
def test_a_clock_that_jumps_does_not_make_the_axis_endless(ahead_us: int) -> None:
    take = send([device(0, 100.0, FEET)])
    mad = [replace(b, t0_us=b.t0_us + ahead_us) if b.seq == 100 else b for b in take.batches]
    block, notices, _ = laid(LiveTake(take.hello, tuple(mad)))
    assert len(block) == 2000
    assert [n.code for n in notices] == ["clock_jump"]
    assert not block.valid[1001:1009].any() or block.interpolated[1001:1009].all()


def test_a_sender_that_slept_leaves_a_gap() -> None:
    clean = device(0, 100.0, FEET)
    t_us = clean.t_us.copy()
    t_us[1000:] += 120_000_000
    block, notices, _ = laid(send([replace(clean, t_us=t_us)]))
    assert len(block) == 14_000
    assert not block.valid[1000:13_000].any()
    assert block.valid[13_000:].all()
    assert notices == ()


def test_no_clock_makes_more_samples_than_a_file_could_be_analysed_with() -> None:
    clean = device(0, 100.0, FEET, 2.0)
    axis = LiveAxis(send([clean]).hello)
    output = 0
    for k in range(60):
        position = k * 599_000_000
        block = axis.push(SampleBatch(0, k, position, position, clean.samples[:1]))
        output += 0 if block is None else len(block)
    assert output < 20 * 60 + 60_000


def test_a_shared_clock_that_is_not_does_not_stop_the_others() -> None:
    first, second = device(0, 100.0, ("foot_l",)), device(1, 100.0, ("foot_r",))
    variant = replace(second, t_us=second.t_us + 900_000_000, ahead_us=900_000_000)
    block, _, _ = laid(send([first, variant]))
    assert len(block) > 1000


def test_only_worn_sensors_are_on_the_axis() -> None:
    d = device(0, 100.0, ("pelvis", "foot_l", "foot_r"))
    sensors = (d.info.sensors[0], replace(d.info.sensors[1], segment=None), d.info.sensors[2])
    take = send([replace(d, info=replace(d.info, sensors=sensors))])
    block, _, axis = laid(take)
    assert axis.segments == ("pelvis", "foot_r")
    assert_equal_bits(block, axis.segments, of_file(take))
    assert np.array_equal(block.acc[:, 1], d.samples[:, 2, :3].astype(np.float64))


def test_takes_that_can_have_no_axis_are_refused_with_the_reason() -> None:
    d = device(0, 100.0, ("foot_l",))
    unworn = replace(d.info, sensors=(SensorInfo("a", None),))
    with pytest.raises(SignalError) as none:
        LiveAxis(send([replace(d, info=unworn)]).hello)
    assert none.value.code == "no_mapping"
    with pytest.raises(SignalError) as slow:
        LiveAxis(send([device(0, 30.0, FEET)]).hello)
    assert slow.value.code == "sample_rate_too_low"


@pytest.mark.bench
def test_a_push_of_seven_sensors_costs_less_than_a_sixth_of_a_millisecond() -> None:
    compile_axis_kernels()
    d = device(0, 100.0, ("pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r"))
    take = send([d])
    spent = []
    for _ in range(5):
        axis = LiveAxis(take.hello)
        start = perf_counter()
        for b in take.batches:
            axis.push(b)
        spent.append((perf_counter() - start) / len(take.batches))
    assert min(spent) < 0.15e-3
