"""Spread of a parameter: what is said, and what is left unsaid when there is too little behind it."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.events.result import Stride, Strides
from sagittal.core.parameters import summarise_times
from sagittal.core.parameters.variability import cv_pct, mean_and_sd, summarise_values, t_quantile


def test_the_interval_of_the_mean_is_students() -> None:
    # quantiles of any printed table
    assert t_quantile(1) == pytest.approx(12.706, abs=5e-4)
    assert t_quantile(9) == pytest.approx(2.262, abs=5e-4)
    assert t_quantile(1000) == pytest.approx(1.962, abs=5e-4)
    found = summarise_values("stride_time_s", "left", [1.0, 1.1, 1.2, 1.3], "s")
    assert (found.ci_low, found.ci_high) == pytest.approx((0.9446, 1.3554), abs=1e-4)


@pytest.mark.parametrize("n", [2, 7, 8, 9, 128, 129, 1111])
def test_mean_and_deviation_are_numpys_to_the_bit(n: int) -> None:
    x = np.random.default_rng(n).normal(1.1, 0.05, n)
    assert mean_and_sd(x) == (x.mean(), x.std(ddof=1))


def test_the_interval_covers_the_true_mean_as_often_as_it_says() -> None:
    rng = np.random.default_rng(4)
    hits = 0
    for values in rng.normal(1.1, 0.05, (2000, 12)):
        found = summarise_values("stride_time_s", "left", values.tolist(), "s")
        assert found.ci_low is not None
        assert found.ci_high is not None
        hits += found.ci_low <= 1.1 <= found.ci_high
    assert hits / 2000 == pytest.approx(0.95, abs=0.015)


def test_one_stride_has_a_value_and_nothing_else() -> None:
    found = summarise_values("stride_time_s", "left", [1.1], "s")
    assert (found.mean, found.sd, found.cv_pct, found.ci_low, found.ci_high) == (1.1, None, None, None, None)
    assert found.note == "few_strides"


@pytest.mark.parametrize(("n", "cv", "note"), [(9, False, True), (10, True, True), (30, True, False)])
def test_variation_needs_ten_strides_and_is_marked_below_thirty(n: int, cv: bool, note: bool) -> None:
    found = summarise_values("stride_time_s", "left", [1.0 + 0.01 * (-1) ** i for i in range(n)], "s")
    assert (found.cv_pct is not None) == cv
    assert (found.note == "few_strides") == note


def test_variation_of_one_value_is_not_perfect_steadiness() -> None:
    """A CV of 0 for a lone stride reads as "perfect"."""
    assert cv_pct([1.1], "s") is None
    assert cv_pct([], "s") is None
    assert cv_pct([1.1] * 10, "s") == pytest.approx(0.0, abs=1e-9)


def test_what_passes_through_zero_has_no_variation_in_percent() -> None:
    assert cv_pct([5.0] * 9 + [6.0], "deg") is None
    assert cv_pct([0.1] * 9 + [-0.01], "m") is None
    assert cv_pct([0.1] * 9 + [0.0], "m") is None


def test_cadence_carries_the_spread_of_its_steps() -> None:
    made = [
        Stride("right", k * 1.1, k * 1.1 + 0.7, (k + 1) * 1.1, k * 1.1 + 0.1, k * 1.1 + 0.5 + 0.01 * (k % 2))
        for k in range(12)
    ]
    (cadence,) = (p for p in summarise_times(Strides(tuple(made))) if p.name == "cadence_spm")
    steps = np.array([0.6 - 0.01 * (k % 2) for k in range(12)])
    assert cadence.cv_pct == pytest.approx(100 * steps.std(ddof=1) / steps.mean())
    assert cadence.mean is not None
    assert cadence.ci_low is not None
    assert cadence.ci_high is not None
    half = t_quantile(11) * steps.std(ddof=1) / np.sqrt(12)
    assert cadence.ci_low == pytest.approx(60.0 / (steps.mean() + half))
    assert cadence.ci_low < cadence.mean < cadence.ci_high
