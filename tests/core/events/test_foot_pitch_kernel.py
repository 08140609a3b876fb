"""The loop of the foot-pitch rule as it is written: when an extremum counts, and when it is known."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.events import foot_pitch_kernel
from sagittal.core.events.foot_pitch import FootPitchParams, FootPitchState, advance_foot_pitch
from sagittal.core.frames import Bools, Floats
from tests.core.events.foot_signal import extremes, foot_pitch
from tests.helpers.uncompiled import run_uncompiled

RATE = 100.0
WINDOW = 15
FALL = FootPitchParams().fall


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    run_uncompiled(monkeypatch, foot_pitch_kernel)


def signal(cycles: int = 2, scale: float = 1.0) -> Floats:
    t = np.arange(round((3.0 + cycles * 1.1) * RATE)) / RATE
    return np.asarray(np.sin(foot_pitch(t, 1.0, cycles, 1.1, scale)))


def run(s: Floats, valid: Bools | None = None) -> list[tuple[int, int, int, float]]:
    """Kind, sample, sample at which it is known, offset."""
    state = FootPitchState.start(RATE, FootPitchParams())
    found = advance_foot_pitch(state, s, np.ones(len(s), np.bool_) if valid is None else valid)
    return list(zip(*(x.tolist() for x in found), strict=True))


def test_a_foot_leaves_at_its_lowest_pitch_and_lands_at_its_highest() -> None:
    found = run(signal())
    assert [kind for kind, *_ in found] == [0, 1, 0, 1]
    tc, ic = extremes(1.0, 2, 1.1)
    moments = [(index + offset) / RATE for _, index, _, offset in found]
    assert moments == pytest.approx([tc[0], ic[0], tc[1], ic[1]], abs=3e-3)
    assert all(abs(offset) <= 0.5 for *_, offset in found)


def test_a_minimum_is_known_with_the_next_sample_and_a_maximum_once_the_foot_comes_down() -> None:
    s = signal(1)
    (_, off, off_known, _), (_, on, on_known, _) = run(s)
    assert off_known == off + 1
    fallen = s[on] - min(FALL, 0.5 * s[on])
    assert s[on_known] <= fallen < s[on_known - 1]
    assert on_known > on


def test_a_plateau_of_the_swing_is_no_landing() -> None:
    s = signal(1)
    (_, _, _, _), (_, on, on_known, _) = run(s)
    again = s.copy()
    # it falls by less than the rule's least, and rises higher than before
    again[on + 1 : on + 4] = s[on] - 0.4 * FALL
    again[on + 4 : on + 8] = s[on] + FALL * np.array([0.5, 2.0, 0.9, -1.0])
    again[on + 8 :] = s[on + 1 : -7]
    (_, later, known, _) = run(again)[1]
    assert later == on + 5
    assert known == on + 6
    assert on_known < known


def test_a_dip_above_the_threshold_is_no_foot_off() -> None:
    s = signal(1)
    deep = -float(s.min())
    assert [kind for kind, *_ in run(s * 0.21 / deep)][:1] == [0]
    assert run(s * 0.19 / deep) == []


def test_an_extremum_must_be_the_most_of_its_window_and_be_led_to() -> None:
    s = np.zeros(120)
    s[40:70] = -np.linspace(0.0, 0.25, 30)
    s[70:] = -0.22
    assert [(kind, index) for kind, index, *_ in run(s)] == [(0, 69)]
    rough = s.copy()
    rough[[55, 58, 61]] += 0.015
    assert [(kind, index) for kind, index, *_ in run(rough)] == [(0, 69)], (
        "twelve of fifteen steps lead there"
    )
    rougher = s.copy()
    rougher[[55, 57, 59, 61]] += 0.015
    assert run(rougher) == []
    lower = s.copy()
    lower[60] = -0.3
    assert run(lower) == []


def test_across_a_gap_nothing_is_concluded() -> None:
    s = signal(2)
    whole = run(s)
    valid = np.ones(len(s), np.bool_)
    valid[(whole[0][1] + whole[1][1]) // 2] = False
    assert [(kind, index) for kind, index, *_ in run(s, valid)] == [
        (k, i) for k, i, *_ in (whole[0], *whole[2:])
    ]
    late = np.ones(len(s), np.bool_)
    late[whole[1][2]] = False
    assert len(run(s, late)) == 3, "a maximum that was held is forgotten"


def test_events_of_one_kind_are_a_window_apart() -> None:
    state = FootPitchState.start(RATE, FootPitchParams())
    s = signal(1)
    off = run(s)[0]
    state.counters[3] = off[1] + 1 - WINDOW
    found = advance_foot_pitch(state, s, np.ones(len(s), np.bool_))[0].tolist()
    assert found == [], "the last foot-off was told too short a time ago"
