"""Targets of biofeedback: what each source gives, or why it gives nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from sagittal.core.frames import Side
from sagittal.core.norms import Norms, NormValue
from sagittal.core.parameters.result import Parameter
from sagittal.server.clinic import patients
from sagittal.server.report.history.numbers import Numbers
from sagittal.server.report.words.wording import NO_NORM
from sagittal.server.results.targets import (
    FEWEST,
    AnalysedWalk,
    _earlier,
    find_usual_value,
    last_walk,
    offer,
    opposite_side,
)
from tests.helpers.clinic import Clinic
from tests.server import feedback
from tests.server.results.test_visits import DAY, take

NAME = "step_length_m"


def step(side: Side | None, mean: float | None, sd: float | None = 0.02, n: int = 10) -> Parameter:
    return Parameter(NAME, side, n, mean, sd, "m")


def walk(*parameters: Parameter, norms: Norms | None = None, own: Norms | None = None) -> AnalysedWalk:
    numbers = Numbers(tuple(parameters), (), ("good", "good"))
    return AnalysedWalk(take("w").session, numbers, norms or Norms(None, None), lambda: own)


def norm(mean: float = 0.7, **changes: Any) -> NormValue:
    return replace(NormValue(NAME, mean, 0.05, 30, "adults", "Somebody 2020"), **changes)


def test_a_target_that_is_entered_and_a_person_without_a_walk_are_offered_nothing() -> None:
    assert offer(walk(), "manual", NAME, "left").reason == "Enter mean and SD."
    missing = offer(None, "norm", NAME, "left")
    assert missing.target is None
    assert missing.reason is not None
    assert missing.reason.startswith("No walk without feedback has been analysed for this person yet.")


def test_a_persons_own_side_is_a_target_with_its_strides_and_day() -> None:
    target = offer(walk(step("left", 0.5), step("right", 0.6)), "own_baseline", NAME, "left").target
    assert target is not None
    assert (target.source, target.mean, target.sd, target.session_id) == ("own_baseline", 0.5, 0.02, "w")
    assert target.words.startswith("left side, 10 strides on ")


@pytest.mark.parametrize(
    "measured", [(), (step("left", 0.5, n=FEWEST - 1),), (step("left", 0.5, sd=0.0),), (step("left", None),)]
)
def test_too_few_strides_or_equal_ones_are_no_target(measured: Sequence[Parameter]) -> None:
    refused = offer(walk(*measured), "own_baseline", NAME, "left")
    assert refused.target is None
    assert refused.reason is not None
    assert f"expected at least {FEWEST} that differ" in refused.reason
    assert offer(walk(step("left", 0.5, n=FEWEST)), "own_baseline", NAME, "left").target is not None


def test_the_better_side_is_the_other_one_where_it_is_ahead() -> None:
    assert opposite_side("left") == "right"
    assert opposite_side("right") == "left"
    ahead = offer(walk(step("left", 0.5), step("right", 0.6)), "own_better_side", NAME, "left")
    assert ahead.target is not None
    assert (ahead.target.mean, ahead.target.words.split(",")[0]) == (0.6, "right side")
    for left in (0.6, 0.7):
        details = offer(walk(step("left", left), step("right", 0.6)), "own_better_side", NAME, "left")
        assert details.target is None
        assert details.reason is not None
        assert details.reason.startswith("The left side is the better one on ")


def test_neither_side_is_better_of_both_or_of_a_parameter_without_a_direction() -> None:
    pair = offer(walk(step("left", 0.5)), "own_better_side", NAME, None)
    assert pair.reason is not None
    assert pair.reason.startswith("Both sides are selected for training.")
    open_end = offer(walk(), "own_better_side", "knee_flexion_ic_deg", "left")
    assert open_end.reason is not None
    assert "neither higher nor lower is better by itself" in open_end.reason


def test_the_norm_at_this_speed_goes_before_that_of_the_pace_and_the_clinics_own() -> None:
    norms = Norms(None, None, values={NAME: norm(0.7)}, expected={NAME: norm(0.65, group="at this speed")})
    target = offer(
        walk(norms=norms, own=Norms(None, None, values={NAME: norm(0.9)})), "norm", NAME, "left"
    ).target
    assert target is not None
    assert (target.mean, target.words) == (0.65, "at this speed, n = 30 (Somebody 2020)")
    usual = replace(norms, expected={NAME: norm(0.65, comparable=False)})
    assert getattr(offer(walk(norms=usual), "norm", NAME, "left").target, "mean", None) == 0.7
    without = replace(norms, expected={NAME: norm(sd=0.0)}, values={})
    own = offer(
        walk(norms=without, own=Norms(None, None, values={NAME: norm(0.9, n=None)})), "norm", NAME, None
    )
    assert own.target is not None
    assert (own.target.mean, own.target.words) == (0.9, "adults (Somebody 2020)")


def test_without_a_norm_the_reason_is_told() -> None:
    def reason(norms: Norms) -> str | None:
        return offer(walk(norms=norms), "norm", NAME, "left").reason

    alternative = " Choose another source, or enter a target."
    assert reason(Norms(None, None)) == f"There is no norm of this parameter.{alternative}"
    unknown = Norms(None, None, timing_reason="age_unknown", reason="no_norm_for_age")
    assert reason(unknown) == f"{NO_NORM['age_unknown']}{alternative}"
    unlike = Norms(None, None, values={NAME: norm(comparable=False, note="Not comparable.")})
    assert reason(unlike) == f"Not comparable.{alternative}"


def test_a_value_of_both_sides_is_the_takes_own_or_both_together() -> None:
    whole = walk(step(None, 0.55), step("left", 0.5))
    assert find_usual_value(whole, NAME, None) == step(None, 0.55)
    assert find_usual_value(whole, NAME, "right") == step(None, 0.55)
    sides = find_usual_value(
        walk(step("left", 1.0, sd=0.0, n=2), step("right", 2.0, sd=0.0, n=2)), NAME, None
    )
    assert sides is not None
    assert (sides.n, sides.mean, sides.side) == (4, 1.5, None)
    assert sides.sd == pytest.approx((4 * 0.25 / 3) ** 0.5)
    assert find_usual_value(walk(step("left", None)), NAME, None) is None
    single = find_usual_value(walk(step("left", 1.0, sd=None, n=1)), NAME, None)
    assert single is not None
    assert single.sd is None


def test_only_what_was_walked_alike_before_a_visit_counts() -> None:
    visit = take("now", 7, minute=5).session
    for earlier, counts in (
        (take("a", 6), True),
        (take("b", 7, minute=4), True),
        (take("c", 7, minute=5), False),
        (take("d", 8), False),
        (take("now", 6), False),
        (take("e", 6, pace="fast"), False),
    ):
        assert _earlier(earlier, visit) is counts, earlier.session.id


def test_the_last_walk_is_never_one_with_feedback(stored: Clinic) -> None:
    patient, unseen = feedback.person(stored), feedback.person(stored)
    walked = feedback.walked(stored, patient, 0, 12.0)
    feedback.walked(stored, patient, 3, 12.0, feedback=True)
    with stored.db.read() as c:
        response = patients.get(c, patient)
        result = last_walk(c, stored.app.state.reviewed, response, with_controls=False)
        nothing = last_walk(c, stored.app.state.reviewed, patients.get(c, unseen))
        second = last_walk(c, stored.app.state.reviewed, response, session_id="none")
    assert result is not None
    assert (result.session.id, result.own_controls()) == (walked, None)
    assert result.session.performed_on == DAY
    assert nothing is None
    assert second is None
