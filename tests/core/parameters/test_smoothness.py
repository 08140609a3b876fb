"""Spectral arc length: movements whose smoothness is known, and what it must not depend on."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import Floats
from sagittal.core.parameters.smoothness import spectral_arc_length, stride_smoothness

STEP = np.array([0.01])


def reach(duration_s: float = 1.0, peak: float = 1.0) -> Floats:
    """Speed of a movement of least jerk, the smoothest there is, sampled every 10 ms."""
    u = np.arange(0.0, duration_s, 0.01) / duration_s
    return np.asarray(peak * 16.0 * u**2 * (1.0 - u) ** 2)


def sparc(signal: Floats, step_s: float = 0.01) -> float:
    return float(spectral_arc_length(signal[None], np.array([step_s]))[0])


def by_hand(signal: Floats, step_s: float) -> float:
    """The integral as the paper writes it, frequency by frequency."""
    n = 64 * len(signal)
    t = np.arange(len(signal)) * step_s
    frequencies = np.fft.rfftfreq(n, step_s)
    amplitude = np.array(
        [abs(np.sum(signal * np.exp(-2j * np.pi * f * t))) for f in frequencies if f <= 10.0]
    )
    shape = amplitude / amplitude[0]
    last = int(np.flatnonzero(shape > 0.05)[-1])
    length = 0.0
    for k in range(last):
        length += float(np.sqrt((1.0 / last) ** 2 + (shape[k + 1] - shape[k]) ** 2))
    return -length


def test_the_smoothest_reach_has_the_value_of_the_literature() -> None:
    """Least jerk: about −1.41 (healthy reaching is reported between −1.4 and −1.6)."""
    assert sparc(reach()) == pytest.approx(-1.41, abs=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_integral_of_the_paper(seed: int) -> None:
    signal = np.abs(np.random.default_rng(seed).normal(1.0, 0.5, 100)) * reach()
    assert sparc(signal) == pytest.approx(by_hand(signal, 0.01), rel=0.02)


def test_neither_size_nor_duration_matter() -> None:
    assert sparc(reach(peak=7.0)) == pytest.approx(sparc(reach()))
    assert sparc(reach(2.0)) == pytest.approx(sparc(reach()), abs=0.02)
    assert sparc(reach(), 0.02) == pytest.approx(sparc(reach()), abs=0.02)


def test_more_sub_movements_are_less_smooth() -> None:
    one, two, three = (np.concatenate([reach(1.0)] * k) for k in (1, 2, 3))
    assert sparc(one) > sparc(two) > sparc(three)


def test_nothing_moved_is_not_smooth() -> None:
    assert np.isnan(sparc(np.zeros(100)))
    lost = reach()
    lost[3] = np.nan
    assert np.isnan(sparc(lost))


def test_strides_of_a_pelvis() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    strides = [(k, k + 1.0) for k in range(1, 8)]
    up = np.stack((0 * t, 0 * t, 2.0 * np.sin(4.0 * np.pi * t)), axis=1)
    rough = up + np.stack((0 * t, 0 * t, np.sin(16.0 * np.pi * t)), axis=1)
    smooth, shaken = (stride_smoothness(strides, t, {"pelvis": a}) for a in (up, rough))
    assert (smooth.name, smooth.n, smooth.unit, smooth.cv_pct) == ("stride_sparc", 7, "", None)
    assert smooth.mean is not None
    assert shaken.mean is not None
    assert shaken.mean < smooth.mean < -1.0
    assert smooth.sd == pytest.approx(0.0, abs=1e-6)
    assert stride_smoothness(strides, t, {}).reason == "no_pelvis_sensor"
    assert stride_smoothness([], t, {"pelvis": up}).reason == "no_strides"
    assert stride_smoothness(strides, t, {"pelvis": np.full((len(t), 3), np.nan)}).reason == "no_forward"
    torn = up.copy()
    torn[::50] = np.nan
    assert stride_smoothness(strides, t, {"pelvis": torn}).reason == "gap"


def test_many_strides_are_measured_as_few() -> None:
    pieces = np.abs(np.random.default_rng(2).normal(size=(600, 128))).cumsum(axis=1)
    step = np.full(600, 0.01)
    parts = [spectral_arc_length(pieces[i : i + 50], step[i : i + 50]) for i in range(0, 600, 50)]
    np.testing.assert_array_equal(spectral_arc_length(pieces, step), np.concatenate(parts))
