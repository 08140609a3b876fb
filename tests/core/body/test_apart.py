"""What a tape measure between the ankles changes, and what it leaves alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.signals.recording import Recording, Subject
from sagittal.core.simulate import simulate_scenario
from sagittal.core.timeline import synchronise

HEIGHT = 1.75


def recording() -> Recording:
    return simulate_scenario("comfortable", 3, HEIGHT).recording


@cache
def analysed(standing_width_m: float | None) -> TakeAnalysis:
    return analyse(replace(recording(), subject=Subject(HEIGHT, standing_width_m)))


def apart_m(analysis: TakeAnalysis) -> Floats:
    """Distance of the ankles across the line from hip to hip, per sample."""
    assert analysis.poses is not None
    p = analysis.poses.p
    lateral = p["thigh_l"] - p["thigh_r"]
    lateral /= np.linalg.norm(lateral, axis=1, keepdims=True)
    return np.asarray(np.sum((p["foot_l"] - p["foot_r"]) * lateral, axis=1))


def standing(analysis: TakeAnalysis) -> slice:
    assert analysis.calibration is not None
    a, b = analysis.calibration.zero
    return slice(round(a * 100), round(b * 100))


@pytest.mark.sweep
@pytest.mark.parametrize("width", [0.1, 0.3])
def test_the_figure_stands_as_wide_as_measured(width: float) -> None:
    result = analysed(width)
    assert apart_m(result)[standing(result)].mean() == pytest.approx(width, abs=0.02)


@pytest.mark.slow
def test_steps_are_wider_by_what_standing_was_wider() -> None:
    def width(source: TakeAnalysis, side: Side) -> float:
        mean = next(p.mean for p in source.parameters if (p.name, p.side) == ("step_width_m", side))
        assert mean is not None
        return mean

    for side in SIDES:
        assert width(analysed(0.3), side) - width(analysed(0.1), side) == pytest.approx(0.2, abs=0.03)


@pytest.mark.slow
def test_it_changes_no_angle_beyond_its_zero() -> None:
    narrow, wide = analysed(0.1).angles, analysed(0.3).angles
    assert narrow is not None
    assert wide is not None
    for name, angle in narrow.angles.items():
        limit = 1.5 if "flexion" in name else 4.0
        assert np.degrees(np.nanstd(angle - wide.angles[name])) < limit, name


@pytest.mark.slow
def test_it_survives_the_uniform_axis() -> None:
    declared = replace(recording(), subject=Subject(HEIGHT, 0.25))
    assert synchronise(declared).subject.standing_width_m == 0.25
