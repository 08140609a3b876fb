"""The stride list: cycles from hand-made events, and the reason for each that does not count."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.events import StrideParams, detect, stride_list
from sagittal.core.events.result import MANUAL, GaitEvent, GaitEvents, Strides
from sagittal.core.frames import FOOT, Bools, Floats, Side
from sagittal.core.fusion.orientations import Orientations
from tests.core.events.foot_signal import orientation, orientations, walk

RATE = 100.0


def hand_made(
    right_ic: list[float], left_ic: list[float], stance: float = 0.6, stride: float = 1.0
) -> GaitEvents:
    """Contacts of both feet, each followed by its terminal contact after `stance`."""
    events = []
    for side, contacts in (("right", right_ic), ("left", left_ic)):
        for t in contacts:
            events.append(GaitEvent(t, side, "ic", "manual", t))  # type: ignore[arg-type]
            events.append(GaitEvent(t + stance * stride, side, "tc", "manual", t))  # type: ignore[arg-type]
    return GaitEvents(tuple(sorted(events, key=lambda e: e.time_s)))


def standing(seconds: float = 30.0, heading: Floats | float = 0.0, lost: Bools | None = None) -> Orientations:
    level = np.zeros(round(seconds * RATE))
    valid = {} if lost is None else {"foot_r": ~lost}
    return orientations(RATE, {"foot_r": level, "foot_l": level}, valid, heading)  # type: ignore[arg-type]


def straight(n: int = 9) -> GaitEvents:
    return hand_made([1.0 + i for i in range(n)], [1.5 + i for i in range(n)])


def reasons(strides: Strides, side: Side = "right") -> list[str | None]:
    return [s.excluded_reason for s in strides.strides if s.side == side]


def test_a_cycle_carries_its_own_and_the_other_foots_events() -> None:
    second = [s for s in stride_list(straight(), standing()).strides if s.side == "right"][1]
    assert (second.start_s, second.end_s) == (2.0, 3.0)
    assert second.tc_s == pytest.approx(2.6)
    assert second.opposite_tc_s == pytest.approx(2.1)
    assert second.opposite_ic_s == pytest.approx(2.5)
    assert second.turn_rad == pytest.approx(0.0, abs=1e-12)
    assert second.excluded_reason is None


def test_two_contacts_refined_to_the_same_moment_make_no_stride_of_no_duration() -> None:
    events = straight().events
    doubled = tuple(e for event in events for e in (event, event))
    found, expected = stride_list(GaitEvents(doubled), standing()), stride_list(straight(), standing())
    assert found.strides == expected.strides
    assert (found.columns.duration_s > 0.0).all()


def test_the_first_and_last_stride_of_a_bout_are_set_aside() -> None:
    assert reasons(stride_list(straight(), standing())) == ["first", *[None] * 6, "last"]


def test_two_bouts_have_two_starts_and_two_ends() -> None:
    contacts = [1.0 + i for i in range(6)] + [12.0 + i for i in range(6)]
    found = stride_list(hand_made(contacts, [t + 0.5 for t in contacts]), standing())
    bout = ["first", None, None, None, "last"]
    assert reasons(found) == [*bout, "implausible_time", *bout]


@pytest.mark.parametrize("contacts", range(2, 8))
def test_starting_and_stopping_strides_never_count_however_short_the_walk(contacts: int) -> None:
    found = stride_list(straight(contacts), standing())
    strides = contacts - 1
    expected = ["first"] if strides == 1 else ["first", *[None] * (strides - 2), "last"]
    assert reasons(found) == reasons(found, "left") == expected


def test_a_walk_of_three_metres_counts_nothing_and_says_why() -> None:
    found = stride_list(straight(3), standing())
    assert not found.select_used()
    assert [n.code for n in found.notices] == ["no_strides", "no_strides"]
    assert found.notices[0].message.startswith("All 2 left strides are excluded: 1 first, 1 last.")
    assert "walk further" in found.notices[0].message


def test_few_strides_are_said_with_their_number() -> None:
    (said,) = stride_list(straight(6), standing()).notices
    assert said.code == "short_walk"
    assert said.message.startswith("Only 3 left and 3 right strides count;")
    assert not stride_list(straight(7), standing()).notices


def test_cycles_of_implausible_time_do_not_count() -> None:
    events = hand_made([1, 2, 3, 4, 4.3, 5.3, 6.3, 7.3, 8.3, 11.5, 12.5, 13.5], [])
    listed = reasons(stride_list(events, standing()))
    assert listed == [
        "first", None, None, "incomplete", "incomplete", None, None, "last",
        "implausible_time", "first", "last",
    ]  # fmt: skip
    quick = hand_made([1, 2, 3, 4, 4.3, 5.3, 6.3, 7.3], [], stance=0.2)
    assert reasons(stride_list(quick, standing()))[3] == "implausible_time"


def test_a_missed_contact_makes_the_cycle_incomplete() -> None:
    events = hand_made([1.0 + i for i in range(9) if i != 4], [1.5 + i for i in range(9)])
    found = [s for s in stride_list(events, standing()).strides if s.side == "right"]
    assert found[3].excluded_reason == "incomplete"
    assert found[3].opposite_ic_s is None
    no_tc = GaitEvents(tuple(e for e in straight().events if e.kind == "ic" or not 4 < e.time_s < 5))
    assert reasons(stride_list(no_tc, standing()))[3] == "incomplete"


def test_lost_samples_exclude_the_strides_that_touch_them() -> None:
    lost = np.zeros(3000, np.bool_)
    lost[395:405] = True
    found = stride_list(straight(), standing(lost=lost))
    assert reasons(found) == ["first", None, "gap", "gap", None, None, None, "last"]
    assert reasons(found, "left") == ["first", *[None] * 6, "last"]
    assert found.strides[4].turn_rad is None


@pytest.mark.parametrize(
    ("at_s", "own", "opposite"),
    [(1.5, True, True), (1.65, False, True), (2.15, False, False), (3.2, False, False), (3.35, True, False),
     (3.85, True, True)],
)  # fmt: skip
def test_a_contact_near_lost_samples_counts_for_neither_foot(at_s: float, own: bool, opposite: bool) -> None:
    """Where a hole of 0.1 s begins or ends, a contact may be off or none: of a stride 2.0 to 3.0 and of one
    of the other foot, 2.5 to 3.5."""
    lost = np.zeros(3000, np.bool_)
    lost[round(at_s * RATE) : round(at_s * RATE) + 10] = True
    found = stride_list(straight(), standing(lost=lost)).strides
    (right,) = (s for s in found if s.side == "right" and s.start_s == 2.0)
    (left,) = (s for s in found if s.side == "left" and s.start_s == 2.5)
    assert (right.excluded_reason is None) == own
    assert left.excluded_reason is None
    assert left.opposite_ic_s == (3.0 if opposite else None)
    assert left.opposite_tc_s == (pytest.approx(2.6) if opposite else None)


def test_lost_samples_in_the_signal_exclude_it_end_to_end() -> None:
    lost = np.ones(1830, np.bool_)
    lost[700:720] = False
    take = walk(valid={"foot_r": lost})
    found = stride_list(detect(take), take)
    (gap,) = (s for s in found.strides if s.excluded_reason == "gap")
    assert gap.side == "right"
    assert gap.start_s < 7.0 < 7.2 < gap.end_s


def test_turning_strides_are_found_by_the_foots_heading() -> None:
    t = np.arange(3000) / RATE
    heading = np.clip((t - 4.0) * np.pi / 2, 0.0, np.pi) + 3.0
    found = stride_list(straight(), standing(heading=heading))
    assert reasons(found) == ["first", None, None, "turn", "turn", None, None, "last"]
    turned = [s.turn_rad for s in found.strides if s.side == "right" and s.turn_rad is not None]
    assert turned[3:5] == pytest.approx([np.pi / 2, np.pi / 2], abs=0.02)
    back = np.clip((t - 4.0) * -np.pi / 2, -np.pi, 0.0)
    assert stride_list(straight(), standing(heading=back)).strides[6].turn_rad == pytest.approx(
        -np.pi / 2, abs=0.02
    )


def test_the_pelvis_turning_mask_is_used_too() -> None:
    turning = np.zeros(3000, np.bool_)
    turning[400:460] = True
    assert reasons(stride_list(straight(), standing(), turning))[3] == "turn"
    turning[:] = False
    turning[400:410] = True
    assert reasons(stride_list(straight(), standing(), turning))[3] is None


def test_a_foot_of_which_nothing_counts_is_named() -> None:
    t = np.arange(3000) / RATE
    found = stride_list(straight(), standing(heading=t * 0.9))
    assert {n.code for n in found.notices} == {"no_strides"}
    assert any(n.message.startswith("All 8 left strides are excluded: 8 turn.") for n in found.notices)


@pytest.mark.parametrize("contacts", [[], [1.0]])
def test_too_few_contacts_give_an_empty_list(contacts: list[float]) -> None:
    assert stride_list(hand_made(contacts, []), standing()).strides == ()


def test_events_at_the_ends_of_the_recording_do_no_harm() -> None:
    events = hand_made([0.0, 1.0, 2.0, 3.0, 29.99], [0.5])
    assert len(stride_list(events, standing()).strides) == 4


@given(
    gaps=st.lists(st.floats(0.16, 4.0), min_size=2, max_size=40),
    seed=st.integers(0, 100),
)
@settings(max_examples=80, deadline=None)
def test_strides_never_overlap_and_their_events_keep_order(gaps: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.cumsum(gaps)
    order = ("ic", "tc")
    events = tuple(
        GaitEvent(float(t), rng.choice(["left", "right"]), order[int(rng.integers(2))], "manual", float(t))  # type: ignore[arg-type]
        for t in times
    )
    take = standing(float(times[-1]) + 1.0)
    listed = stride_list(GaitEvents(events), take).strides
    for side in FOOT:
        own = [s for s in listed if s.side == side]
        assert all(a.end_s <= b.start_s for a, b in pairwise(own))
    for s in listed:
        assert s.start_s < s.end_s
        assert s.tc_s is None or s.start_s < s.tc_s < s.end_s
        assert s.opposite_ic_s is None or s.start_s < s.opposite_ic_s < s.end_s
        if s.opposite_tc_s is not None:
            assert s.start_s < s.opposite_tc_s < (s.opposite_ic_s or s.end_s)
        if s.excluded_reason is None:
            assert s.tc_s is not None
            assert StrideParams().min_s <= s.duration_s <= StrideParams().max_s


def test_heading_is_measured_at_the_contacts_even_when_the_foot_is_steep() -> None:
    take = standing()
    q = orientation(np.full(3000, np.radians(-60.0)), 0.4)
    steep = replace(take, q={"foot_r": q, "foot_l": q})
    assert stride_list(straight(), steep).strides[0].turn_rad == pytest.approx(0.0, abs=1e-9)


def test_strides_next_to_a_turn_are_set_aside_when_enough_are_left() -> None:
    heading = np.clip((np.arange(3000) / RATE - 6.0) * np.pi / 2, 0.0, np.pi)
    listed = [s for s in stride_list(straight(14), standing(heading=heading)).strides if s.side == "right"]
    assert [s.excluded_reason for s in listed[3:9]] == [None, "near_turn", "turn", "turn", "near_turn", None]
    assert {s.excluded_by for s in listed[4:8]} == {"rule"}


def test_strides_next_to_a_turn_count_in_a_short_walk_and_the_turn_and_the_edges_do_not() -> None:
    heading = np.clip((np.arange(3000) / RATE - 4.0) * np.pi / 2, 0.0, np.pi)
    found = stride_list(straight(), standing(heading=heading))
    listed = [s for s in found.strides if s.side == "right"]
    assert "near_turn" in listed[2].flags
    assert listed[2].excluded_reason is None
    assert [s.excluded_reason for s in listed if "turn" in s.flags] == ["turn", "turn"]
    assert (listed[0].excluded_reason, listed[-1].excluded_reason) == ("first", "last")
    (said,) = (n.message for n in found.notices if n.code == "short_walk")
    assert "next to a turn" in said


def test_a_stride_with_a_stop_in_it_is_an_outlier() -> None:
    contacts = [1.0 + i + (1.2 if i > 5 else 0.0) for i in range(12)]
    assert reasons(stride_list(hand_made(contacts, []), standing()))[5] == "outlier"
    uneven = list(np.cumsum([1.0, 1.2, 0.9, 1.1, 1.2, 0.9, 1.05, 0.95, 1.15, 1.0]))
    assert "outlier" not in reasons(stride_list(hand_made(uneven, []), standing()))


def test_a_single_cycle_by_itself_is_no_walking() -> None:
    contacts = [1.0 + i for i in range(8)] + [20.0, 21.0]
    alone = [s for s in stride_list(hand_made(contacts, []), standing()).strides if s.side == "right"][-1]
    assert alone.flags == ("first", "last", "non_periodic")


def test_a_cycle_in_which_the_foot_leaves_twice_missed_a_contact() -> None:
    events = straight()
    missed = GaitEvents(tuple(e for e in events.events if (e.side, e.kind, e.time_s) != ("right", "ic", 5.0)))
    one_foot = GaitEvents(tuple(e for e in missed.events if e.side == "right"))
    assert reasons(stride_list(one_foot, standing()))[3] == "incomplete"


def test_a_person_is_told_from_a_rule_and_the_flags_stay() -> None:
    first = stride_list(straight(), standing()).strides[0]
    assert (first.excluded_by, first.flags) == ("rule", ("first",))
    taken_in = replace(first, excluded_reason=None)
    assert (taken_in.excluded_by, taken_in.flags) == (None, ("first",))
    assert replace(first, excluded_reason="manual:stumbled").excluded_by == "person"


@pytest.mark.parametrize(
    ("uncertainties", "median"),
    [((0.02, 0.02, 0.1), 0.02), ((None, 0.06, None), 0.06), ((None,), None), ((), None)],
)
def test_what_contacts_are_known_to_is_the_median_of_the_machines_own(
    uncertainties: tuple[float | None, ...], median: float | None
) -> None:
    found = [
        GaitEvent(float(i), "left", "ic", "any", float(i), uncertainty_s=u)
        for i, u in enumerate(uncertainties)
    ]
    by_hand = GaitEvent(9.0, "left", "ic", MANUAL, 9.0, uncertainty_s=0.5)
    assert GaitEvents((*found, by_hand)).contact_uncertainty_s == median
