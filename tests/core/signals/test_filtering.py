"""Low-passes of whole signals: what they let through, and that they move nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, sosfiltfilt

from sagittal.core.signals.filtering import LEAST_PIECE, low_pass, smooth_gaussian

RATE = 100.0


@pytest.mark.parametrize(("hz", "share"), [(0.2, 1.0), (3.0, 0.5), (20.0, 0.0)])
def test_slow_passes_in_place_and_fast_does_not(hz: float, share: float) -> None:
    """Twice second order: half the amplitude at the cutoff, no delay."""
    t = np.arange(0.0, 20.0, 1.0 / RATE)
    wave = np.sin(2.0 * np.pi * hz * t)
    middle = slice(500, 1500)
    np.testing.assert_allclose(low_pass(wave, 3.0, RATE)[middle], share * wave[middle], atol=0.01)


@pytest.mark.parametrize("shape", [(3, 700), (2, 3, 40), (60,), (1,)])
@pytest.mark.parametrize("pad", [None, 0, 5])
def test_it_has_the_bits_of_scipy(shape: tuple[int, ...], pad: int | None) -> None:
    rows = np.random.default_rng(1).normal(size=shape)
    reach = min(shape[-1] - 1, 200 if pad is None else pad)
    for cutoff_hz in (0.5, 15.0):
        expected = sosfiltfilt(butter(2, cutoff_hz / 50.0, output="sos"), rows, padlen=reach)
        np.testing.assert_array_equal(low_pass(rows, cutoff_hz, RATE, pad), expected)


def test_every_row_is_filtered_alone_and_a_short_signal_too() -> None:
    rows = np.random.default_rng(0).normal(size=(2, 60))
    both = low_pass(rows, 4.0, RATE, pad=30)
    assert np.array_equal(both[1], low_pass(rows[1], 4.0, RATE, pad=30))
    assert np.isfinite(low_pass(rows[0, :5], 4.0, RATE)).all()
    np.testing.assert_allclose(low_pass(np.full(40, 2.0), 500.0, RATE), 2.0)


@pytest.mark.parametrize("rate_hz", [60.0, 100.0, 148.148])
@pytest.mark.parametrize("cutoff_hz", [0.05, 0.8, 4.0, 15.0, 200.0])
def test_it_is_the_filter_of_scipy(cutoff_hz: float, rate_hz: float) -> None:
    """Whose package is not loaded for it."""
    rows = np.random.default_rng(1).normal(size=(3, 2, 700)).cumsum(axis=-1)
    section = butter(2, min(0.99, cutoff_hz / (0.5 * rate_hz)), output="sos")
    for pad in (0, 30, round(2.0 * rate_hz)):
        expected = sosfiltfilt(section, rows, padlen=pad)
        np.testing.assert_allclose(low_pass(rows, cutoff_hz, rate_hz, pad), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("sd", [0.4, 3.0, 60.0, 200.0])
@pytest.mark.parametrize("n", [1, 50, LEAST_PIECE, 20_011])
def test_a_gaussian_is_that_of_scipy(sd: float, n: int) -> None:
    x = 9.81 + np.random.default_rng(1).normal(size=n)
    np.testing.assert_allclose(smooth_gaussian(x, sd), gaussian_filter1d(x, sd, mode="nearest"), rtol=1e-14)


def test_what_is_no_number_spoils_a_piece_of_a_gaussian_alone() -> None:
    x = np.zeros(4 * LEAST_PIECE)
    x[0] = np.nan
    assert np.isfinite(smooth_gaussian(x, 3.0)[LEAST_PIECE:]).all()
