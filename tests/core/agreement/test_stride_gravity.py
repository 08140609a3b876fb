"""Witnesses of every stride: gravity of a still sensor is where it is, and turns as the sensor does."""

from __future__ import annotations

import numpy as np

from sagittal.core.agreement.stride_gravity import cut_strides, find_typical, measure_stride_gravity
from sagittal.core.rotation import exp, find_lengths, rotate
from sagittal.core.signals.recording import SensorSignals
from tests.helpers.walks import only, simulated

RATE = 100.0


def swing(turn_deg: float, axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> SensorSignals:
    """A sensor that swings by 0.5 rad at 1 Hz about y, mounted with a turn about an axis."""
    t = np.arange(2000) / RATE
    angle = 0.5 * np.sin(2 * np.pi * t)
    q = exp(np.radians(turn_deg) * np.array(axis))
    acc = np.stack((-np.sin(angle), np.zeros(2000), np.cos(angle)), axis=1) * 9.81
    gyr = np.stack((np.zeros(2000), np.gradient(angle, t), np.zeros(2000)), axis=1)
    there = np.ones(2000, np.bool_)
    return SensorSignals("x", rotate(q, acc), rotate(q, gyr), None, there, ~there)


BORDERS = np.arange(150, 1900, 100)


def test_gravity_and_axis_of_each_stride_turn_with_the_sensor() -> None:
    plain = measure_stride_gravity("shank_l", swing(0.0), BORDERS, RATE)
    tilted = measure_stride_gravity("shank_l", swing(20.0), BORDERS, RATE)
    assert len(plain.at_s) == len(BORDERS) - 1
    for a, b in ((plain.moment, tilted.moment), (plain.whole, tilted.whole)):
        assert np.allclose(find_lengths(a), 1.0)
        expected = rotate(exp(np.radians(20.0) * np.array([1.0, 0.0, 0.0])), find_typical(a))
        assert np.allclose(find_typical(b), expected, atol=0.02)
    assert np.abs(plain.heading).max() < 0.02


def test_strides_with_lost_samples_are_left_out() -> None:
    signals = swing(0.0)
    valid = signals.valid.copy()
    valid[520:530] = False
    left = measure_stride_gravity("foot_l", signals.change(valid=valid), BORDERS, RATE)
    assert len(left.at_s) == len(BORDERS) - 2
    assert len(measure_stride_gravity("foot_l", signals, BORDERS[:1], RATE).at_s) == 0


def test_a_pelvis_is_cut_by_the_right_leg() -> None:
    feet = only(simulated("comfortable", 1)[0], "pelvis", "foot_l", "foot_r")
    borders = cut_strides(feet)
    assert set(borders) == {"pelvis", "foot_l", "foot_r"}
    assert np.array_equal(borders["pelvis"], borders["foot_r"])
