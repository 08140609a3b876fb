"""The digest by which a copy of a sensor's stream is found under another id."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.formats.draft import has_whole_row, signal_digest
from sagittal.core.signals.held_samples import AT_A_TIME


@settings(max_examples=60, deadline=None)
@given(rows=st.integers(1, 200) | st.just(AT_A_TIME + 5), seed=st.integers(0, 2**31), bit=st.integers(0, 31))
def test_no_bit_of_a_sample_changes_without_the_digest(rows: int, seed: int, bit: int) -> None:
    rng = np.random.default_rng(seed)
    acc: Any = rng.normal(0, 10, (rows, 3)).astype(np.float32)
    other = acc.copy()
    other.view(np.uint32)[rng.integers(rows), rng.integers(3)] ^= np.uint32(1 << bit)
    assert signal_digest(acc, None, None) != signal_digest(other, None, None)


def test_the_digest_tells_signals_lengths_and_the_order_of_samples_apart() -> None:
    acc = np.random.default_rng(0).normal(0, 10, (100, 3))
    still = np.zeros((100, 3))
    others = [
        signal_digest(acc[::-1], None, None),
        signal_digest(acc[:, ::-1], None, None),
        signal_digest(acc, still, None),
        signal_digest(acc, None, still),
        signal_digest(still, None, None),
        signal_digest(still[:99], None, None),
    ]
    assert len({signal_digest(acc, None, None), *others}) == 7


@pytest.mark.parametrize("rows", [512, 4096, AT_A_TIME, 2 * AT_A_TIME])
def test_a_take_turned_round_and_the_other_leg_half_a_cycle_later_are_no_copies(rows: int) -> None:
    acc = np.random.default_rng(0).normal(0, 10, (rows, 3))
    parts = [rows // 2, rows // 4, rows // 16]
    assert len({signal_digest(np.roll(acc, part, axis=0), None, None) for part in (0, *parts)}) == 4
    for cycles in (2, 4, 8):
        turn = np.sign(np.sin(2.0 * np.pi * cycles * (np.arange(rows) + 0.5) / rows))
        for axis in range(3):
            legs = np.zeros((2, rows, 3))
            legs[:, :, axis] = turn, -turn
            assert len({signal_digest(leg, None, None) for leg in legs}) == 2


@pytest.mark.parametrize("rows", [1, 100, AT_A_TIME + 1])
def test_the_same_samples_have_one_digest_however_they_are_held(rows: int) -> None:
    acc: Any = np.random.default_rng(0).normal(0, 10, (rows, 3)).astype(np.float32)
    acc[0, 0], acc[-1, 1] = 0.0, np.nan
    same = acc.copy()
    same[0, 0] = -0.0
    same.view(np.uint32)[-1, 1] = 0xFFC00001  # another NaN
    digest = signal_digest(acc, None, None)
    assert signal_digest(same, None, None) == digest
    assert signal_digest(np.asfortranarray(acc.astype(np.float64)), None, None) == digest


def test_one_sample_that_is_whole_is_found_wherever_it_is() -> None:
    signal = np.full((10_000, 3), np.nan)
    assert not has_whole_row(signal)
    assert not has_whole_row(signal[:0])
    signal[:, 1:] = 0.0
    assert not has_whole_row(signal)
    signal[9_999, 0] = 1.0
    assert has_whole_row(signal)
