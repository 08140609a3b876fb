"""Fading shows exactly its share, evenly spread, and probe blocks come when they were announced."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.feedback import Schedule
from sagittal.core.feedback.schedule import find_slot

shares = st.lists(st.integers(0, 100), min_size=1, max_size=5).map(lambda s: tuple(sorted(s, reverse=True)))
schedules = st.builds(
    Schedule,
    kind=st.sampled_from(("every", "fading")),
    shares_pct=shares,
    strides_per_share=st.integers(1, 80),
    probe_every=st.one_of(st.none(), st.integers(1, 60)),
    probe_strides=st.integers(1, 30),
)


@pytest.mark.slow
@given(schedule=schedules)
def test_of_any_part_of_a_step_the_share_is_shown_to_less_than_a_stride(schedule: Schedule) -> None:
    training = [p for i in range(400) if (p := find_slot(schedule, i)).block is None]
    steps = len(schedule.shares_pct)
    for step in range(steps if schedule.kind == "fading" else 1):
        first = step * schedule.strides_per_share
        last = None if step == steps - 1 or schedule.kind == "every" else first + schedule.strides_per_share
        own = training[first:last]
        shown = 0
        for k, p in enumerate(own, 1):
            shown += p.shown
            assert abs(shown - Fraction(k * p.share_pct, 100)) < 1, "evenly spread"
            assert p.share_pct == (100 if schedule.kind == "every" else schedule.shares_pct[step])


@given(schedule=schedules)
def test_probe_blocks_have_their_length_and_distance_and_no_feedback(schedule: Schedule) -> None:
    places = [find_slot(schedule, i) for i in range(300)]
    if schedule.probe_every is None:
        assert all(p.block is None and p.next_probe is None for p in places)
        return
    whole = schedule.probe_every + schedule.probe_strides
    for i, p in enumerate(places):
        cycle, position = divmod(i, whole)
        if position < schedule.probe_every:
            assert (p.block, p.block_left, p.next_probe) == (None, None, schedule.probe_every - position)
        else:
            assert (p.block, p.shown, p.next_probe) == (cycle + 1, False, None)
            assert p.block_left == whole - position


def test_half_is_every_second_stride() -> None:
    schedule = Schedule(shares_pct=(50,), probe_every=None)
    assert [find_slot(schedule, i).shown for i in range(6)] == [False, True, False, True, False, True]


def test_the_last_step_stays() -> None:
    schedule = Schedule(shares_pct=(100, 0), strides_per_share=3, probe_every=None)
    assert [find_slot(schedule, i).shown for i in (2, 3, 1000)] == [True, False, False]
