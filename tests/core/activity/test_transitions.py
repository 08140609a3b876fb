"""Transitions: how far and which way a chest went, from its upward acceleration."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.activity.transitions import measure_rise, tell_direction
from sagittal.core.frames import GRAVITY


def pulse(height_m: float, seconds: float = 2.0) -> np.ndarray:
    """Upward acceleration in frames of going up by so much without a jerk at the ends."""
    u = (np.arange(int(seconds * 10)) + 0.5) / (seconds * 10)
    return np.asarray(height_m * 2.0 * np.pi / seconds**2 * np.sin(2.0 * np.pi * u))


@pytest.mark.parametrize("height", [0.4, -0.35])
def test_the_rise_is_the_height_gone_up_whatever_the_bias(height: float) -> None:
    assert measure_rise(GRAVITY + 0.2 + pulse(height)) == pytest.approx(height, rel=0.02)


def test_rising_pushes_first_and_sitting_down_falls_first() -> None:
    assert tell_direction(GRAVITY + pulse(0.4)) > 0.0
    assert tell_direction(GRAVITY + pulse(-0.4)) < 0.0
