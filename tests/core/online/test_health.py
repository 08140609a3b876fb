"""How sensors do over the last seconds: whole samples, ends of ranges, silence, and what others say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.formats.live_log import Hello, SampleBatch, SensorInfo, StreamInfo
from sagittal.core.online.frame import SensorHealth
from sagittal.core.online.health import OVER_S, SensorHealthMonitor

STEP_US, SIZE = 10_000, 50

HELLO = Hello(
    "take",
    "replay",
    (
        StreamInfo(2, 100.0, "shared", (SensorInfo("a", "pelvis", 160.0, 35.0), SensorInfo("b", None))),
        StreamInfo(5, 100.0, "shared", (SensorInfo("c", "foot_l"),)),
    ),
)


def batch(stream: int, number: int, sensors: int = 1, n: int = SIZE) -> SampleBatch:
    """Half a second of samples, sent when the last one was measured."""
    samples = np.ones((n, sensors, 9), np.float32)
    samples[:, :, 6:] = np.nan
    start_us = 1_000_000 + number * SIZE * STEP_US
    return SampleBatch(stream, number, start_us, start_us + n * STEP_US, samples)


def fill(monitor: SensorHealthMonitor, batches: int = 4) -> None:
    for k in range(batches):
        monitor.push(batch(2, k, 2))
        monitor.push(batch(5, k))


def found(monitor: SensorHealthMonitor) -> dict[str, SensorHealth]:
    health = monitor.read_health(())
    assert [h.id for h in health] == ["a", "b", "c"]
    return {h.id: h for h in health}


def test_sensors_that_send_all_have_their_rate_and_lose_nothing() -> None:
    monitor = SensorHealthMonitor(HELLO)
    fill(monitor)
    for h in found(monitor).values():
        assert h.rate_hz == pytest.approx(100.0)
        assert (h.lost_share, h.saturated_share, h.silent_s) == (0.0, 0.0, 0.0)
        assert (h.still, h.stuck, h.doubt) == (False, False, None)
    assert [h.segment for h in found(monitor).values()] == ["pelvis", None, "foot_l"]


def test_before_the_first_batch_everything_is_lost_and_nobody_silent() -> None:
    monitor = SensorHealthMonitor(HELLO)
    assert {(h.rate_hz, h.lost_share, h.silent_s) for h in found(monitor).values()} == {(0.0, 1.0, 0.0)}


def test_a_sample_without_one_channel_is_lost_and_a_missing_magnetometer_is_not() -> None:
    monitor = SensorHealthMonitor(HELLO)
    one = batch(2, 0, 2)
    one.samples[:10, 0, 5] = np.nan
    monitor.push(one)
    a, b = found(monitor)["a"], found(monitor)["b"]
    assert a.lost_share == pytest.approx(0.2)
    assert a.rate_hz == pytest.approx(80.0)
    assert b.lost_share == 0.0


def test_packets_that_never_came_are_lost() -> None:
    monitor = SensorHealthMonitor(HELLO)
    monitor.push(batch(5, 0))
    monitor.push(batch(5, 2))
    c = found(monitor)["c"]
    assert c.lost_share == pytest.approx(1.0 / 3.0)
    assert c.rate_hz == pytest.approx(100.0 * 2.0 / 3.0)


@pytest.mark.parametrize(("channel", "end"), [(0, 160.0), (2, 160.0), (3, 35.0), (5, 35.0)])
def test_a_component_at_the_end_of_its_own_range_is_saturated(channel: int, end: float) -> None:
    monitor = SensorHealthMonitor(HELLO)
    one = batch(2, 0, 2)
    one.samples[:5, 0, channel] = -0.996 * end
    one.samples[5:10, 0, channel] = 0.994 * end
    # of the other nobody said a range
    one.samples[:, 1, channel] = 1e6
    monitor.push(one)
    assert found(monitor)["a"].saturated_share == pytest.approx(0.1)
    assert found(monitor)["b"].saturated_share == 0.0


def test_shares_are_of_the_last_five_seconds() -> None:
    monitor = SensorHealthMonitor(HELLO)
    one = batch(5, 0)
    one.samples[:, 0, 0] = np.nan
    monitor.push(one)
    last = round(OVER_S * 100.0 / SIZE)
    for k in range(1, last + 1):
        monitor.push(batch(5, k))
    # the first batch ends five seconds ago, not longer
    assert found(monitor)["c"].lost_share == pytest.approx(1.0 / (last + 1))
    monitor.push(batch(5, last + 1))
    assert found(monitor)["c"].lost_share == 0.0


def test_silence_is_measured_by_the_other_streams() -> None:
    monitor = SensorHealthMonitor(HELLO)
    monitor.push(batch(2, 0, 2))
    monitor.push(batch(2, 6, 2))
    # never heard of: since the first batch of the take
    assert found(monitor)["c"].silent_s == pytest.approx(3.0)
    monitor.push(batch(5, 4))
    assert found(monitor)["c"].silent_s == pytest.approx(1.0)
    # a batch that was held up does not turn time back
    monitor.push(replace(batch(5, 5), sent_us=0))
    assert found(monitor)["a"].silent_s == 0.0


def test_times_of_single_samples_are_believed() -> None:
    monitor = SensorHealthMonitor(HELLO)
    slow = np.arange(SIZE, dtype=np.uint32) * np.uint32(2 * STEP_US)
    monitor.push(replace(batch(5, 0), offsets_us=slow))
    # 50 samples from the first to one step after the last at 98 steps
    assert found(monitor)["c"].rate_hz == pytest.approx(SIZE / 0.99)
    assert found(monitor)["c"].lost_share == pytest.approx(1.0 - SIZE / 99)


def test_rest_doubts_and_stuck_sensors_are_told_by_segment_and_an_unchanged_sensor_stays_the_same() -> None:
    monitor = SensorHealthMonitor(HELLO)
    fill(monitor)
    initial_health = monitor.read_health(())
    assert all(x is y for x, y in zip(initial_health, monitor.read_health(()), strict=True))
    hips, foot = HELLO.streams[0].sensors[0].segment, HELLO.streams[1].sensors[0].segment
    assert hips is not None
    assert foot is not None
    a, b, c = monitor.read_health((hips,), (foot,), {foot: "sensor_late"})
    assert (a.still, a.stuck, a.doubt) == (True, False, None)
    assert (c.still, c.stuck, c.doubt) == (False, True, "sensor_late")
    assert b is initial_health[1]
