"""Two feet on their own: a late one is told by the double supports, people who limp are not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sagittal.core.events.alternation import AlternationParams, measure_foot_lag, tell_foot_lag
from sagittal.core.events.result import GaitEvent, GaitEvents
from sagittal.core.frames import Side
from sagittal.core.pipeline import TakeAnalysis, analyse, resume
from sagittal.core.simulate import simulate_scenario
from tests.helpers.perturbations import delay_sensor

PARAMS = AlternationParams()


def walk(right_late_s: float = 0.0, right_swing_s: float = 0.4, steps: int = 8) -> GaitEvents:
    """Strides of 1.1 s; the left foot swings for 0.4 s, the right one as given, double supports alike."""
    found: list[GaitEvent] = []
    support = (1.1 - 0.4 - right_swing_s) / 2

    def add(side: Side, kind: str, at: float) -> None:
        found.append(GaitEvent(at, side, kind, "made", at))  # type: ignore[arg-type]

    for k in range(steps):
        t = 1.1 * k
        add("left", "ic", t)
        add("right", "tc", t + support + right_late_s)
        add("right", "ic", t + support + right_swing_s + right_late_s)
        add("left", "tc", t + 2 * support + right_swing_s)
    return GaitEvents(tuple(sorted(found, key=lambda e: e.time_s)))


@pytest.mark.parametrize("late_s", [-0.1, -0.04, 0.0, 0.04, 0.1])
def test_the_lag_of_a_foot_is_half_the_difference_of_the_double_supports(late_s: float) -> None:
    assert measure_foot_lag(walk(late_s), PARAMS) == pytest.approx(late_s, abs=1e-9)


def test_a_limp_that_swings_unequally_is_no_lag() -> None:
    assert measure_foot_lag(walk(right_swing_s=0.55), PARAMS) == pytest.approx(0.0, abs=1e-9)


def test_a_late_foot_is_told_by_its_side() -> None:
    assert [n.sensor for n in tell_foot_lag(walk(0.1), PARAMS)] == ["foot_r"]
    assert [n.sensor for n in tell_foot_lag(walk(-0.1), PARAMS)] == ["foot_l"]
    (note,) = tell_foot_lag(walk(0.04), PARAMS)
    assert (note.sensor, note.severity) == ("foot_r", "info")
    assert tell_foot_lag(walk(0.02), PARAMS) == ()


def test_few_steps_and_one_foot_say_nothing() -> None:
    assert measure_foot_lag(walk(0.1, steps=3), PARAMS) is None
    alone = GaitEvents(tuple(e for e in walk(0.1).events if e.side == "left"))
    assert measure_foot_lag(alone, PARAMS) is None
    assert measure_foot_lag(GaitEvents(()), PARAMS) is None


def codes(found: TakeAnalysis) -> list[str]:
    return [n.code for n in found.notices]


@pytest.mark.slow
def test_a_take_of_two_feet_tells_a_late_one_and_no_patient() -> None:
    right = analyse(simulate_scenario("hemi_mild", 3, worn=("foot_l", "foot_r")).recording)
    assert "feet_out_of_time" not in codes(right)
    late = resume(replace(right, uniform=delay_sensor(right.recording, "foot_l", 0.1)), "agreement")
    assert "feet_out_of_time" in codes(late)


def test_the_limit_lies_between_patients_and_clocks() -> None:
    assert 0.045 < PARAMS.least_s < 0.1
