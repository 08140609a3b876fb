"""Ten metres and six minutes: walks of known lengths and times."""

from __future__ import annotations

import pytest

from sagittal.core.events.bouts import Bout
from sagittal.core.events.result import GaitEvents, Stride, Strides
from sagittal.core.events.turns import Turn
from sagittal.core.frames import SIDES
from sagittal.core.functional_tests.result import FunctionalTest
from sagittal.core.functional_tests.walks import measure_six_minutes, measure_ten_metres
from sagittal.core.parameters.measure import MeasuredGait
from sagittal.core.signals.recording import GivenLimits


def walk(
    seconds: float,
    lengths: tuple[float, float] = (1.2, 1.2),
    turns: tuple[Turn, ...] = (),
    stride_s: float = 1.0,
) -> MeasuredGait:
    """Strides of a second from 5 s on; the first half has one length, the second the other."""
    stride_s = 1.0
    strides, column = [], []
    for i in range(round(seconds / stride_s)):
        for k, side in enumerate(SIDES):
            start = 5.0 + (i + 0.5 * k) * stride_s
            strides.append(Stride(side, start, start + 0.6, start + stride_s, None, None, 0.0, None))
            column.append(lengths[0] if start - 5.0 < 0.5 * seconds else lengths[1])
    end = 5.0 + seconds
    bout = Bout(5.0, 5.0, end, 2 * round(seconds / stride_s), 0.5 * stride_s)
    return MeasuredGait(
        GaitEvents(()), Strides(tuple(strides)), (), {"stride_length_m": tuple(column)}, (bout,), turns
    )


def means(test: FunctionalTest) -> dict[str, float | None]:
    return {p.name: p.mean for p in test.parameters}


def reasons(test: FunctionalTest) -> set[str | None]:
    return {p.reason for p in test.parameters}


def test_the_middle_metres_are_timed() -> None:
    ten_metres = measure_ten_metres(walk(12.0))
    got = means(ten_metres)
    assert got["walk_10m_speed_mps"] == pytest.approx(1.2, rel=0.03)
    assert got["walk_10m_distance_m"] == pytest.approx(10.0, abs=0.7)
    assert [s.name for s in ten_metres.segments] == ["speeding_up", "timed_metres", "slowing_down"]
    assert ten_metres.segments[0].duration_s == pytest.approx(2.0 / 1.2, abs=0.6)


def test_a_turn_ends_the_lane() -> None:
    turn = Turn(15.0, 17.0, 3.1, 2.0)
    ten_metres = measure_ten_metres(walk(24.0, turns=(turn,)))
    assert (ten_metres.start_s, ten_metres.end_s) == (17.0, 29.0)
    got = means(ten_metres)
    assert got["walk_10m_speed_mps"] == pytest.approx(1.2, rel=0.03)


def test_a_short_walk_and_one_without_lengths_say_why() -> None:
    assert reasons(measure_ten_metres(walk(4.0))) == {"walk_too_short"}
    bare = walk(12.0)
    unknown = MeasuredGait(bare.events, bare.strides, (), {}, bare.bouts)
    assert reasons(measure_ten_metres(unknown)) == {"no_foot_track"}
    assert reasons(measure_ten_metres(MeasuredGait(bare.events, Strides(()), (), {}))) == {"no_bouts"}


def test_six_minutes_with_slowing() -> None:
    six_minutes = measure_six_minutes(walk(370.0, (1.2, 0.9)))
    got = means(six_minutes)
    assert got["walk_6min_distance_m"] == pytest.approx(185.0 * 1.2 + 175.0 * 0.9, rel=0.01)
    assert got["walk_6min_first_mps"] == pytest.approx(1.2, rel=0.02)
    assert got["walk_6min_last_mps"] == pytest.approx(0.9, rel=0.02)
    assert got["walk_6min_slowing_pct"] == pytest.approx(25.0, abs=2.0)
    assert got["walk_6min_standing_s"] == pytest.approx(0.0, abs=0.1)
    assert len(six_minutes.segments) == 6


def test_five_minutes_are_too_short_unless_a_person_says_so() -> None:
    assert reasons(measure_six_minutes(walk(300.0))) == {"walk_too_short"}
    six_minutes = measure_six_minutes(walk(300.0), GivenLimits(5.0, 300.0))
    assert six_minutes.corrected
    assert means(six_minutes)["walk_6min_distance_m"] == pytest.approx(295.0 * 1.2, rel=0.02)
