"""One day of frames: signed inclination, clipping to the day, baseline of a neighbour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.activity.day_part import DayPart, read_day
from sagittal.core.activity.frames import PER_MINUTE, Frames, Slab
from sagittal.core.activity.params import ActivityParams
from sagittal.core.activity.result import WearPeriod
from sagittal.core.events.turns import Turn
from sagittal.core.frames import GRAVITY
from tests.core.activity.frames_of_day import make_frames

LEAN_DEG = 30.0
TOPS_S = (20.0, 40.0, 60.0)


def leaning(*, first: int = 0, still: bool = True) -> Frames:
    """Two minutes of standing with three short bows."""
    frames = make_frames(2 * PER_MINUTE, first)
    if still:
        frames.spread[:100] = 0.0
    t = np.arange(len(frames.valid)) / 10
    angle = np.zeros(len(t))
    for top in TOPS_S:
        near = np.abs(t - top) < 2.0
        angle[near] = np.radians(LEAN_DEG) * np.cos(0.25 * np.pi * (t[near] - top)) ** 2
    frames.gravity[:, 0], frames.gravity[:, 2] = -GRAVITY * np.sin(angle), GRAVITY * np.cos(angle)
    return frames


def read(frames: Frames, until_s: float = 120.0, before: WearPeriod | None = None) -> DayPart:
    turns = (Turn(10.0, 12.0, 1.5, 2.0), Turn(100.0, 102.0, 1.5, 2.0))
    offset = frames.first / 10
    return read_day(Slab(frames, (), turns), (offset, offset + until_s), before, 0.42, ActivityParams())


def test_leans_of_a_moment_give_the_inclination_its_sign() -> None:
    part = read(leaning())
    (period,) = part.periods
    assert (period.start_s, period.end_s, period.method, period.leans) == (0.0, 120.0, "first_rest", 3)
    assert period.up == pytest.approx((0.0, 0.0, 1.0))
    assert period.forward == pytest.approx((1.0, 0.0, 0.0))
    assert len(part.inclination_deg) == 120
    assert part.inclination_deg[[5, 30, 90]] == pytest.approx(0.0, abs=1e-3)
    assert part.inclination_deg[[20, 40, 60]] == pytest.approx(LEAN_DEG, abs=5.0)
    assert part.lying == part.tilted == part.gaps == part.off == part.no_baseline == ()


def test_a_day_holds_only_what_lies_in_it() -> None:
    frames = leaning()
    frames.valid[700:900] = False
    part = read(frames, 80.0)
    assert part.gaps == ((70.0, 80.0),)
    assert [(p.start_s, p.end_s) for p in part.periods] == [(0.0, 80.0)]
    assert [t.start_s for t in part.turns] == [10.0]
    assert len(part.inclination_deg) == 80
    assert np.isnan(part.inclination_deg[71:]).all()
    assert np.isfinite(part.inclination_deg[:70]).all()


def test_what_lies_around_a_day_has_its_own_time() -> None:
    part = read(leaning(first=6000))
    assert [(p.start_s, p.end_s) for p in part.periods] == [(600.0, 720.0)]
    assert part.inclination_deg[20] == pytest.approx(LEAN_DEG, abs=5.0)


def test_without_walking_or_rest_upright_is_lent_or_not_known() -> None:
    restless = leaning(still=False)
    single_content = read(restless)
    assert single_content.periods[0].method == "none"
    assert single_content.no_baseline == ((0.0, 120.0),)
    assert np.isnan(single_content.inclination_deg).all()
    initial_variant = replace(read(leaning()).periods[0], up=(0.0, 0.0, 1.0))
    lent = read(restless, before=initial_variant)
    assert lent.periods[0].method == "neighbour"
    assert lent.no_baseline == ()
    assert lent.inclination_deg[20] == pytest.approx(LEAN_DEG, abs=5.0)


def test_somebody_who_lies_still_lies_and_who_hangs_over_is_tilted() -> None:
    frames = make_frames(2 * PER_MINUTE)
    frames.spread[:] = 0.0
    frames.spread[600:] = 4.0
    frames.gravity[400:600] = frames.gravity[800:1000] = (0.0, GRAVITY, 0.0)
    part = read(frames)
    assert part.lying == ((40.0, 60.0),)
    assert part.tilted == ((80.0, 100.0),)
