"""Bouts, turns and trunk steps in numbers, from hand-made ones."""

from __future__ import annotations

from math import pi

import pytest

from sagittal.core.errors import Notice
from sagittal.core.events.bouts import Bout, walking_bouts
from sagittal.core.events.steps import Step, Steps
from sagittal.core.events.turns import Turn
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.walking import bout_parameters, step_parameters, turn_parameters


def named(parameters: tuple[Parameter, ...]) -> dict[str, Parameter]:
    return {p.name: p for p in parameters}


def steps(*times: float) -> Steps:
    return Steps(tuple(Step(t, None) for t in times), walking_bouts(times), "pelvis")


def test_bouts_are_counted_and_their_minutes_added() -> None:
    two = (Bout(0.0, 0.5, 30.0, 50, 0.6), Bout(60.0, 60.0, 90.0, 50, 0.6))
    found = named(bout_parameters(two))
    assert found["walking_bout_count"].mean == 2
    assert found["walking_duration_min"].mean == pytest.approx(1.0)
    none = named(bout_parameters(()))
    assert none["walking_bout_count"].mean == 0
    assert (none["walking_duration_min"].mean, none["walking_duration_min"].reason) == (None, "no_bouts")


def test_turns_to_both_sides_have_positive_angles() -> None:
    found = named(turn_parameters((Turn(0, 2, pi, 1.0), Turn(5, 9, -pi / 2, 3.0))))
    assert found["turn_count"].mean == 2
    assert found["turn_angle_deg"].mean == pytest.approx(135.0)
    assert found["turn_duration_s"].mean == pytest.approx(3.0)
    assert found["turn_peak_velocity_dps"].mean == pytest.approx(114.6, abs=0.1)
    assert found["turn_angle_deg"].unit == "deg"
    assert named(turn_parameters(()))["turn_angle_deg"].reason == "no_turns"


def test_the_first_and_last_stride_of_a_bout_are_not_in_the_cadence() -> None:
    times = [0.0, 0.9, 1.7, 2.2, 2.7, 3.2, 3.7, 4.5, 5.4]
    found = named(step_parameters(steps(*times)))
    assert found["step_time_s"].mean == pytest.approx(0.5)
    assert found["step_time_s"].n == 4
    assert found["cadence_spm"].mean == pytest.approx(120.0)
    assert found["step_count"].mean == 9


def test_a_walk_of_starting_and_stopping_steps_has_no_cadence() -> None:
    found = named(step_parameters(steps(0.0, 0.9, 1.7, 2.2, 3.1)))
    assert (found["cadence_spm"].mean, found["cadence_spm"].reason) == (None, "no_strides")
    assert found["step_time_s"].reason == "no_strides"
    assert found["step_count"].mean == 5


def test_a_break_is_no_step_time() -> None:
    walked = steps(*[0.5 * i for i in range(8)], *[6.0 + 0.5 * i for i in range(8)])
    assert walked.bouts[0].breaks == ((3.5, 6.0),)
    assert max(walked.step_times_s) == pytest.approx(0.5)
    assert walked.cadence_spm == pytest.approx(120.0)


def test_without_steps_the_notice_is_the_reason() -> None:
    nothing = Steps((), (), "chest", (Notice("non_periodic", "No rhythm.", "chest"),))
    found = named(step_parameters(nothing))
    assert (found["cadence_spm"].mean, found["cadence_spm"].reason) == (None, "non_periodic")
    assert nothing.cadence_spm is None
    assert found["step_count"].mean == 0
