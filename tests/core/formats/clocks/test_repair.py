"""Clocks with known faults come back as the true axis, each fault with its cause."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.formats.clocks import RepairedClock, repair_clock
from tests.core.formats.clocks.damaged_clocks import FAULTS, PAIRS, DamagedClock, damage, make_clock

KINDS = [(name,) for name in FAULTS] + PAIRS
SEEDS = 8


def repair(clock: DamagedClock, seed: int = 0) -> RepairedClock:
    signals = np.random.default_rng(seed).normal(size=(clock.sample.max() + 1, 6))[clock.sample]
    return repair_clock(clock.stamps, [signals], seconds=clock.seconds, wrap=clock.wrap, tick=clock.tick)


def judge(clock: DamagedClock, allowed: float) -> bool:
    """Whether every sample is there once and within so many samples of its true time."""
    found = repair(clock)
    if clock.restart or clock.constant:
        return (found.restart is not None) == clock.restart and (found.constant is not None) == clock.constant
    assert found.restart is None
    assert found.constant is None
    assert (np.diff(found.ticks) > 0).all()
    rows = np.arange(clock.rows) if found.rows is None else found.rows
    samples = clock.sample[rows]
    error = found.ticks / clock.step - samples
    right = np.abs(error - np.median(error)) <= allowed
    once = len(np.unique(samples)) == len(samples) >= 0.98 * len(np.unique(clock.sample))
    return bool(right.all()) and once


@pytest.mark.parametrize("names", KINDS, ids="+".join)
def test_a_damaged_clock_is_put_right(names: tuple[str, ...]) -> None:
    clocks = [damage(names, seed) for seed in range(SEEDS)]
    right = [judge(c, c.packet if "lose" in names else 1.0) for c in clocks]
    assert sum(right) >= SEEDS - 1, f"wrong for seeds {[i for i, r in enumerate(right) if not r]}"


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_the_cause_is_named_and_no_other(name: str) -> None:
    for seed in range(100, 104):
        clock = damage((name,), seed)
        codes = {r.code for r in repair(clock).repairs}
        assert clock.causes <= codes
        assert codes <= clock.causes | {"counter_blind"}


def test_a_clean_clock_comes_back_to_the_bit() -> None:
    clock = make_clock(np.random.default_rng(1))
    found = repair(clock)
    assert found.rows is None
    assert found.ticks is clock.stamps
    assert not found.repairs


def test_jitter_of_a_phone_and_losses_are_no_fault() -> None:
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.004, 0.016, 3000))
    t[1500:] += 2.5
    found = repair_clock(t, [rng.normal(size=(3000, 3))], seconds=True)
    assert found.rows is None
    assert not found.repairs


def test_a_clock_that_was_set_back_is_joined_and_said() -> None:
    t = np.arange(4000.0) * 0.01 + 50.0
    t[2000:] -= 1.3
    found = repair_clock(t, [np.random.default_rng(0).normal(size=(4000, 3))], seconds=True)
    assert [r.code for r in found.repairs] == ["clock_set_back"]
    assert found.repairs[0].severity == "warning"
    np.testing.assert_allclose(np.diff(found.ticks), 0.01, atol=1e-6)


def test_a_narrow_counter_says_that_it_cannot_see_long_losses() -> None:
    counts = np.mod(np.delete(np.arange(3000), np.arange(1000, 1300)), 256).astype(float)
    found = repair_clock(counts, [np.zeros((len(counts), 3))], seconds=False, wrap=256.0)
    assert [(r.code, r.severity) for r in found.repairs] == [("counter_blind", "warning")]
