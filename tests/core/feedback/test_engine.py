"""From strides to cues: display, progression, end, and uncounted strides."""

from __future__ import annotations

import random
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.errors import ParameterError
from sagittal.core.feedback import Baseline, Cue, FeedbackEngine, Prescription
from sagittal.core.feedback.engine import LATE_S, OPENING
from sagittal.core.feedback.prescription import LEVELS
from tests.helpers.feedback import NAME, OPEN, prescription, train, walked

IN, NEAR, AWAY = 0.60, 0.53, 0.45
"""Values at level 0: within 0.55 to 0.65, within a level beside it, further off."""

FROM_0 = Baseline(mean=0.58)


def test_every_cue_keeps_value_zone_level_and_whether_it_was_shown() -> None:
    cues, _ = train([IN, NEAR, AWAY, 0.72], baseline=FROM_0)
    assert [c.zone for c in cues] == ["in", "near_low", "low", "high"]
    assert [c.error_sd for c in cues] == pytest.approx([0.0, -1.4, -3.0, 2.4])
    assert all(c.shown and c.why_not is None and c.level == 0 for c in cues)
    assert all([c.zone_low, c.zone_high] == pytest.approx([0.55, 0.65]) for c in cues)
    assert [c.share_in_zone_last20 for c in cues] == pytest.approx([1.0, 0.5, 1 / 3, 0.25])


def test_the_start_level_comes_from_the_baseline() -> None:
    cues, _ = train([0.4])
    assert cues[0].level == 3, "0.40 is 4 SD below 0.60: band 1 and three levels"
    assert cues[0].zone == "in"


def test_without_a_baseline_the_first_strides_without_feedback_say_where_to_begin() -> None:
    cues, engine = train([0.4] * (OPENING + 1), baseline=Baseline())
    assert [c.why_not for c in cues] == ["baseline"] * OPENING + [None]
    assert cues[-1].level == 3
    assert engine.state.phase == "training"


def test_a_record_with_a_start_level_still_learns_the_side_from_the_first_strides() -> None:
    given_level = prescription(progression={"start_level": 2})
    cues, _ = train([0.78] * (OPENING + 1), given_level, Baseline())
    assert (cues[-1].why_not, cues[-1].level) == (None, 2)
    assert [cues[-1].zone_low, cues[-1].zone_high] == pytest.approx([0.55, 0.75])


def test_the_last_level_of_the_same_record_goes_on() -> None:
    cues, _ = train([0.4], prescription(progression={"start_level": 5}), replace(OPEN, last_level=1))
    assert cues[0].level == 1


def test_more_than_70_percent_of_20_strides_in_the_zone_make_it_harder() -> None:
    hit, miss = 0.47, 0.30
    cues, _ = train([miss] * 6 + [hit] * 14 + [hit] * 2)
    assert [c.level for c in cues[:21]] == [3] * 21, "14 of 20 are 70 %, not more"
    assert cues[21].level == 2
    assert cues[21].share_in_zone_last20 == 1.0, "a new window"


def test_a_new_level_needs_20_strides_of_its_own() -> None:
    cues, _ = train([0.60] * 61)
    assert [c.level for c in cues] == [3] * 20 + [2] * 20 + [1] * 20 + [0]


def test_too_many_far_off_make_it_easier_but_not_those_beyond_the_other_side() -> None:
    cues, _ = train([0.2] * 21)
    assert cues[20].level == 4
    cues, _ = train([0.9] * 60)
    assert {c.level for c in cues} == {3}, "an easier level would not help who overshoots"


def test_levels_stay_when_the_therapist_keeps_them() -> None:
    cues, engine = train([0.6] * 60, prescription(progression={"automatic": False}))
    assert {c.level for c in cues} == {3}
    engine.command("level", -2)
    assert engine.state.level == 1
    engine.command("level", 1)
    assert engine.state.level == 2


def test_fading_and_probe_blocks_are_recorded_with_every_stride() -> None:
    given_schedule = {"kind": "fading", "shares_pct": [100, 50, 0], "strides_per_share": 8, "probe_every": 8,
                      "probe_strides": 2}  # fmt: skip
    cues, _ = train([0.4] * 30, prescription(schedule=given_schedule))
    why_nots = [c.why_not for c in cues]
    assert why_nots[:10] == [None] * 8 + ["probe"] * 2
    assert why_nots[10:20] == ["faded", None] * 4 + ["probe"] * 2
    assert why_nots[20:] == ["faded"] * 8 + ["probe"] * 2
    assert [c.block for c in cues if c.why_not == "probe"] == [1, 1, 2, 2, 3, 3]
    assert all(c.block is None for c in cues if c.why_not != "probe")


def test_probe_strides_do_not_move_the_level() -> None:
    blocks = {"probe_every": 5, "probe_strides": 5}
    cues, _ = train([0.6] * 36, prescription(schedule=blocks))
    assert [c.level for c in cues].index(2) == 40 - 5, "twenty training strides, and three blocks between"


def test_a_visit_after_a_training_begins_with_its_retention_block() -> None:
    cues, engine = train([0.4] * 25, baseline=replace(OPEN, after_training=True))
    assert [c.why_not for c in cues] == ["retention"] * 20 + [None] * 5
    assert not any(c.shown for c in cues[:20])
    assert engine.state.with_feedback.n == 5
    assert engine.state.without_feedback.n == 0, "the block is neither training with nor without"


def test_only_good_strides_are_told_in_positive_only_and_only_others_in_bandwidth() -> None:
    cues, engine = train([IN, AWAY], prescription(positive_only=True), FROM_0)
    assert [(c.shown, c.why_not) for c in cues] == [(True, None), (False, "positive_only")]
    assert engine.state.with_feedback.n == 2, "silence tells too"
    cues, _ = train([IN, AWAY], prescription(bandwidth=True), FROM_0)
    assert [(c.shown, c.why_not) for c in cues] == [(False, "bandwidth"), (True, None)]


def test_a_tone_sounds_only_where_it_is_asked_for_shown_and_outside_the_zone() -> None:
    cues, _ = train([IN, AWAY], prescription(modes=["tone"]), FROM_0)
    assert cues[0].tone is None
    assert cues[1].tone is not None
    cues, _ = train([AWAY], prescription(modes=["bar"]), FROM_0)
    assert cues[0].tone is None
    faded = {"kind": "fading", "shares_pct": [0]}
    cues, _ = train([AWAY], prescription(modes=["tone"], schedule=faded), FROM_0)
    assert (cues[0].shown, cues[0].tone) == (False, None)


def test_turns_gaps_missing_values_and_repeats_give_no_cue_and_do_not_count() -> None:
    engine = FeedbackEngine(prescription(), OPEN)
    assert engine.push(walked(0, 0.4, counted=False)) is None
    assert engine.push(walked(2, None)) is None
    first = engine.push(walked(2, 0.41))
    assert first is not None, "the same stride, once its distances are known"
    assert engine.push(walked(2, 0.41)) is None
    assert engine.push(walked(3, 0.6, "right")) is None
    assert engine.state.strides == 1


def test_a_late_stride_is_not_shown_and_neither_is_one_while_data_is_stale() -> None:
    engine = FeedbackEngine(prescription(), OPEN)
    on_time, late = walked(0, 0.4), walked(2, 0.4)
    visible_frame = engine.push(on_time, on_time.detected_s + LATE_S)
    old = engine.push(late, late.detected_s + LATE_S + 0.01)
    engine.command("stale", True)
    stale = engine.push(walked(4, 0.4))
    engine.command("stale", False)
    second_frame = engine.push(walked(6, 0.4))
    assert [c and c.why_not for c in (visible_frame, old, stale, second_frame)] == [
        None,
        "stale",
        "stale",
        None,
    ]


def test_off_and_pause_hold_the_schedule_and_the_level_rule() -> None:
    engine = FeedbackEngine(prescription(schedule={"probe_every": 4, "probe_strides": 2}), OPEN)
    observations: list[Cue] = []

    def walk(strides: int) -> None:
        for _ in range(strides):
            cue = engine.push(walked(2 * len(observations), 0.4))
            assert cue is not None
            observations.append(cue)

    walk(2)
    engine.command("pause", True)
    walk(3)
    engine.command("pause", False)
    engine.command("feedback", False)
    walk(3)
    engine.command("feedback", True)
    assert engine.state.next_probe == 2
    walk(3)
    assert [c.why_not for c in observations] == [None] * 2 + ["paused"] * 3 + ["off"] * 3 + [None] * 2 + [
        "probe"
    ]
    assert engine.state.window_n == 4
    assert engine.state.without_feedback.n == 7


@pytest.mark.parametrize(
    ("rule", "reason", "after"),
    [({"max_strides": 5}, "max_strides", 5), ({"max_minutes": 0.5}, "max_minutes", 30)],
)
def test_a_stop_rule_ends_feedback_and_says_which(rule: dict[str, Any], reason: str, after: int) -> None:
    cues, engine = train([0.4] * 40, prescription(stop_rule=rule))
    assert [c.why_not for c in cues].index("stopped") == after
    assert engine.state.stopped == reason
    assert engine.state.phase == "stopped"
    engine.command("feedback", True)
    cue = engine.push(walked(1000, 0.4))
    assert cue is not None
    assert cue.shown, "a person may go on"
    assert engine.state.stopped is None


def test_strides_with_and_without_feedback_are_kept_apart() -> None:
    half = prescription(schedule={"kind": "fading", "shares_pct": [50]}, progression={"automatic": False})
    _, engine = train([0.30, 0.40, 0.32, 0.50], half)
    state = engine.state
    assert [state.with_feedback.n, state.with_feedback.mean] == pytest.approx([2, 0.45])
    assert state.with_feedback.in_zone == 1.0
    assert [state.without_feedback.n, state.without_feedback.mean] == pytest.approx([2, 0.31])
    assert state.without_feedback.sd == pytest.approx(0.0141, abs=1e-4)
    assert state.without_feedback.in_zone == 0.0


def test_a_target_without_numbers_and_an_unknown_command_are_refused() -> None:
    unresolved = Prescription.from_json({"parameter": NAME, "side": "left"})
    with pytest.raises(ParameterError, match="no mean and SD"):
        FeedbackEngine(unresolved)
    engine = FeedbackEngine(prescription(), OPEN)
    for name, value in (("dance", True), ("level", True), ("level", 0.5), ("feedback", 1), ("pause", "yes")):
        with pytest.raises(ParameterError, match="Expected"):
            engine.command(name, value)  # type: ignore[arg-type]


commands = st.sampled_from(
    [("feedback", True), ("feedback", False), ("level", 1), ("level", -1), ("level", 30), ("level", -30),
     ("pause", True), ("pause", False), ("stale", True), ("stale", False)]
)  # fmt: skip
steps = st.lists(st.one_of(st.floats(0.0, 1.2), commands), max_size=150)


@settings(max_examples=60, deadline=None)
@given(steps=steps, baseline=st.sampled_from([OPEN, FROM_0, Baseline(), Baseline(0.8, after_training=True)]))
def test_whatever_happens_levels_have_bounds_and_a_cue_says_why_it_is_not_shown(
    steps: list[Any], baseline: Baseline
) -> None:
    def run() -> list[tuple[Cue, Any]]:
        engine = FeedbackEngine(prescription(schedule={"kind": "fading", "probe_every": 7}), baseline)
        result = []
        for n, step in enumerate(steps):
            if isinstance(step, tuple):
                engine.command(*step)
                continue
            cue = engine.push(walked(n, step))
            assert cue is not None
            result.append((cue, engine.state.to_json()))
        return result

    first = run()
    for cue, state in first:
        assert 0 <= cue.level <= LEVELS
        assert 0 <= state["level"] <= LEVELS
        assert cue.shown == (cue.why_not is None)
        assert cue.zone_low <= 0.60 - 0.05 + 1e-9
        assert cue.zone_high >= 0.60 + 0.05 - 1e-9
    assert run() == first, "nothing but strides and commands decides"


def test_a_simulated_learner_comes_to_the_target_and_the_record_shows_what_stays_without_feedback() -> None:
    """A person who corrects part of each shown error and half keeps it: learning by trial, Roemmich 2016."""
    chance = random.Random(7)  # noqa: S311 - a simulated person, no secret
    given_all = prescription(
        schedule={"kind": "fading", "shares_pct": [100, 50], "strides_per_share": 200, "probe_every": 40}
    )
    engine = FeedbackEngine(given_all, OPEN)
    kept, held = 0.40, 0.0
    cues: list[Cue] = []
    for n in range(500):
        value = kept + held + chance.gauss(0.0, 0.02)
        cue = engine.push(walked(2 * n, value))
        assert cue is not None
        cues.append(cue)
        if cue.shown:
            error = 0.60 - value
            kept += 0.02 * error
            held += 0.30 * error
        else:
            held *= 0.5
    assert cues[0].level == 3
    assert cues[-1].level == 0
    levels = [c.level for c in cues]
    assert all(abs(a - b) <= 1 for a, b in pairwise(levels)), "one step at a time"
    state = engine.state
    assert state.with_feedback.mean is not None
    assert state.without_feedback.mean is not None
    assert state.with_feedback.mean > state.without_feedback.mean > 0.40, "performance before learning"
