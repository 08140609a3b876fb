"""Samples held in single precision where that loses nothing, and read in double."""

from __future__ import annotations

import mmap
import resource
from pathlib import Path

import numpy as np
import pytest

from sagittal.core.frames import Floats
from sagittal.core.signals.held_samples import SHORT, HeldSeries, cut_blocks, give_pages_back, make_room
from sagittal.core.signals.recording import SensorSignals


def sensor(acc: Floats, mag: Floats | None = None) -> SensorSignals:
    there = np.ones(len(acc), np.bool_)
    return SensorSignals("a", acc, np.zeros_like(acc), mag, there, ~there)


def test_what_single_precision_holds_is_held_in_it_and_read_to_the_bit() -> None:
    values = np.random.default_rng(0).normal(size=(9000, 3)).astype(np.float32)
    one = sensor(values.astype(np.float64))
    assert one.held("acc").dtype == np.float32
    assert one.acc.dtype == np.float64
    assert np.array_equal(one.acc, values)
    assert np.array_equal(one.cut("acc", slice(5, 8)), values[5:8])


@pytest.mark.parametrize("row", [0, 8999])
@pytest.mark.parametrize("value", [0.1, 1e300])
def test_a_single_number_that_needs_more_keeps_all_in_double(row: int, value: float) -> None:
    values = np.zeros((9000, 3))
    values[row, 1] = value
    one = sensor(values)
    assert one.held("acc").dtype == np.float64
    assert np.array_equal(one.acc, values)


def test_missing_samples_are_the_same_in_both() -> None:
    mag = np.ones((10, 3))
    mag[4] = np.nan
    one = sensor(np.ones((10, 3)), mag)
    assert one.held("mag").dtype == np.float32
    assert one.mag is not None
    assert np.array_equal(one.mag, mag, equal_nan=True)


def test_a_changed_sensor_holds_the_same_samples_once() -> None:
    one = sensor(np.ones((10, 3)), np.ones((10, 3)))
    other = one.change(mag=None)
    assert other.held("acc") is one.held("acc")
    assert other.mag is None
    assert one.mag is not None


@pytest.mark.parametrize("samples", [0, 1, 1 << 14, (1 << 15) + 5])
def test_blocks_are_every_sample_once_and_in_order(samples: int) -> None:
    cut = [range(samples)[part] for part in cut_blocks(samples)]
    assert [k for part in cut for k in part] == list(range(samples))


def test_a_series_is_the_field_less_its_offset() -> None:
    values = np.random.default_rng(0).normal(size=(40, 3))
    off = np.array([0.1, 0.2, 0.3])
    assert np.array_equal(HeldSeries(sensor(values), "acc", off)[3:9], (values - off)[3:9])
    assert np.array_equal(HeldSeries(sensor(values), "acc")[:], values)


def test_what_a_long_take_gives_lies_in_a_file_and_is_not_in_memory_until_it_is_read() -> None:
    rows = 8 * SHORT
    assert not isinstance(make_room(SHORT, 4).base, mmap.mmap)
    room = make_room(rows, 4)
    assert isinstance(room.base, mmap.mmap)
    before = resident_kb()
    room[:] = np.arange(4.0 * rows).reshape(rows, 4)
    assert resident_kb() - before > 0.9 * room.nbytes / 1024
    give_pages_back((room, np.zeros(3)))
    assert resident_kb() - before < 0.1 * room.nbytes / 1024
    assert np.array_equal(room, np.arange(4.0 * rows).reshape(rows, 4))


def test_without_room_on_the_disk_it_is_in_memory() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 16, hard))
    try:
        room = make_room(2 * SHORT, kind=np.float32)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not isinstance(room.base, mmap.mmap)
    room[:] = 1.0
    give_pages_back((room,))
    assert room.sum() == 2 * SHORT


def resident_kb() -> int:
    """Pages of this process that are in memory and belong to a file, or to one in memory."""
    status = Path("/proc/self/status").read_text().splitlines()
    return sum(int(x.split()[1]) for x in status if x.startswith(("RssFile", "RssShmem")))
