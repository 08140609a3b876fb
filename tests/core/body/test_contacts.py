"""Contact masks from event times."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.body import contact_mask

T = np.arange(0.0, 10.0, 0.01)


def down_at(mask: np.ndarray, *times: float) -> list[bool]:
    return [bool(mask[round(t * 100)]) for t in times]


def test_a_foot_stands_from_initial_to_terminal_contact() -> None:
    mask = contact_mask(T, ic_s=(2.0, 4.0), tc_s=(1.5, 3.0))
    assert down_at(mask, 0.5, 1.49, 1.7, 2.0, 2.99, 3.5, 4.1, 9.9) == [
        True, True, False, True, True, False, True, True,
    ]  # fmt: skip


def test_a_take_that_begins_in_swing_begins_in_the_air() -> None:
    assert down_at(contact_mask(T, ic_s=(1.0,), tc_s=(2.0,)), 0.5, 1.5, 5.0) == [False, True, False]


def test_a_missed_initial_contact_ends_the_swing_half_way() -> None:
    assert down_at(contact_mask(T, ic_s=(), tc_s=(2.0, 4.0)), 1.0, 2.5, 3.5, 5.0) == [
        True,
        False,
        True,
        False,
    ]


def test_no_events_means_standing() -> None:
    assert contact_mask(T, (), ()).all()


@given(st.lists(st.floats(0.05, 9.9), max_size=8, unique=True).map(sorted))
def test_alternating_events_make_alternating_contact(times: list[float]) -> None:
    mask = contact_mask(T, ic_s=times[1::2], tc_s=times[::2])
    for k, t in enumerate(times):
        end = times[k + 1] if k + 1 < len(times) else 10.0
        inside = (t <= T) & (end > T)
        assert (mask[inside] == (k % 2 == 1)).all()
