"""Peaks of a signal are those of scipy.signal, whose import they save."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.signal

from core.peaks import find_peaks


@pytest.mark.parametrize(
    "rules",
    [
        {},
        {"height": 0.5},
        {"distance": 1.0},
        {"distance": 7.3},
        {"prominence": 0.8},
        {"height": 0.2, "distance": 12.0, "prominence": 0.5},
    ],
    ids=str,
)
@pytest.mark.parametrize("step", [0.0, 0.5], ids=["smooth", "with ties"])
def test_peaks_are_those_of_scipy(rules: dict[str, float], step: float) -> None:
    """Rounded to steps a signal has flat tops, equal heights, and peaks at its ends."""
    theirs: Any = scipy.signal.find_peaks
    made = np.random.default_rng(2)
    for n in (0, 1, 2, 3, 50, 2000):
        x = np.convolve(made.normal(size=n + 4), np.ones(5) / 2.0, "valid") if n else np.zeros(0)
        x = np.round(x / step) * step if step else x
        assert find_peaks(x, **rules).tolist() == theirs(x, **rules)[0].tolist()
