"""The foot-pitch rule: block law, times of the extremes, rates, cadences, gaps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.events.foot_pitch import FootPitchParams, FootPitchState, advance_foot_pitch
from sagittal.core.frames import Floats
from tests.core.events.foot_signal import extremes, foot_pitch

RATE = 100.0


def signal(rate_hz: float, stride_s: float = 1.1, cycles: int = 15, scale: float = 1.0) -> Floats:
    t = np.arange(round((4.0 + cycles * stride_s) * rate_hz)) / rate_hz
    return np.asarray(np.sin(foot_pitch(t, 2.0, cycles, stride_s, scale)))


def run(s: Floats, rate_hz: float, cuts: list[int] | None = None) -> tuple[Floats, Floats]:
    """Times of TC and IC; `cuts` splits the run into blocks."""
    state = FootPitchState.start(rate_hz, FootPitchParams())
    parts = [advance_foot_pitch(state, b, np.ones(len(b), np.bool_)) for b in np.split(s, cuts or [])]
    kind, index, offset = (np.concatenate([p[i] for p in parts]) for i in (0, 1, 3))
    times = (index + offset) / rate_hz
    return times[kind == 0], times[kind == 1]


@pytest.mark.parametrize("rate_hz", [40.0, 60.0, 100.0, 128.0, 204.8, 512.0])
def test_events_are_the_extremes_of_the_pitch_at_every_rate(rate_hz: float) -> None:
    tc, ic = run(signal(rate_hz), rate_hz)
    true_tc, true_ic = extremes(2.0, 15, 1.1)
    assert len(tc) == len(ic) == 15
    assert np.abs(tc - true_tc).max() < 0.25 / rate_hz + 1e-3
    assert np.abs(ic - true_ic).max() < 0.25 / rate_hz + 1e-3


@pytest.mark.parametrize("stride_s", [0.55, 1.1, 2.2, 3.3])
def test_double_cadence_at_60_hz_and_slow_walking_lose_nothing(stride_s: float) -> None:
    tc, ic = run(signal(60.0, stride_s, 30), 60.0)
    assert len(tc) == len(ic) == 30


def test_noise_on_the_pitch_adds_and_loses_nothing() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.01, len(signal(RATE)))
    tc, ic = run(signal(RATE) + noise, RATE)
    assert len(tc) == len(ic) == 15


@given(cuts=st.lists(st.integers(0, 2050), max_size=20), seed=st.integers(0, 5))
@settings(max_examples=60, deadline=None)
def test_any_split_into_blocks_gives_the_same_bits(cuts: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = signal(RATE) + rng.normal(0.0, 0.02, len(signal(RATE)))
    valid = rng.random(len(s)) > 0.002
    whole, split = (FootPitchState.start(RATE, FootPitchParams()) for _ in range(2))
    one = advance_foot_pitch(whole, s, valid)
    places = sorted(cuts)
    parts = [
        advance_foot_pitch(split, a, b)
        for a, b in zip(np.split(s, places), np.split(valid, places), strict=True)
    ]
    for i in range(4):
        assert np.array_equal(one[i], np.concatenate([p[i] for p in parts]))
    assert np.array_equal(whole.ring, split.ring)
    assert np.array_equal(whole.counters, split.counters)
    assert np.array_equal(whole.held, split.held)


@given(seed=st.integers(0, 1000), roughness=st.floats(0.0, 0.3))
@settings(max_examples=60, deadline=None)
def test_contacts_alternate_and_start_with_the_foot_leaving(seed: int, roughness: float) -> None:
    rng = np.random.default_rng(seed)
    s = signal(RATE, rng.uniform(0.5, 2.0), 8) * rng.uniform(0.3, 1.0)
    s = s + np.cumsum(rng.normal(0.0, roughness / 20, len(s)))
    kind, index, known, offset = advance_foot_pitch(
        FootPitchState.start(RATE, FootPitchParams()), s, np.ones(len(s), np.bool_)
    )
    assert np.array_equal(kind, np.arange(len(kind)) % 2)
    assert np.all(np.diff(index) > 0)
    assert np.all(known > index)
    assert np.all(np.abs(offset) <= 0.5)


def test_a_stream_knows_the_event_when_it_says_so_and_soon() -> None:
    s = signal(RATE)
    kind, index, known, _ = advance_foot_pitch(
        FootPitchState.start(RATE, FootPitchParams()), s, np.ones(len(s), np.bool_)
    )
    assert np.all(known[kind == 0] == index[kind == 0] + 1)
    assert np.all(known[kind == 1] <= index[kind == 1] + 4)
    for j, at in zip(index[:6], known[:6], strict=True):
        state = FootPitchState.start(RATE, FootPitchParams())
        before = advance_foot_pitch(state, s[:at], np.ones(at, np.bool_))[1]
        after = advance_foot_pitch(state, s[at : at + 1], np.ones(1, np.bool_))[1]
        assert j not in before
        assert after.tolist() == [j]


@pytest.mark.parametrize("dip", [0.0005, 0.004, 0.009])
def test_a_plateau_of_the_swing_is_not_a_landing(dip: float) -> None:
    s = signal(RATE)
    true_ic = extremes(2.0, 15, 1.1)[1]
    t = np.arange(len(s)) / RATE
    for contact in true_ic:
        # the toes are up, rest for 30 ms before the heel lands, and rise again
        early = (t > contact - 0.06) & (t <= contact - 0.03)
        assert s[early][0] > 0.1
        s[early] = s[early][0] - dip * (t[early] - t[early][0]) / 0.02
    tc, ic = run(s, RATE)
    assert len(tc) == len(ic) == 15
    assert np.abs(ic - true_ic).max() < 0.01


def test_nothing_is_concluded_across_lost_samples() -> None:
    s = signal(RATE)
    true_tc, true_ic = extremes(2.0, 15, 1.1)
    lost = slice(round((true_tc[5] + 0.05) * RATE), round((true_tc[5] + 0.20) * RATE))
    valid = np.ones(len(s), np.bool_)
    valid[lost] = False
    garbage = s.copy()
    garbage[lost] = np.nan
    kind, index, _, _ = advance_foot_pitch(FootPitchState.start(RATE, FootPitchParams()), garbage, valid)
    ic = index[kind == 1] / RATE
    assert not np.any(np.abs(ic - true_ic[5]) < 0.1), "the phase of the foot is unknown after a gap"
    assert len(ic) == 14
    assert np.sum(kind == 0) == 15
