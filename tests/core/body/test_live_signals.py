"""Bridging and stillness in a stream are those of the whole take."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body import BodyModel
from sagittal.core.body.erkf.gaps import GapBridge, bridge_gaps
from sagittal.core.body.live_still import StillnessDetector
from sagittal.core.body.still import AT_REST, FOOT_STILL, still_samples
from sagittal.core.body.tree import PRESETS, person_tree
from sagittal.core.frames import GRAVITY, Bools, Floats

SEGMENTS = PRESETS["lower_body7"]
RATE = 100.0
TREE = person_tree(BodyModel.from_height(1.7), {s: np.eye(3) for s in SEGMENTS}, SEGMENTS)


def moving(n: int = 900, seed: int = 3) -> tuple[Floats, Floats]:
    """Signals of seven sensors: one second still, then swinging."""
    rng = np.random.default_rng(seed)
    t = np.arange(n)[:, None, None] / RATE
    phase = rng.uniform(0.0, 6.0, (1, 7, 3))
    size = np.clip(t - 1.0, 0.0, 1.0)
    acc = size * 3.0 * np.sin(6.0 * t + phase) + np.array([0.0, GRAVITY, 0.0])
    return acc, size * 2.0 * np.sin(5.0 * t + phase)


def holes(n: int) -> Bools:
    """A foot lost for 2 s, in it its shank, a thigh for 0.2 s, the pelvis for 1.5 s with the other thigh."""
    valid = np.ones((n, 7), bool)
    for i, start, stop in ((3, 300, 500), (2, 350, 460), (4, 200, 220), (0, 600, 750), (4, 640, 700)):
        valid[start:stop, i] = False
    return valid


def in_blocks(n: int, seed: int) -> list[slice]:
    edges = np.unique(np.random.default_rng(seed).integers(0, n, 60))
    return [slice(int(a), int(b)) for a, b in zip([0, *edges], [*edges, n], strict=True) if b > a]


def test_a_live_gap_is_bridged_as_a_stored_one() -> None:
    acc, gyr = moving()
    valid = holes(len(acc))
    live = GapBridge(TREE, np.zeros((7, 3)), np.zeros((7, 3)), RATE).push(acc, gyr, valid)
    stored = bridge_gaps(TREE, acc, gyr, valid, RATE)
    for ours, theirs in zip(live, stored, strict=True):
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("seed", range(3))
def test_blocks_of_any_size_give_the_same_bits(seed: int) -> None:
    acc, gyr = moving(seed=seed)
    valid, noise = holes(len(acc)), np.full((7, 3), 0.01)
    whole, pieces = (GapBridge(TREE, noise, noise, RATE) for _ in range(2))
    still, parts = StillnessDetector(7, RATE), StillnessDetector(7, RATE)
    a, w = whole.push(acc, gyr, valid)
    rests = still.push(a, w, valid)
    for k in in_blocks(len(acc), seed):
        b, v = pieces.push(acc[k], gyr[k], valid[k])
        assert np.array_equal(b, a[k])
        assert np.array_equal(v, w[k])
        assert np.array_equal(parts.push(b, v, valid[k]), rests[k])


def test_a_sensor_that_was_never_heard_stands_upright() -> None:
    acc, gyr = moving()
    valid = np.ones((len(acc), 7), bool)
    valid[:, 5] = False
    f, w = GapBridge(TREE, np.zeros((7, 3)), np.zeros((7, 3)), RATE).push(acc, gyr, valid)
    assert np.isfinite(f).all()
    assert np.isfinite(w).all()


def test_live_stillness_trails_and_never_looks_ahead() -> None:
    """Behind the offline rule by less than its window, and no later at the end of a rest than 40 ms."""
    n = 600
    acc = np.tile([0.0, GRAVITY, 0.0], (n, 1, 1))
    gyr = np.zeros((n, 1, 3))
    gyr[:100], gyr[300:500] = 3.0, 3.0
    valid = np.ones((n, 1), bool)
    stands, rests = StillnessDetector(1, RATE).push(acc, gyr, valid)[:, 0].T
    assert np.flatnonzero(stands)[0] == 102
    assert not stands[300:500].any()
    assert stands[102:300].all()
    assert np.flatnonzero(rests)[0] == 129
    for rule, live in ((FOOT_STILL, stands), (AT_REST, rests)):
        stored = still_samples(acc[:, 0], gyr[:, 0], valid[:, 0], RATE, rule)
        assert not (stored & ~live)[130:].any() or rule is AT_REST
        assert abs(int(stored.sum()) - int(live.sum())) < 2 * rule.window_s * RATE + 1
