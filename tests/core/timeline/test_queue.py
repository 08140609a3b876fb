"""One stream before alignment: content, reversed times, overdue detection."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.formats.live_hello import SensorInfo, StreamInfo
from sagittal.core.formats.live_log import SampleBatch
from sagittal.core.timeline.queue import LONGEST_SPAN_US, StreamQueue

INFO = StreamInfo(
    4, 100.0, "shared", (SensorInfo("a", "pelvis"), SensorInfo("b", None), SensorInfo("c", "foot_l"))
)


def hold(queue: StreamQueue, times_us: list[int], sent_us: int = 0, *, offsets: bool = False) -> bool:
    t_us = np.array(times_us, np.int64)
    samples = np.repeat(t_us, 27).reshape(-1, 3, 9).astype(np.float32)
    notices = (t_us - t_us[0]).astype(np.uint32) if offsets else None
    return queue.hold(t_us, SampleBatch(4, 0, times_us[0], sent_us, samples, notices))


def held(queue: StreamQueue) -> list[int]:
    times = [int(t) for t_us, _ in queue.held for t in t_us]
    assert times == [int(row[0, 0]) for _, samples in queue.held for row in samples]
    return times


def test_only_worn_sensors_are_held() -> None:
    queue = StreamQueue(INFO)
    assert queue.columns.tolist() == [0, 2]
    assert queue.ids == ("a", "c")
    assert (queue.stream, queue.rate_hz, queue.heard) == (4, 100.0, False)


def test_samples_that_run_backwards_are_left_out_and_told() -> None:
    queue = StreamQueue(INFO)
    assert not hold(queue, [1000, 2000, 3000])
    assert hold(queue, [3000, 4000])
    assert hold(queue, [1500, 2500])
    assert hold(queue, [5000, 4500, 5500, 5500, 6000], offsets=True)
    assert held(queue) == [1000, 2000, 3000, 4000, 5000, 5500, 6000]
    assert queue.samples == 7
    assert not hold(queue, [6001])


def test_a_batch_is_measured_from_the_last_and_from_the_first_sample() -> None:
    queue = StreamQueue(INFO)
    assert (queue.ahead_s(5_000_000), queue.whole_s(5_000_000)) == (0.0, 0.0)
    hold(queue, [1_000_000, 2_000_000])
    assert queue.ahead_s(5_000_000) == pytest.approx(3.0)
    assert queue.whole_s(5_000_000) == pytest.approx(4.0)
    assert queue.ahead_s(500_000) == pytest.approx(-1.5)


def test_a_stream_is_overdue_once_its_usual_batch_could_have_been_sent() -> None:
    queue = StreamQueue(INFO)
    assert queue.overdue_s(10**9) == np.inf
    hold(queue, [0, 40_000], sent_us=100_000)
    assert queue.overdue_s(100_000) == pytest.approx(-0.04)
    assert queue.overdue_s(440_000) == pytest.approx(0.3)
    # a batch that was on its way for longer is no newer
    hold(queue, [50_000, 60_000], sent_us=90_000)
    assert queue.overdue_s(440_000) == pytest.approx(0.3)
    hold(queue, [70_000, 70_000 + 3 * LONGEST_SPAN_US], sent_us=200_000)
    assert queue.overdue_s(2_200_000) == pytest.approx(1.0)
