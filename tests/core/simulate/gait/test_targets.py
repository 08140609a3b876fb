"""Target angles of one leg: healthy ones untouched, and each difference where it is meant."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sagittal.core.frames import Floats
from sagittal.core.simulate.gait.curves import ANKLE_DORSIFLEXION, HIP_ADDUCTION, HIP_FLEXION, KNEE_FLEXION
from sagittal.core.simulate.gait.targets import (
    DEGREE,
    ankle_dorsiflexion,
    hip_adduction,
    hip_flexion,
    knee_flexion,
)
from sagittal.core.simulate.walker import SideGait

PHASE = np.arange(100) / 100.0


@pytest.mark.parametrize(
    ("target", "curve"),
    [
        (knee_flexion, KNEE_FLEXION),
        (hip_flexion, HIP_FLEXION),
        (hip_adduction, HIP_ADDUCTION),
        (ankle_dorsiflexion, ANKLE_DORSIFLEXION),
    ],
)
def test_a_healthy_leg_has_the_healthy_curves(
    target: Callable[[SideGait, Floats], Floats], curve: Callable[[Floats], Floats]
) -> None:
    assert np.array_equal(target(SideGait(), PHASE), curve(PHASE))


def added(target: Callable[[SideGait, Floats], Floats], gait: SideGait) -> Floats:
    """Difference of a gait from the healthy target (100,), degrees."""
    return np.asarray((target(gait, PHASE) - target(SideGait(), PHASE)) / DEGREE)


def test_a_stiff_knee_reaches_its_peak_in_swing_and_stance_is_untouched() -> None:
    gait = SideGait(knee_swing_rad=30.0 * DEGREE)
    less = added(knee_flexion, gait)
    assert np.argmin(less) == 70
    healthy = float(KNEE_FLEXION(np.array([0.72]))[0]) / DEGREE
    assert less[70] == pytest.approx(30.0 - healthy)
    assert less[6:34] == pytest.approx(0.0, abs=1e-12)


def test_a_bent_knee_is_bent_but_for_the_peak_in_swing() -> None:
    more = added(knee_flexion, SideGait(knee_stance_rad=10.0 * DEGREE))
    assert more[6:34] == pytest.approx(10.0)
    assert more[70] == pytest.approx(0.0, abs=1e-12)


def test_the_wave_of_loading_is_twelve_degrees_of_the_knee() -> None:
    less = added(knee_flexion, SideGait(knee_wave=0.0))
    assert np.argmin(less) == 13
    assert less[13] == pytest.approx(-12.0)
    assert less[28:98] == pytest.approx(0.0, abs=1e-12)


def test_a_smaller_hip_range_shrinks_about_twelve_degrees() -> None:
    half = np.degrees(hip_flexion(SideGait(hip_factor=0.5), PHASE))
    assert half - 12.0 == pytest.approx(0.5 * (np.degrees(HIP_FLEXION(PHASE)) - 12.0))
    more = added(hip_flexion, SideGait(hip_swing_rad=8.0 * DEGREE))
    assert np.argmax(more) == 82
    assert more.max() == pytest.approx(8.0)


def test_a_leg_that_swings_round_is_abducted_in_swing_alone() -> None:
    less = added(hip_adduction, SideGait(circumduction_rad=9.0 * DEGREE))
    assert np.argmin(less) == 80
    assert less.min() == pytest.approx(-9.0)
    assert less[4:56] == pytest.approx(0.0, abs=1e-12)


def test_an_ankle_that_hangs_is_smaller_and_lower_in_swing() -> None:
    result = ankle_dorsiflexion(SideGait(ankle_factor=0.4, ankle_swing_rad=-6.0 * DEGREE), PHASE)
    assert result[20:50] == pytest.approx(0.4 * ANKLE_DORSIFLEXION(PHASE)[20:50], abs=1e-12)
    assert result[85] == pytest.approx(0.4 * ANKLE_DORSIFLEXION(PHASE)[85] - 6.0 * DEGREE)
