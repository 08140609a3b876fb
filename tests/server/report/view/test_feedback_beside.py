"""Other parameters that changed during training, and retention since the last one."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence

import numpy as np
import pytest

from sagittal.core.feedback import AnalysedStride, FeedbackSplit, GuardState, SideEffect
from sagittal.core.feedback.cue import Summary
from sagittal.core.feedback.guard import FIRST
from sagittal.core.frames import Side
from sagittal.core.norms.profile import SAGITTAL
from sagittal.core.parameters.result import CycleCurves
from sagittal.server.report.view.feedback_beside import (
    PreviousTraining,
    Retention,
    compare_retention,
    describe_effects,
    side_effects,
)
from sagittal.server.report.words.feedback_words import NBSP
from sagittal.server.report.words.wording import parameter_term
from tests.helpers.feedback import NAME, OPEN, prescription

METRES = parameter_term(NAME)
DAY = dt.date(2026, 3, 2)


def strides(side: Side, values: Sequence[float | None], counted: bool = True) -> list[AnalysedStride]:
    return [AnalysedStride(side, float(i), value, counted) for i, value in enumerate(values)]


def test_the_other_side_is_held_against_its_first_strides_in_order_of_time() -> None:
    second = strides("right", [0.5] * FIRST + [0.7] * FIRST)
    inputs = prescription(guard={"other_change": 0.1})
    state = side_effects(inputs, OPEN, second[::-1], None)
    assert state.other.change == pytest.approx(0.2)
    assert state.other.beyond
    assert not side_effects(prescription(guard={"other_change": 0.3}), OPEN, second, None).other.beyond


def test_strides_that_do_not_count_or_were_not_measured_say_nothing() -> None:
    first = strides("right", [0.5] * (2 * FIRST - 1))
    for lacking in (strides("right", [None]), strides("right", [0.5], counted=False)):
        assert side_effects(prescription(), OPEN, [*first, *lacking], None).other.reason == "too_few_strides"
    assert side_effects(prescription(), OPEN, [*first, *strides("right", [0.5])], None).other.change == 0.0


def curves(bent_deg: float, n: int, gap: bool = False) -> CycleCurves:
    """Knees that begin to bend in the middle of the take; strides 0, 2, 4 … are the left ones."""
    rows = np.zeros((n, 101))
    course = np.sin(np.linspace(0.0, 2.0 * np.pi, 101))
    bent = rows + np.radians(np.where(np.arange(n) < n // 2, 0.0, bent_deg))[:, None] * course
    if gap:
        bent[-1, 3] = np.nan
    sides: tuple[Side, ...] = ("left", "right")
    return CycleCurves(
        curves={v: dict.fromkeys(sides, bent if v == "knee_flexion" else rows) for v in SAGITTAL},
        stride_index={side: tuple(range(k, 2 * n, 2)) for k, side in enumerate(sides)},
        used=dict.fromkeys(sides, np.ones(n, bool)),
        foot_off_pct=dict.fromkeys(sides, np.full(n, 60.0)),
    )


def test_the_profile_is_judged_by_the_curves_of_the_strides_that_count() -> None:
    n = 2 * FIRST
    sides: tuple[Side, ...] = ("left", "right")
    walked = [AnalysedStride(sides[i % 2], i / 2, 0.5, True) for i in range(2 * n)]
    still = side_effects(prescription(), OPEN, walked, curves(0.0, n)).gps
    moved = side_effects(prescription(), OPEN, walked, curves(40.0, n)).gps
    assert still.change == pytest.approx(0.0)
    assert moved.change is not None
    assert abs(moved.change) > 1.0
    # a stride with a gap is one too few on each side
    assert side_effects(prescription(), OPEN, walked, curves(0.0, n, gap=True)).gps.change is None
    assert side_effects(prescription(), OPEN, walked, None).gps.change is None


def test_effects_in_words_say_the_change_and_the_limit_it_is_held_against() -> None:
    within = SideEffect(0.02, 0.10, "set in the prescription", False, None)
    beyond = SideEffect(2.04, 1.6, "MCID", True, None)
    second, profile = describe_effects(prescription(), GuardState(within, beyond), METRES)
    assert (second.kind, second.label) == ("ok", "Step length, right")
    assert (second.text, second.words) == (
        f"+0.02{NBSP}m", f"within 0.10{NBSP}m (set in the prescription)"
    )  # fmt: skip
    assert (profile.kind, profile.text, profile.words) == ("warn", "+2.0°", "more than 1.6° (MCID)")
    assert (profile.change, profile.limit, profile.source) == (2.04, 1.6, "MCID")


def test_the_other_side_is_named_by_the_side_that_is_trained() -> None:
    labels = [
        describe_effects(prescription(side=side), GuardState(), METRES)[0].label
        for side in ("left", "right", None)
    ]
    assert labels == ["Step length, right", "Step length, left", "Step length, other side"]


def test_what_cannot_be_judged_says_why() -> None:
    few, unlimited = describe_effects(
        prescription(), GuardState(SideEffect(), SideEffect(0.5, reason="no_limit")), METRES
    )
    assert (few.kind, few.text) == ("none", "–")
    assert few.words == ("not assessed: requires 10 strides at the start and 10 afterwards on this side")
    assert (unlimited.kind, unlimited.change, unlimited.words) == ("none", 0.5, "no limit prescribed")


def retained(now: float | None, end: float | None, name: str = NAME) -> Retention | None:
    def result(start: float | None, last: float | None) -> FeedbackSplit:
        def summary(mean: float | None) -> Summary:
            return Summary() if mean is None else Summary(20, mean, 0.02, 0.5)

        return FeedbackSplit((), {"retention": summary(start)}, (), (), summary(last), 0, 0, Summary())

    initial = PreviousTraining("s1", DAY, result(None, end))
    return compare_retention(
        prescription(parameter=name), result(now, None), initial, parameter_term(name), None
    )


def test_retention_is_the_first_strides_of_today_less_the_last_of_the_training_before() -> None:
    result = retained(0.54, 0.60)
    assert result is not None
    assert result.difference == pytest.approx(-0.06)
    assert (result.session_id, result.performed_on) == ("s1", DAY)
    assert (result.end.text, result.now.text) == ("0.60 ± 0.02", "0.54 ± 0.02")
    assert (result.end.label, result.now.kind) == ("End of the last training", "retention")


@pytest.mark.parametrize("now", [0.54, 0.66])
def test_a_difference_below_the_measurement_error_is_within_it(now: float) -> None:
    result = retained(now, 0.60)
    assert result is not None
    assert result.verdict == f"within the measurement error of 0.067{NBSP}m"
    assert result.limit == 0.067
    assert result.limit_source is not None


@pytest.mark.parametrize("now", [0.53, 0.67])
def test_a_difference_either_way_can_be_more_than_the_measurement_error(now: float) -> None:
    result = retained(now, 0.60)
    assert result is not None
    assert result.verdict == f"more than the measurement error of 0.067{NBSP}m"


def test_a_parameter_without_a_known_error_says_so() -> None:
    result = retained(1.2, 1.1, "stride_time_s")
    assert result is not None
    assert (result.limit, result.limit_source) == (None, None)
    assert result.verdict == "the measurement error of this parameter is unknown"


def test_retention_needs_both_ends() -> None:
    assert retained(None, 0.6) is None
    assert retained(0.55, None) is None
