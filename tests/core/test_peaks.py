"""Peaks by height, distance and prominence: the same as SciPy's, on signals with ties and level tops too."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from core.peaks import find_peaks


def test_a_level_top_is_told_in_its_middle_and_no_end_is_one() -> None:
    assert find_peaks(np.array([3.0, 1.0, 2.0, 2.0, 2.0, 0.0, 5.0])).tolist() == [3]
    assert find_peaks(np.array([1.0, 2.0, 3.0])).tolist() == []
    assert find_peaks(np.array([])).tolist() == []


def test_prominence_is_above_the_higher_of_the_valleys_beside() -> None:
    x = np.array([0.0, 4.0, 1.0, 3.0, 2.0, 5.0, 0.0])
    assert find_peaks(x, prominence=1.0).tolist() == [1, 3, 5]
    assert find_peaks(x, prominence=1.1).tolist() == [1, 5]
    assert find_peaks(x, prominence=3.1).tolist() == [5]


@pytest.mark.parametrize("whole", [True, False])
def test_peaks_are_those_of_scipy(whole: bool) -> None:
    from scipy.signal import find_peaks as ask_scipy

    rng = np.random.default_rng(int(whole))
    for _ in range(300):
        x = rng.integers(-4, 5, size=40).astype(float) if whole else rng.normal(size=40)
        wanted = {
            "height": rng.normal(),
            "distance": 1.0 + 8.0 * rng.random(),
            "prominence": 3.0 * rng.random(),
        }
        chosen: dict[str, Any] = {name: value for name, value in wanted.items() if rng.random() < 0.5}
        assert np.array_equal(find_peaks(x, **chosen), ask_scipy(x, **chosen)[0]), chosen
