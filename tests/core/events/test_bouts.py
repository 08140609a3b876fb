"""Walking bouts from hand-made contacts: where they begin and end, what breaks and stops inside them."""

from __future__ import annotations

import pytest

from sagittal.core.events.bouts import find_bouts, walking_bouts
from sagittal.core.events.result import GaitEvent, GaitEvents


def steps(start: float, n: int, step: float = 0.5) -> list[float]:
    return [start + i * step for i in range(n)]


def test_contacts_without_a_break_are_one_bout() -> None:
    (bout,) = walking_bouts(steps(2.0, 10))
    assert (bout.first_s, bout.end_s, bout.contacts, bout.step_s) == (2.0, 6.5, 10, 0.5)
    assert bout.breaks == ()


def test_a_break_of_more_than_three_seconds_divides_two_bouts() -> None:
    assert len(walking_bouts(steps(0.0, 8) + steps(6.6, 8))) == 2
    (one,) = walking_bouts(steps(0.0, 8) + steps(6.4, 8))
    assert one.breaks == ((3.5, 6.4),)


def test_a_break_is_a_stop_only_where_the_person_stands() -> None:
    contacts = steps(0.0, 8) + steps(5.5, 8)
    (missed,) = walking_bouts(contacts)
    assert (missed.breaks, missed.stops) == (((3.5, 5.5),), ())
    (stood,) = walking_bouts(contacts, standing=[(3.8, 4.5), (20.0, 30.0)])
    assert stood.stops == stood.breaks
    (briefly,) = walking_bouts(contacts, standing=[(3.0, 3.9)])
    assert briefly.stops == ()


def test_one_foot_stands_in_every_stride() -> None:
    contacts = [*steps(0.0, 5, 1.0), *steps(7.0, 5, 1.0)]
    assert walking_bouts(contacts, feet=1, standing=[(4.2, 5.0)])[0].stops == ()
    assert walking_bouts(contacts, feet=1, standing=[(4.2, 6.0)])[0].stops == ((4.0, 7.0),)


def test_fewer_than_four_strides_are_no_walking() -> None:
    assert walking_bouts(steps(0.0, 5)) == ()
    assert len(walking_bouts(steps(0.0, 6))) == 1


def test_one_foot_needs_half_as_many_strides() -> None:
    assert len(walking_bouts(steps(0.0, 3, 1.0), feet=1)) == 1
    assert walking_bouts(steps(0.0, 2, 1.0), feet=1) == ()


def test_slow_regular_walking_has_no_breaks() -> None:
    (bout,) = walking_bouts(steps(0.0, 10, 1.2))
    assert bout.breaks == ()


def test_a_limp_has_no_breaks() -> None:
    contacts = [x for i in range(8) for x in (1.4 * i, 1.4 * i + 0.85)]
    (bout,) = walking_bouts(contacts)
    assert bout.breaks == ()


def test_a_bout_starts_when_the_first_foot_leaves_and_knows_of_rest() -> None:
    events = [
        GaitEvent(t, "right" if i % 2 else "left", "ic", "manual", t) for i, t in enumerate(steps(5.0, 10))
    ]
    events += [GaitEvent(t, "left", "tc", "manual", t) for t in (4.6, 5.6)]
    (bout,) = find_bouts(GaitEvents(tuple(events)), rests=((0.0, 4.0), (12.5, 20.0)))
    assert bout.start_s == 4.6
    assert bout.initiation_s == pytest.approx(0.4)
    assert (bout.from_rest, bout.to_rest) == (True, False)


def test_the_foot_that_left_in_the_walk_before_starts_no_new_one() -> None:
    contacts = steps(0.0, 8) + steps(7.0, 8)
    first, second = walking_bouts(contacts, leavings=[3.4])
    assert first.start_s == 0.0
    assert second.start_s == 7.0
    assert second.initiation_s is None


def test_no_contacts_are_no_bouts() -> None:
    assert walking_bouts([]) == ()
    assert find_bouts(GaitEvents(())) == ()
