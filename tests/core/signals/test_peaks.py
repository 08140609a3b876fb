"""Peaks of a signal, held against SciPy's, whose package is not loaded for them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from sagittal.core.frames import Floats
from sagittal.core.signals.peaks import find_peaks


def walk(seed: int, decimals: int) -> Floats:
    """Steps up and down; rounded, so that plateaus and equal peaks are among them."""
    return np.asarray(np.random.default_rng(seed).normal(size=800).cumsum().round(decimals))


@pytest.mark.parametrize("decimals", [0, 1, 8])
@pytest.mark.parametrize(
    "asked",
    [
        {},
        {"height": 1.0},
        {"distance": 1.0},
        {"distance": 12.4},
        {"prominence": 2.0},
        {"height": -3.0, "distance": 7.0, "prominence": 1.0},
    ],
)
def test_peaks_are_those_of_scipy(asked: dict[str, float], decimals: int) -> None:
    for seed in range(20):
        x = walk(seed, decimals)
        assert np.array_equal(find_peaks(x, **asked), signal.find_peaks(x, **asked)[0])  # type: ignore[call-overload]


def test_a_plateau_is_one_peak_and_an_end_is_none() -> None:
    assert find_peaks(np.array([0.0, 2.0, 2.0, 2.0, 1.0])).tolist() == [2]
    assert not len(find_peaks(np.array([3.0, 1.0, 0.0, 5.0])))
    assert not len(find_peaks(np.zeros(0)))


def test_of_two_that_are_near_the_higher_stays() -> None:
    x = np.array([0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    assert find_peaks(x, distance=3.0).tolist() == [3, 7]
    assert find_peaks(x, prominence=2.0).tolist() == [3]
