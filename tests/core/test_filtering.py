"""The low-pass of whole signals: what it lets through, that it moves nothing, and that SciPy has the same."""

from __future__ import annotations

import numpy as np
import pytest

from core.filtering import design_butterworth, design_elliptic, filter_both_ways, low_pass

RATE = 100.0


@pytest.mark.parametrize(("hz", "share"), [(0.2, 1.0), (3.0, 0.5), (20.0, 0.0)])
def test_slow_passes_in_place_and_fast_does_not(hz: float, share: float) -> None:
    """Twice second order: half the amplitude at the cutoff, no delay."""
    t = np.arange(0.0, 20.0, 1.0 / RATE)
    wave = np.sin(2.0 * np.pi * hz * t)
    middle = slice(500, 1500)
    np.testing.assert_allclose(low_pass(wave, 3.0, RATE)[middle], share * wave[middle], atol=0.01)


def test_every_row_is_filtered_alone_and_a_short_signal_too() -> None:
    rows = np.random.default_rng(0).normal(size=(2, 60))
    both = low_pass(rows, 4.0, RATE, pad=30)
    assert np.array_equal(both[1], low_pass(rows[1], 4.0, RATE, pad=30))
    assert np.isfinite(low_pass(rows[0, :5], 4.0, RATE)).all()
    np.testing.assert_allclose(low_pass(np.full(40, 2.0), 500.0, RATE), 2.0)


@pytest.mark.parametrize("rate", [25.0, 50.0, 128.0])
def test_sections_are_those_of_scipy(rate: float) -> None:
    from scipy import signal

    for hz in (0.1, 3.5, 500.0):
        same = signal.butter(2, min(0.99, 2.0 * hz / rate), output="sos")[0]
        np.testing.assert_allclose(design_butterworth(hz, rate), same, rtol=0.0, atol=1e-13)
    for ripple, stop, hz in ((0.01, 100.0, 0.25), (1.0, 40.0, 3.0), (0.5, 20.0, 5.0)):
        same = signal.ellip(2, ripple, stop, 2.0 * hz / rate, output="sos")[0]
        np.testing.assert_allclose(design_elliptic(ripple, stop, hz, rate), same, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("pad", [0, 7, 200])
def test_both_ways_are_those_of_scipy(pad: int) -> None:
    from scipy import signal

    rows = np.random.default_rng(1).normal(size=(2, 400)).cumsum(axis=1)
    section = design_butterworth(3.0, RATE)
    same = signal.sosfiltfilt(section[None], rows, padlen=pad)
    np.testing.assert_allclose(filter_both_ways(section, rows, pad), same, rtol=0.0, atol=1e-9)
