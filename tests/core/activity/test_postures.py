"""Postures between transitions: both ends agree, contradictions are marked, nothing is invented."""

from __future__ import annotations

from sagittal.core.activity.postures import FixedStretch, decide_postures
from sagittal.core.activity.result import PosturalTransition, TransitionCandidate, TransitionKind


def rise(kind: TransitionKind, position: float) -> PosturalTransition:
    return PosturalTransition(kind, position, position - 1.0, position + 1.0, 30.0, 0.4)


WALKS = (FixedStretch(0.0, 10.0, "walking", "steps"), FixedStretch(90.0, 100.0, "walking", "steps"))


def decide(
    transitions: list[PosturalTransition],
    candidates: list[TransitionCandidate] | None = None,
    limit: float = 1e9,
) -> tuple[list[tuple[str, float | None]], list[bool]]:
    spans, verdict = decide_postures(100.0, WALKS, [], transitions, candidates or [], limit)
    return [(s.kind, s.confidence) for s in spans[1:-1]], [t.consistent for t in verdict]


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
