"""Parts of the monitor with known answers: rise, direction, postures, stairs, wear."""

from __future__ import annotations

import numpy as np
import pytest

from core.activity.params import StairParams
from core.activity.postures import FixedStretch, decide_postures
from core.activity.result import PosturalTransition, TransitionCandidate, TransitionKind
from core.activity.stairs import calibrate_stairs, tell_stairs
from core.activity.transitions import measure_rise, tell_direction
from core.errors import ParameterError
from core.frames import GRAVITY


def pulse(height_m: float, seconds: float = 2.0) -> np.ndarray:
    """Upward acceleration in frames of going up by so much without a jerk at the ends."""
    u = (np.arange(int(seconds * 10)) + 0.5) / (seconds * 10)
    return np.asarray(height_m * 2.0 * np.pi / seconds**2 * np.sin(2.0 * np.pi * u))


@pytest.mark.parametrize("height", [0.4, -0.35])
def test_the_rise_is_the_height_gone_up_whatever_the_bias(height: float) -> None:
    assert measure_rise(GRAVITY + 0.2 + pulse(height)) == pytest.approx(height, rel=0.02)


def test_rising_pushes_first_and_sitting_down_falls_first() -> None:
    assert tell_direction(GRAVITY + pulse(0.4)) > 0.0
    assert tell_direction(GRAVITY + pulse(-0.4)) < 0.0


def rise(kind: TransitionKind, at: float) -> PosturalTransition:
    return PosturalTransition(kind, at, at - 1.0, at + 1.0, 30.0, 0.4)


WALKS = (FixedStretch(0.0, 10.0, "walking", "steps"), FixedStretch(90.0, 100.0, "walking", "steps"))


def decide(
    transitions: list[PosturalTransition],
    candidates: list[TransitionCandidate] | None = None,
    limit: float = 1e9,
) -> tuple[list[tuple[str, float | None]], list[bool]]:
    spans, judged = decide_postures(100.0, WALKS, [], transitions, candidates or [], limit)
    return [(s.kind, s.confidence) for s in spans[1:-1]], [t.consistent for t in judged]


def test_both_ends_agree_on_standing_and_sitting() -> None:
    spans, consistent = decide([rise("stand_to_sit", 20.0), rise("sit_to_stand", 60.0)])
    assert spans == [("standing", 1.0), ("sitting", 1.0), ("standing", 1.0)]
    assert consistent == [True, True]


def test_a_transition_in_the_wrong_posture_is_marked_and_nothing_is_invented() -> None:
    spans, consistent = decide([rise("sit_to_stand", 50.0)])
    assert spans == [("unknown", None), ("standing", 1.0)]
    assert consistent == [False]


def test_a_careful_lean_settles_what_contradicts() -> None:
    lean = TransitionCandidate(30.0, 29.0, 31.0, 15.0, -0.4, "lean_below_limit", "stand_to_sit")
    spans, consistent = decide([rise("sit_to_stand", 50.0)], [lean])
    assert spans == [("standing", 0.5), ("sitting", 0.5), ("standing", 1.0)]
    assert consistent == [True]


def test_nobody_stands_for_so_long_without_a_step() -> None:
    assert decide([], limit=60.0)[0] == [("unknown", None)]


def test_stairs_are_told_by_a_persons_own_limits() -> None:
    level, up, down = (
        (np.full(30, r), np.full(30, x)) for r, x in ((0.005, 0.0), (0.02, 0.05), (0.015, 0.01))
    )
    rocks, lean = (np.concatenate([kind[i] for kind in (level, up, down)]) for i in (0, 1))
    assert not tell_stairs(rocks, lean, StairParams()).any()
    own = calibrate_stairs(level, up, down)
    assert np.bincount(tell_stairs(rocks, lean, own)).tolist() == [30, 30, 30]


def test_stairs_like_level_walking_cannot_be_calibrated() -> None:
    same = (np.full(30, 0.01), np.zeros(30))
    with pytest.raises(ParameterError, match="Expected more on stairs") as error:
        calibrate_stairs(same, same, same)
    assert error.value.code == "stairs_not_told_apart"
