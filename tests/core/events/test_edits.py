"""A person's edits of events and strides: what each does, what is refused, and that nothing else changes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.errors import ParameterError
from sagittal.core.events.edits import APART_S, Edit, apply_event_edits, apply_stride_edits, read_edit
from sagittal.core.events.result import GaitEvent, GaitEvents, Stride, Strides
from sagittal.core.frames import SIDES

END = 10.0


def found() -> GaitEvents:
    """Two strides of the left foot and one contact of the right."""
    times = (("left", "ic", 1.0), ("right", "ic", 1.5), ("left", "tc", 1.6), ("left", "ic", 2.0),
             ("left", "tc", 2.6), ("left", "ic", 3.0))  # fmt: skip
    return GaitEvents(tuple(GaitEvent(t, side, kind, "foot_pitch", t) for side, kind, t in times))  # type: ignore[arg-type]


def listed() -> Strides:
    return Strides(
        (
            Stride("left", 1.0, 1.6, 2.0, excluded_reason="first", flags=("first",)),
            Stride("left", 2.0, 2.6, 3.0),
            Stride("right", 1.5, 2.1, 2.5),
        )
    )


def times(events: GaitEvents, *edits: Edit) -> tuple[float, ...]:
    return apply_event_edits(events, edits, END).times("left", "ic")


def test_no_edit_changes_nothing() -> None:
    assert apply_event_edits(found(), (), END).events == found().events
    assert apply_stride_edits(listed(), ()).strides == listed().strides


def test_an_event_is_moved_and_says_that_a_person_placed_it() -> None:
    moved = apply_event_edits(found(), [Edit("move_event", "left", 2.0, "ic", 2.05)], END)
    assert moved.times("left", "ic") == (1.0, 2.05, 3.0)
    assert [e.source for e in moved.events].count("manual") == 1
    assert moved.times("left", "tc") == found().times("left", "tc")


def test_an_event_is_added_in_order_of_time_and_deleted_again() -> None:
    new = Edit("add_event", "left", 3.6, "tc")
    added = apply_event_edits(found(), [new], END)
    assert added.times("left", "tc") == (1.6, 2.6, 3.6)
    assert [e.time_s for e in added.events] == sorted(e.time_s for e in added.events)
    assert apply_event_edits(added, [Edit("delete_event", "left", 3.6, "tc")], END).events == found().events


def test_edits_are_applied_in_the_order_in_which_they_were_made() -> None:
    first, second = Edit("move_event", "left", 2.0, "ic", 2.1), Edit("move_event", "left", 2.1, "ic", 2.2)
    assert times(found(), first, second) == (1.0, 2.2, 3.0)
    with pytest.raises(ParameterError) as refused:
        times(found(), second, first)
    assert refused.value.code == "no_such_event"


def test_undo_is_leaving_the_last_edit_out() -> None:
    edits = [Edit("move_event", "left", 2.0, "ic", 2.1), Edit("delete_event", "left", 3.0, "ic")]
    assert times(found(), *edits) == (1.0, 2.1)
    assert times(found(), *edits[:-1]) == (1.0, 2.1, 3.0)


@pytest.mark.parametrize(
    ("edit", "code"),
    [
        (Edit("move_event", "left", 2.0, "ic", 2.7), "event_order"),  # past its foot-off
        (Edit("move_event", "left", 2.0, "ic", 1.62), "event_order"),  # on the foot-off before
        (Edit("add_event", "left", 2.01, "tc"), "event_order"),
        (Edit("move_event", "left", 3.0, "ic", 11.0), "event_outside"),
        (Edit("add_event", "left", -0.1, "ic"), "event_outside"),
        (Edit("delete_event", "right", 1.0, "ic"), "no_such_event"),
        (Edit("move_event", "left", 2.002, "ic", 2.1), "no_such_event"),
    ],
)
def test_what_cannot_be_is_refused_with_its_reason(edit: Edit, code: str) -> None:
    with pytest.raises(ParameterError) as refused:
        apply_event_edits(found(), [edit], END)
    assert refused.value.code == code


def test_feet_do_not_stand_in_each_others_way() -> None:
    moved = apply_event_edits(found(), [Edit("move_event", "right", 1.5, "ic", 2.02)], END)
    assert moved.times("right", "ic") == (2.02,)


def test_a_stride_is_left_out_with_its_reason_and_counted_again() -> None:
    out = Edit("exclude_stride", "left", 2.4, reason="stumbled")
    assert apply_stride_edits(listed(), [out]).strides[1].excluded_reason == "manual:stumbled"
    assert apply_stride_edits(listed(), [out]).strides[1].excluded_by == "person"
    back = Edit("include_stride", "left", 2.4)
    assert apply_stride_edits(listed(), [out, back]).strides == listed().strides


def test_a_person_may_count_what_a_rule_left_out_and_the_flag_stays() -> None:
    counted = apply_stride_edits(listed(), [Edit("include_stride", "left", 1.2)]).strides[0]
    assert (counted.excluded_reason, counted.flags) == (None, ("first",))


def test_a_decision_about_a_stride_that_is_gone_has_no_effect() -> None:
    after = apply_stride_edits(listed(), [Edit("exclude_stride", "left", 9.0, reason="x")])
    assert after.strides == listed().strides


@pytest.mark.parametrize(
    "values",
    [
        {"kind": "move_event", "side": "left", "time_s": 1.0, "event": "ic"},
        {"kind": "add_event", "side": "left", "time_s": 1.0, "event": "ic", "to_s": 2.0},
        {"kind": "add_event", "side": "left", "time_s": 1.0},
        {"kind": "add_event", "side": "left", "time_s": float("nan"), "event": "ic"},
        {"kind": "add_event", "side": "both", "time_s": 1.0, "event": "ic"},
        {"kind": "exclude_stride", "side": "left", "time_s": 1.0},
        {"kind": "exclude_stride", "side": "left", "time_s": 1.0, "reason": "  "},
        {"kind": "exclude_stride", "side": "left", "time_s": 1.0, "reason": "x" * 201},
        {"kind": "include_stride", "side": "left", "time_s": 1.0, "event": "ic"},
        {"kind": "forget", "side": "left", "time_s": 1.0},
        {"kind": "add_event", "side": "left", "time_s": 1.0, "event": "ic", "colour": "red"},
    ],
)
def test_an_edit_that_is_not_whole_is_refused(values: dict[str, Any]) -> None:
    with pytest.raises(ParameterError) as refused:
        read_edit(values)
    assert refused.value.code == "bad_edit"


def test_an_edit_comes_back_from_json() -> None:
    for edit in (
        Edit("move_event", "left", 2.0, "ic", 2.1),
        Edit("exclude_stride", "right", 2.0, reason="x"),
    ):
        assert read_edit(edit.to_json()) == edit


@given(
    steps=st.lists(
        st.tuples(
            st.sampled_from(["move_event", "add_event", "delete_event"]),
            st.sampled_from(SIDES),
            st.sampled_from(["ic", "tc"]),
            st.floats(-1.0, END + 1.0),
            st.floats(-1.0, END + 1.0),
        ),
        max_size=12,
    )
)
def test_whatever_is_done_events_stay_in_order_apart_and_inside(steps: list[Any]) -> None:
    edits: list[Edit] = []
    for kind, side, event, time, to in steps:
        own = apply_event_edits(found(), edits, END).times(side, event)
        # an event that is there, where one is named; else the time as it came
        at = time if kind == "add_event" or not own else own[int(np.argmin(np.abs(np.subtract(own, time))))]
        edit = Edit(kind, side, at, event, to if kind == "move_event" else None)
        try:
            apply_event_edits(found(), [*edits, edit], END)
        except ParameterError:
            continue
        edits.append(edit)
    after = apply_event_edits(found(), edits, END).events
    assert [e.time_s for e in after] == sorted(e.time_s for e in after)
    assert all(0.0 <= e.time_s <= END for e in after)
    for side in SIDES:
        kept = [e.time_s for e in after if e.side == side]
        assert all(b - a >= APART_S for a, b in pairwise(kept))
