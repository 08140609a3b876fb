"""Compiled loops against the same things said with slices."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import Bools, Floats
from sagittal.core.signals.kernel import find_lows, find_steadiest_rate, measure_norms, measure_windows


def lock(x: Floats) -> Floats:
    x.setflags(write=False)
    return x


def steadiest(gyr: Floats, valid: Bools, width: int) -> tuple[list[bool], Floats]:
    whole, mean = np.empty(len(gyr) - width + 1, np.bool_), np.empty(3)
    valid.setflags(write=False)
    find_steadiest_rate(lock(gyr), valid, width, whole, mean)
    return whole.tolist(), mean


@pytest.mark.parametrize("lost", [[], [0], [14, 37], [59]])
def test_the_steadiest_whole_window_gives_the_mean_rate(lost: list[int]) -> None:
    width, n = 7, 60
    gyr = np.random.default_rng(2).normal(0.2, 1.0, (n, 3))
    valid = np.ones(n, np.bool_)
    valid[lost] = False
    windows = [slice(k, k + width) for k in range(n - width + 1)]
    expected = [bool(valid[w].all()) for w in windows]
    spread = [gyr[w].var(axis=0).sum() if good else np.inf for w, good in zip(windows, expected, strict=True)]
    whole, mean = steadiest(gyr, valid, width)
    assert whole == expected
    assert mean == pytest.approx(gyr[windows[int(np.argmin(spread))]].mean(axis=0), abs=1e-12)


def test_without_a_whole_window_it_is_the_first_ones_and_one_window_may_be_all() -> None:
    gyr = np.arange(30.0).reshape(10, 3)
    none = np.zeros(10, np.bool_)
    whole, mean = steadiest(gyr.copy(), none, 4)
    assert not any(whole)
    assert mean == pytest.approx(gyr[:4].mean(axis=0))
    whole, mean = steadiest(gyr.copy(), ~none, 10)
    assert whole == [True]
    assert mean == pytest.approx(gyr.mean(axis=0))


def test_norms_are_of_what_is_left_of_an_offset() -> None:
    out = np.empty(2)
    measure_norms(lock(np.array([[3.0, 0.0, 4.0], [1.0, 2.0, 3.0]])), np.array([1.0, 2.0, 3.0]), out)
    assert out == pytest.approx([np.sqrt(4.0 + 4.0 + 1.0), 0.0])


@pytest.mark.parametrize("width", [1, 4, 5, 30])
def test_a_window_is_centred_and_its_ends_are_held(width: int) -> None:
    x = np.random.default_rng(4).normal(size=30)
    mean, sd = np.empty(30), np.empty(30)
    measure_windows(x, width, mean, sd)
    first, last = width // 2, 30 - width + width // 2
    for k in range(30):
        centre = min(max(k, first), last)
        window = x[centre - first : centre - first + width]
        assert mean[k] == pytest.approx(window.mean(), abs=1e-12)
        assert sd[k] == pytest.approx(window.std(), abs=1e-7)


def test_the_low_behind_a_top_reaches_to_the_next_higher_one() -> None:
    """Tops 1, 3, 2, 2, 5 from the end of a signal towards its start; between them the valleys."""
    level, valleys = np.array([1.0, 3.0, 2.0, 2.0, 5.0]), np.array([0.5, -1.0, 0.2, 1.0, 0.8])
    lows = np.empty(5)
    find_lows(0.9, level, valleys, np.empty((6, 2)), lows)
    # one of the same height is no higher one; behind the highest lies the end
    assert lows.tolist() == [0.5, -1.0, 0.2, 0.2, -1.0]
