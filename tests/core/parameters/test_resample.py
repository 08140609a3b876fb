"""Cutting signals at strides: as one interpolation after the other, and where a piece passes zero."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.parameters.resample import first_crossing, last_crossing, resample

T = np.arange(500) / 100.0
SIGNALS = np.stack((np.sin(3.0 * T), T**2))

PLACES = st.lists(st.tuples(st.floats(0.0, 4.0), st.floats(0.05, 0.99)), min_size=1, max_size=6)


@pytest.mark.slow
@settings(deadline=None)
@given(PLACES, st.integers(2, 130))
def test_pieces_are_interpolated_linearly(places: list[tuple[float, float]], points: int) -> None:
    bounds = np.array([(a, a + length) for a, length in places])
    found = np.stack(resample(SIGNALS, T, bounds, points))
    assert found.shape == (2, len(places), points)
    for i, (a, b) in enumerate(bounds):
        for k, signal in enumerate(SIGNALS):
            assert found[k, i] == pytest.approx(np.interp(np.linspace(a, b, points), T, signal), abs=1e-9)


def test_a_piece_that_touches_a_gap_is_nowhere_known() -> None:
    torn = SIGNALS.copy()
    torn[0, 250] = np.nan
    found = np.stack(resample(torn, T, np.array([(1.0, 2.0), (2.0, 3.0)])))
    assert np.isfinite(found[0, 0]).all()
    assert np.isnan(found[0, 1]).all()
    assert np.isfinite(found[1]).all()


def test_a_piece_without_an_end_is_not_known_and_the_others_are() -> None:
    found = np.stack(resample(SIGNALS, T, np.array([(1.0, np.nan), (2.0, 3.0)])))
    assert np.isnan(found[:, 0]).all()
    assert np.isfinite(found[:, 1]).all()


def test_crossings_are_told_first_and_last_and_upwards_only() -> None:
    x = np.linspace(0.0, 1.0, 101)
    twice = np.sin(2 * np.pi * (2.0 * x - 0.25))
    never = np.full(101, 1.0)
    down = 0.5 - x
    pieces = np.stack((twice, never, down, x - 0.333))
    assert first_crossing(pieces) == pytest.approx([0.125, np.nan, np.nan, 0.333], nan_ok=True)
    assert last_crossing(pieces) == pytest.approx([0.625, np.nan, np.nan, 0.333], nan_ok=True)


def test_many_pieces_are_those_of_few() -> None:
    t = np.arange(5000) / 100.0
    signal = np.sin(t) + np.where(t > 40.0, np.nan, 0.0)
    start = np.linspace(0.0, 45.0, 700)
    bounds = np.stack((start, start + 1.1), axis=1)
    (whole,) = resample([signal], t, bounds)
    parts = [resample([signal], t, bounds[i : i + 100])[0] for i in range(0, 700, 100)]
    np.testing.assert_array_equal(whole, np.concatenate(parts))
