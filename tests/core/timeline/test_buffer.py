"""Good samples on their way to a live axis: where each goes, and up to when the axis is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sagittal.core.timeline.buffer import SampleBuffer
from sagittal.core.timeline.params import TimelineParams

RATE = 100.0


def make(*widths: int) -> SampleBuffer:
    return SampleBuffer(list(widths), [RATE] * len(widths), RATE, TimelineParams())


def push(
    buffer: SampleBuffer,
    stream: int,
    ticks: NDArray[np.int64],
    *,
    sensors: int = 1,
    columns: tuple[int, ...] = (0,),
    lost: tuple[int, ...] = (),
    offset_us: int = 0,
) -> None:
    """Samples whose channels are their tick plus a hundred for every sensor; `lost` ones lack a channel."""
    samples = np.empty((len(ticks), sensors, 9), np.float32)
    samples[:] = ticks[:, None, None] + 100 * np.arange(sensors)[:, None]
    samples[:, :, 6:] = np.nan
    samples[np.isin(ticks, lost), :, 5] = np.nan
    buffer.append(stream, ticks * 10_000, offset_us, samples, np.array(columns))


def test_worn_sensors_are_numbered_through_the_streams() -> None:
    buffer = make(1, 2)
    push(buffer, 0, np.arange(5))
    push(buffer, 1, np.arange(5), sensors=3, columns=(2, 1))
    acc, gyr, valid, filled = buffer.lay(0, 5, 0.0)
    assert acc.shape == (5, 3, 3)
    assert acc[4, :, 0].tolist() == [4.0, 204.0, 104.0]
    assert np.array_equal(acc, gyr)
    assert valid.all()
    assert not filled.any()


def test_a_sample_without_one_of_six_channels_is_none_and_without_a_magnetometer_it_is() -> None:
    buffer = make(1)
    push(buffer, 0, np.arange(6), lost=(2,))
    acc, _, valid, filled = buffer.lay(0, 6, 0.0)
    assert valid.all()
    assert filled[:, 0].tolist() == [False, False, True, False, False, False]
    assert acc[2, 0, 0] == 2.0


def test_the_axis_is_known_up_to_the_last_good_sample_of_every_live_stream() -> None:
    buffer = make(1, 1)
    push(buffer, 0, np.arange(10))
    push(buffer, 1, np.arange(5), offset_us=20_000)
    joint_values = np.array([True, True])
    assert buffer.last_s.tolist() == [0.09, 0.06]
    assert buffer.until(joint_values) == 0.06
    assert buffer.until(np.array([True, False])) == 0.09
    assert buffer.until(np.array([False, False])) == np.inf


def test_a_hole_too_long_to_be_filled_is_waited_for_no_longer() -> None:
    """Eleven lost ones are waited for: the next may come right after them, a tenth of a second too late."""
    for lost, reference in ((11, 0.02), (12, 0.14)):
        buffer = make(1)
        push(buffer, 0, np.arange(3 + lost), lost=tuple(range(3, 3 + lost)))
        assert buffer.until(np.array([True])) == pytest.approx(reference)


def test_what_is_laid_in_parts_is_what_is_laid_at_once_and_rows_grow_as_needed() -> None:
    whole, parts = make(1), make(1)
    push(whole, 0, np.arange(300), lost=(40, 41, 150))
    for first in range(0, 300, 60):
        push(parts, 0, np.arange(first, first + 60), lost=(40, 41, 150))
    expected = whole.lay(0, 300, 0.0)
    result = [parts.lay(first, first + 100, 0.0) for first in (0, 100, 200)]
    for ours, theirs in zip(zip(*result, strict=True), expected, strict=True):
        assert np.array_equal(np.concatenate(ours), theirs)
