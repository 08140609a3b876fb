"""Gains by the level of motion."""

from __future__ import annotations

from itertools import pairwise
from math import inf

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.gain_kernel import choose_level
from sagittal.core.fusion.algorithms.gains import (
    Corners,
    FixedGain,
    FuzzyGain,
    Gain,
    ThreeLevelGain,
    TwoLevelGain,
    order_corners,
)
from sagittal.core.fusion.algorithms.presets import MADGWICK_ON_A_LEG

INPUT: Corners = (0.02, 0.08, 0.04, 0.1, 0.15, 0.25, 0.2, 0.4)
OUTPUT: Corners = (0.005, 0.02, 0.01, 0.03, 0.04, 0.07, 0.05, 0.09)


def choose(row: Floats, acc: float, mag: float, gyr: float) -> float:
    return float(choose_level.py_func(row[None], 0, acc, mag, gyr))


@pytest.mark.parametrize(
    ("gain", "acc", "mag", "gyr", "expected"),
    [
        (FixedGain(2.0), 9.0, 9.0, 9.0, 2.0),
        (TwoLevelGain(1.0, 3.0, acc=0.1), 0.05, 9.0, 9.0, 1.0),
        (TwoLevelGain(1.0, 3.0, acc=0.1), 0.1, 0.0, 0.0, 3.0),
        (TwoLevelGain(1.0, 3.0, acc=0.1, mag=0.2), 0.05, 0.3, 0.0, 3.0),
        (TwoLevelGain(1.0, 3.0, gyr=0.5), 9.0, 9.0, 0.4, 1.0),
        (ThreeLevelGain(1.0, 2.0, 3.0, acc=(0.1, 0.2)), 0.05, 0.0, 0.0, 1.0),
        (ThreeLevelGain(1.0, 2.0, 3.0, acc=(0.1, 0.2)), 0.15, 0.0, 0.0, 2.0),
        (ThreeLevelGain(1.0, 2.0, 3.0, acc=(0.1, 0.2)), 0.2, 0.0, 0.0, 3.0),
        (ThreeLevelGain(1.0, 2.0, 3.0, acc=(0.1, 0.2), mag=(0.1, 0.3)), 0.05, 0.2, 0.0, 2.0),
    ],
)
def test_the_level_is_the_first_whose_every_named_threshold_holds(
    gain: Gain, acc: float, mag: float, gyr: float, expected: float
) -> None:
    assert choose(gain.row(), acc, mag, gyr) == expected


@pytest.mark.parametrize("bad", [-1.0, float("nan")])
def test_a_negative_gain_is_refused(bad: float) -> None:
    with pytest.raises(ParameterError):
        FixedGain(bad)
    with pytest.raises(ParameterError):
        TwoLevelGain(1.0, bad)
    with pytest.raises(ParameterError):
        ThreeLevelGain(1.0, 1.0, 1.0, acc=(0.2, 0.1))


def test_an_unnamed_sensor_is_not_asked() -> None:
    assert TwoLevelGain(1.0, 2.0).row()[3:6].tolist() == [inf, inf, inf]


@pytest.mark.slow
def test_a_fuzzy_gain_falls_without_a_hole_as_either_sensor_deviates() -> None:
    """The thesis' own rules say nothing where one deviation is low and the other middle."""
    row = FuzzyGain(OUTPUT, acc=INPUT, mag=INPUT).row()
    quiet, mixed, mixed_too, middle, high = (
        choose(row, *x, 0.0) for x in ((0.0, 0.0), (0.0, 0.12), (0.12, 0.0), (0.12, 0.12), (0.5, 0.0))
    )
    assert quiet > mixed == mixed_too == middle > high > 0.0
    values = [choose(row, 0.002 * k, 0.0, 0.0) for k in range(250)]
    # the centroid of a truncated set moves a little while its height changes
    assert all(a >= b - 1e-4 for a, b in pairwise(values))


def test_a_fuzzy_noise_rises() -> None:
    row = FuzzyGain(OUTPUT, gyr=INPUT, rising=True).row()
    values = [choose(row, 9.0, 9.0, x) for x in (0.0, 0.12, 0.5)]
    assert values[0] < values[1] < values[2]


def test_a_fuzzy_gain_is_the_centroid_of_its_truncated_sets() -> None:
    x = np.linspace(0.0, OUTPUT[7], 201)
    share = np.clip((x - OUTPUT[6]) / (OUTPUT[7] - OUTPUT[6]), 0.0, 1.0)
    rising = np.where(share < 0.5, 2.0 * share**2, 1.0 - 2.0 * (1.0 - share) ** 2)
    result = choose(FuzzyGain(OUTPUT, acc=INPUT).row(), 0.0, 0.0, 0.0)
    assert result == pytest.approx((rising * x).sum() / rising.sum(), rel=1e-12)


def test_corners_are_moved_until_neighbours_meet() -> None:
    assert order_corners((0.3, 0.1, 0.4, 0.2, 0.1, 0.1, 0.6, 0.5)) == (0.3, 0.4, 0.4, 0.4, 0.4, 0.6, 0.6, 0.6)
    assert order_corners(INPUT) == INPUT
    touching = FuzzyGain(OUTPUT, acc=(0.1, 0.1, 0.1, 0.1, 0.2, 0.2, 0.2, 0.2)).row()
    assert all(choose(touching, x, 0.0, 0.0) > 0.0 for x in (0.1, 0.2))


def test_a_fuzzy_gain_follows_some_sensor() -> None:
    with pytest.raises(ParameterError):
        FuzzyGain(OUTPUT)


def test_the_presets_of_a_leg_switch_as_printed() -> None:
    assert len(MADGWICK_ON_A_LEG) == 9
    foot = MADGWICK_ON_A_LEG["three_levels", "foot"].beta.row()
    assert [choose(foot, x, 0.0, 0.0) for x in (0.05, 0.15, 0.3)] == [0.05, 0.006, 1e-18]
