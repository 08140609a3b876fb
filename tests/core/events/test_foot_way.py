"""Swings by their way, of feet that shuffle, are dragged or carried flat: as a file and as a stream."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.events.foot_contact import ContactReports
from sagittal.core.events.foot_way import FootWayParams, FootWayState, advance_foot_ways
from sagittal.core.frames import GRAVITY, SIDES, Floats, Side
from sagittal.core.rotation import conjugate, rotate
from tests.core.events.foot_signal import orientation
from tests.core.events.test_foot_contact import burst
from tests.helpers.event_scoring import match
from tests.helpers.walked_feet import WalkedFoot, walked_foot

RATE = 100.0
CLOSE_S = 0.25


def carried(ways: tuple[float, ...], turn: float = np.radians(25.0)) -> tuple[Floats, Floats]:
    """Orientations and force of a flat foot that goes each of these ways in 0.5 s, a second apart.

    It turns about the vertical by as much as it can without turning fast.
    """
    t = np.arange(round(RATE * (2.0 + len(ways)))) / RATE
    heading, force = np.zeros_like(t), np.tile([0.0, 0.0, GRAVITY], (len(t), 1))
    for n, way in enumerate(ways):
        heading += burst(t, 1.0 + n, 0.5, turn if n % 2 else -turn)
        x = np.clip((t - 1.0 - n) / 0.5, 0.0, 1.0)
        force[:, 0] += way * 8.0 * np.pi * np.sin(2.0 * np.pi * x) * ((x > 0.0) & (x < 1.0))
    q = orientation(np.zeros_like(t), heading)
    return q, rotate(conjugate(q), force)


def run(q: Floats, acc: Floats, block: int = 10_000, *, learned: bool = False) -> list[ContactReports]:
    state = FootWayState.start(RATE)
    if learned:
        state.learn(q, np.ones(len(q), np.bool_))
    return [
        advance_foot_ways(
            state, q[k : k + block], np.ones(len(q[k : k + block]), np.bool_), acc[k : k + block]
        )
        for k in range(0, len(q), block)
    ]


def times(told: list[ContactReports], kind: int) -> list[float]:
    return [float(at) / RATE for x in told for k, at in zip(x.kind, x.at, strict=True) if k == kind]


@pytest.mark.parametrize("block", [1, 17, 10_000])
def test_a_flat_foot_swings_by_the_way_it_goes(block: int) -> None:
    q, acc = carried((0.3, 0.25, 0.35, 0.3))
    told = run(q, acc, block)
    off, on = times(told, 0), times(told, 1)
    assert off == pytest.approx([1.05, 2.05, 3.05, 4.05], abs=0.05)
    assert on == pytest.approx([1.45, 2.45, 3.45, 4.45], abs=0.06)
    assert np.concatenate([x.number for x in told]).tolist() == list(range(8))
    assert [x.tolist() for x in run(q, acc)[0]] == [
        np.concatenate([getattr(x, name) for x in told]).tolist() for name in ContactReports._fields
    ]


def test_what_leads_nowhere_is_no_swing() -> None:
    q, acc = carried((0.3, 0.3, 0.03, 0.3, 0.03))
    assert len(times(run(q, acc), 1)) == 3


def test_a_step_is_small_by_the_person_s_own_way() -> None:
    long = run(*carried((1.0, 1.0, 1.0, 0.1, 1.0)))
    short = run(*carried((0.3, 0.3, 0.3, 0.1, 0.3)))
    assert (len(times(long, 1)), len(times(short, 1))) == (4, 5)


def test_a_lost_sensor_ends_the_swing_it_was_lost_in() -> None:
    q, acc = carried((0.3, 0.3, 0.3))
    valid = np.ones(len(q), np.bool_)
    valid[220:230] = False
    told = advance_foot_ways(FootWayState.start(RATE), q, valid, acc)
    assert [round(x / RATE) for x in told.at[told.kind == 1]] == [1, 3]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "side"),
    [("shuffler", "left"), ("severe_shuffle", "right"), ("dragged_foot", "left"), ("locked_knee", "left"),
     ("trembling", "right"), ("frame", "left"), ("comfortable", "left")],
)  # fmt: skip
def test_every_swing_of_people_who_hardly_lift_their_feet(name: str, side: Side) -> None:
    foot = walked_foot(name, side, 6)
    for learned in (True, False):
        told = run(foot.q, foot.acc, learned=learned)
        on = match(times(told, 1), foot.contacts.tolist(), CLOSE_S)
        # a stream knows the person's level after the first strides
        assert on.missed <= (0 if learned else 2)
        assert len(on.extra) == 0
        assert abs(on.mean_ms) <= 30.0
        assert times(told, 0) == sorted(times(told, 0))
        assert all(a < b for a, b in pairwise(sorted((*times(told, 0), *times(told, 1)))))


def test_the_own_level_is_that_of_the_person() -> None:
    levels: dict[str, float] = {}
    for name in ("shuffler", "trembling"):
        foot: WalkedFoot = walked_foot(name, SIDES[0], 6)
        state = FootWayState.start(RATE)
        state.learn(foot.q, foot.valid)
        levels[name] = state.level_rad_s
    params = FootWayParams()
    assert params.floor_rad_s <= levels["shuffler"] < levels["trembling"] <= params.ceiling_rad_s
