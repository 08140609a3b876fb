"""Samples held in single precision where that loses nothing, and read in double."""

from __future__ import annotations

import numpy as np
import pytest

from core.frames import Floats
from core.recording import SensorSignals


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
