from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.simulate import STEADY, Arc, Pivot, Script, Stand, Straight, Walker
from sagittal.core.simulate.script import plan, scale_script


def _plan(script: Script) -> tuple[list[float], list[float]]:
    planned = plan(script, Walker(variability=STEADY), np.random.default_rng(0))
    return [s.time_s for s in planned.steps], [s.path_rad for s in planned.steps]


def test_a_straight_walk_has_its_steps_and_a_closing_one() -> None:
    planned = plan((Stand(2.0), Straight(3.2, 0.64, 0.5), Stand(1.0)), Walker(variability=STEADY), _rng())
    assert [s.side for s in planned.steps] == ["right", "left"] * 3
    assert [s.opens for s in planned.steps] == [True] + [False] * 5
    assert [s.closes for s in planned.steps] == [False] * 5 + [True]
    assert planned.steps[-1].step_m == pytest.approx(0.4 * 0.64)
    assert planned.stands == ((0.0, 2.0), (5.0, 6.0))
    assert planned.duration_s == pytest.approx(6.0)


def test_a_full_circle_comes_back_to_its_start() -> None:
    planned = plan(
        (Stand(1.0), Arc(1.6, 2 * np.pi, 0.5, 0.55), Stand(1.0)), Walker(variability=STEADY), _rng()
    )
    last_of_circle = planned.steps[-2]
    assert last_of_circle.path_rad == pytest.approx(2 * np.pi)
    right = last_of_circle.side == "right"
    assert last_of_circle.y_m == pytest.approx(-0.05 if right else 0.05, abs=1e-9)
    assert last_of_circle.x_m == pytest.approx(0.0, abs=1e-9)


def test_left_turns_are_positive() -> None:
    _, headings = _plan((Stand(1.0), Pivot(np.pi / 2, np.pi / 6, 0.5), Stand(1.0)))
    assert headings[-1] == pytest.approx(np.pi / 2)


def test_feet_stand_beside_the_path_with_toes_out() -> None:
    planned = plan((Stand(1.0),), Walker(), _rng())
    left, right = planned.footprints["left"][0], planned.footprints["right"][0]
    assert left.y_m == pytest.approx(0.05)
    assert right.y_m == pytest.approx(-0.05)
    assert left.foot_rad > 0 > right.foot_rad


def test_drawn_steps_are_as_variable_as_asked() -> None:
    walker = Walker()
    planned = plan((Stand(1.0), Straight(640.0, 0.64, 0.54), Stand(1.0)), walker, _rng())
    length = np.array([s.step_m for s in planned.steps[:-1]])
    time = np.array([s.time_s for s in planned.steps if s.side == "right"])
    assert np.std(length) / np.mean(length) == pytest.approx(walker.variability.step_length, rel=0.1)
    assert np.std(np.diff(time)) / np.mean(np.diff(time)) == pytest.approx(
        walker.variability.step_time, rel=0.15
    )


def test_scaling_changes_lengths_and_nothing_else() -> None:
    script = (Stand(2.0), Straight(6.0, 0.6, 0.5), Arc(1.5, 1.0, 0.5, 0.5), Pivot(1.0, 0.5, 0.5), Stand(1.0))
    assert scale_script(script, 1.25) == (
        Stand(2.0),
        Straight(7.5, 0.75, 0.5),
        Arc(1.875, 1.0, 0.625, 0.5),
        Pivot(1.0, 0.5, 0.5),
        Stand(1.0),
    )


@pytest.mark.parametrize(
    ("script", "code"),
    [
        ((), "script_standing"),
        ((Straight(3.0, 0.6, 0.5), Stand(2.0)), "script_standing"),
        ((Stand(2.0), Straight(3.0, 0.6, 0.5)), "script_standing"),
        ((Stand(2.0), Straight(3.0, -0.6, 0.5), Stand(2.0)), "script_item"),
        ((Stand(2.0), Straight(3.0, 0.6, 0.0), Stand(2.0)), "script_item"),
        ((Stand(2.0), Arc(float("nan"), 1.0, 0.6, 0.5), Stand(2.0)), "script_item"),
    ],
)
def test_a_bad_script_is_refused_with_a_reason(script: Script, code: str) -> None:
    with pytest.raises(ParameterError) as caught:
        plan(script, Walker(), _rng())
    assert caught.value.code == code


def _rng() -> np.random.Generator:
    return np.random.default_rng(4)
