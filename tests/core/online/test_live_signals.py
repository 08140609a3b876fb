"""The parts before the chain: bridging, stillness, angles, contacts in a stream are those of the whole
take."""

from __future__ import annotations

import numpy as np
import pytest

from core.body import BodyModel
from core.body.erkf.gaps import Bridge, bridge_gaps
from core.body.l7s.legs import M_LEG, LegModel, solve_legs
from core.body.still import AT_REST, FOOT_STILL, still_samples
from core.body.tree import PRESETS, person_tree
from core.frames import GRAVITY, Bools, Floats
from core.online.drift import HeadingHold
from core.online.sparse import FIGURE, HIP_SIGN
from core.online.sparse_kernel import in_sy_frames, legs
from core.online.still import Stillness
from core.rotation import about, from_matrix, to_matrix, yaw

SEGMENTS = PRESETS["lower_body7"]
RATE = 100.0
TREE = person_tree(BodyModel.from_height(1.7), {s: np.eye(3) for s in SEGMENTS}, SEGMENTS)


def moving(n: int = 900, seed: int = 3) -> tuple[Floats, Floats]:
    """Signals of seven sensors that stand for a second and then swing."""
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
    live = Bridge(TREE, np.zeros((7, 3)), np.zeros((7, 3)), RATE).push(acc, gyr, valid)
    stored = bridge_gaps(TREE, acc, gyr, valid, RATE)
    for ours, theirs in zip(live, stored, strict=True):
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("seed", range(3))
def test_blocks_of_any_size_give_the_same_bits(seed: int) -> None:
    acc, gyr = moving(seed=seed)
    valid, noise = holes(len(acc)), np.full((7, 3), 0.01)
    whole, pieces = (Bridge(TREE, noise, noise, RATE) for _ in range(2))
    still, parts = Stillness(7, RATE), Stillness(7, RATE)
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
    f, w = Bridge(TREE, np.zeros((7, 3)), np.zeros((7, 3)), RATE).push(acc, gyr, valid)
    assert np.isfinite(f).all()
    assert np.isfinite(w).all()


def test_live_stillness_trails_and_never_looks_ahead() -> None:
    """Behind the offline rule by less than its window, and no later at the end of a rest than 40 ms."""
    n = 600
    acc = np.tile([0.0, GRAVITY, 0.0], (n, 1, 1))
    gyr = np.zeros((n, 1, 3))
    gyr[:100], gyr[300:500] = 3.0, 3.0
    valid = np.ones((n, 1), bool)
    stands, rests = Stillness(1, RATE).push(acc, gyr, valid)[:, 0].T
    assert np.flatnonzero(stands)[0] == 102
    assert not stands[300:500].any()
    assert stands[102:300].all()
    assert np.flatnonzero(rests)[0] == 129
    for rule, live in ((FOOT_STILL, stands), (AT_REST, rests)):
        stored = still_samples(acc[:, 0], gyr[:, 0], valid[:, 0], RATE, rule)
        assert not (stored & ~live)[130:].any() or rule is AT_REST
        assert abs(int(stored.sum()) - int(live.sum())) < 2 * rule.window_s * RATE + 1


def test_compiled_legs_are_those_of_the_leg_model() -> None:
    model = LegModel.of(BodyModel.from_height(1.7))
    rng = np.random.default_rng(4)
    small = rng.normal(scale=0.3, size=(300, 3, 4)) + np.array([1.0, 0.0, 0.0, 0.0])
    R = to_matrix(small / np.linalg.norm(small, axis=2, keepdims=True))
    p = np.array([[0.0, 0.0, 0.9], [0.0, 0.1, 0.1], [0.0, -0.1, 0.1]]) + rng.normal(0.0, 0.05, (300, 3, 3))
    stored = solve_legs(R, p, model)
    q, at = np.empty((300, 7, 4)), np.empty((300, 7, 3))
    to_foot = np.array(model.to_isb("foot_l"))
    legs(R, p, model.hip_width, model.thigh, model.shank, model.foot, HIP_SIGN, M_LEG.copy(), to_foot, q, at)
    np.testing.assert_allclose(q[:, 0], from_matrix(R[:, 0] @ M_LEG), atol=1e-12)
    for i, segment in enumerate(FIGURE[1:], 1):
        np.testing.assert_allclose(q[:, i], stored.q[segment], atol=1e-12)
        np.testing.assert_allclose(at[:, i], stored.p[segment], atol=1e-12)
    again = np.empty((300, 3, 3))
    in_sy_frames(q[:, 3].copy(), to_foot.T.copy(), again)
    np.testing.assert_allclose(again, R[:, 1], atol=1e-12)


def drifting(n: int, seed: int) -> tuple[Floats, Floats]:
    """Pelvis and two feet that swing, turn about every 20 s and drift apart by 6° and −4° a minute."""
    t = np.arange(n) / RATE
    way = np.pi * np.floor((t + 2.0) / 20.0) * np.clip(((t + 2.0) % 20.0) / 2.0, 0.0, 1.0)
    rng = np.random.default_rng(seed)
    course = np.stack((
        way + np.radians(5.0) * np.sin(2 * np.pi * t),
        way + np.radians(8.0) + np.radians(4.0) * np.sin(2 * np.pi * t + 1.0) + np.radians(6.0) * t / 60.0,
        way - np.radians(8.0) + np.radians(4.0) * np.sin(2 * np.pi * t + 4.0) - np.radians(4.0) * t / 60.0,
    ), axis=1)  # fmt: skip
    return about(2, course + 0.01 * rng.standard_normal(course.shape)), np.full((n, 3, 3), 1.0)


def test_headings_are_held_over_five_minutes_and_turns_are_not_taken_for_drift() -> None:
    n = 30_000
    q, gyr = drifting(n, 0)
    valid = np.ones((n, 3), bool)
    valid[15_000:15_200, 1] = False
    held = q.copy()
    HeadingHold(("pelvis", "foot_l", "foot_r"), RATE).push(held, gyr, valid)
    np.testing.assert_array_equal(held[:, 0], q[:, 0])

    def apart(x: Floats, i: int, at: slice) -> float:
        return float(np.degrees(np.angle(np.mean(np.exp(1j * (yaw(x[at, i]) - yaw(x[at, 0])))))))

    first, last = slice(200, 1600), slice(n - 1600, n - 200)
    for i, rate in ((1, 6.0), (2, -4.0)):
        assert abs(apart(q, i, last) - apart(q, i, first)) > 3.5 * abs(rate)
        assert abs(apart(held, i, last) - apart(held, i, first)) < 3.0
    again = q.copy()
    hold = HeadingHold(("pelvis", "foot_l", "foot_r"), RATE)
    for k in in_blocks(n, 5):
        hold.push(again[k], gyr[k], valid[k])
    np.testing.assert_array_equal(again, held)


def test_a_segment_alone_has_nothing_to_be_held_to() -> None:
    q, gyr = drifting(1000, 1)
    one = np.ascontiguousarray(q[:, 1:2])
    HeadingHold(("foot_l",), RATE).push(one, gyr[:, :1], np.ones((1000, 1), bool))
    np.testing.assert_array_equal(one[:, 0], q[:, 1])
