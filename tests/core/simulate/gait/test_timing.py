"""When things happen in each leg's cycle, on steps that are all alike."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Side
from sagittal.core.simulate.gait.timing import (
    RELEASE_PHASE,
    STANDING_PHASE,
    amplitude,
    body_phase,
    foot_timing,
    gait_phase,
    size_window,
)
from sagittal.core.simulate.script import Footprint, Plan, Script, Stand, Straight, plan
from sagittal.core.simulate.walker import STEADY, SideGait, Walker

STEP_S, RATE = 0.5, 100.0
WALKER = Walker(variability=STEADY)


def planned(*script: Stand | Straight) -> Plan:
    whole: Script = script
    return plan(whole, WALKER, np.random.default_rng(0))


def straight(steps: int) -> Straight:
    return Straight(steps * WALKER.reference_step_m, WALKER.reference_step_m, STEP_S)


WALK = planned(Stand(2.0), straight(8), Stand(2.0))
STOP = planned(Stand(2.0), straight(4), Stand(3.0), straight(4), Stand(2.0))
T = np.arange(round(WALK.duration_s * RATE) + 1) / RATE


def of_side(steps: tuple[Footprint, ...], side: Side) -> list[Footprint]:
    return [s for s in steps if s.side == side]


def test_one_swing_is_in_order_and_as_long_as_the_gait_says() -> None:
    gait = SideGait()
    for side in SIDES:
        x = foot_timing(WALK, WALKER, side)
        steps = of_side(WALK.steps, side)
        assert x.contact == pytest.approx([s.time_s for s in steps])
        assert x.opposite == pytest.approx([s.start_s for s in steps])
        # the first stride begins at -inf
        middle = slice(1, None)
        assert x.release[middle] - x.opposite[middle] == pytest.approx(gait.double_support * 2 * STEP_S)
        assert x.release[middle] - x.heel_off[middle] == pytest.approx(
            (RELEASE_PHASE - gait.heel_off) * 2 * STEP_S
        )
        assert x.flat - x.contact == pytest.approx(gait.flat_from * 2 * STEP_S)
        assert (x.heel_off < x.release).all()
        assert (x.flat[:-1] < x.heel_off[1:]).all()


def test_a_foot_lets_go_half_a_step_before_it_lands_at_the_latest() -> None:
    late = Walker(variability=STEADY, sides=dict.fromkeys(SIDES, SideGait(double_support=0.4)))
    x = foot_timing(WALK, late, "left")
    assert x.contact - x.release == pytest.approx(0.5 * STEP_S)
    # the heel waits for no one who shares the weight longer, and never rises before the foot is flat
    assert (x.heel_off[1:] >= x.flat[:-1]).all()


def test_who_limps_is_flat_before_the_heel_rises_again() -> None:
    """A long step onto a leg that is left again soon: flat for a hundredth of a second at least."""
    limps = Walker(
        variability=STEADY,
        sides={
            "left": SideGait(flat_from=0.29, time_factor=1.5),
            "right": SideGait(flat_from=0.29, time_factor=0.5),
        },
    )
    walk = plan((Stand(2.0), straight(8), Stand(2.0)), limps, np.random.default_rng(0))
    x = foot_timing(walk, limps, "left")
    assert x.heel_off[1:] - x.flat[:-1] == pytest.approx(0.01)
    assert x.flat[-1] - x.contact[-1] == pytest.approx(2 * 0.29 * 1.5 * STEP_S)


def test_standing_between_two_contacts_is_told_and_does_not_stretch_the_support() -> None:
    assert STOP.stands[1] == pytest.approx((4.5, 7.5))
    for side in SIDES:
        x = foot_timing(STOP, WALKER, side)
        initial = np.concatenate(([-np.inf], x.contact[:-1]))
        assert x.paused.tolist() == [
            any(b <= start < c for start, _ in STOP.stands) for b, c in zip(initial, x.contact, strict=True)
        ]
        assert x.paused.sum() == 2
        assert x.release - x.opposite == pytest.approx(SideGait().double_support * 2 * STEP_S)


def test_the_phase_is_whole_at_contacts_and_a_half_at_the_others() -> None:
    for side in SIDES:
        x = foot_timing(WALK, WALKER, side)
        phase = gait_phase(T, WALK, x, RATE)
        assert (np.diff(phase) >= -1e-12).all()
        n = np.arange(len(x.contact))
        assert np.interp(x.contact, T, phase) == pytest.approx(n + 1.0, abs=0.02)
        assert np.interp(x.opposite[1:], T, phase) == pytest.approx(n[1:] + 0.5, abs=0.01)
        assert np.interp(x.release[1:], T, phase) == pytest.approx(n[1:] + RELEASE_PHASE, abs=0.01)
        assert phase[0] == pytest.approx(STANDING_PHASE, abs=0.01)
        assert phase[-1] == pytest.approx(len(n) + STANDING_PHASE)


def test_the_phase_stays_in_mid_stance_while_somebody_stands() -> None:
    t = np.arange(round(STOP.duration_s * RATE) + 1) / RATE
    for side in SIDES:
        phase = gait_phase(t, STOP, foot_timing(STOP, WALKER, side), RATE)
        stands = phase[(t > 5.5) & (t < 6.9)]
        assert np.ptp(stands) < 1e-12
        assert stands[0] % 1.0 == pytest.approx(STANDING_PHASE)


def test_who_never_walks_has_no_swing() -> None:
    still = planned(Stand(1.0))
    x = foot_timing(still, WALKER, "left")
    assert len(x.contact) == len(x.flat) == len(x.paused) == 0
    t = np.arange(5) / RATE
    assert gait_phase(t, still, x, RATE).tolist() == [STANDING_PHASE] * 5
    assert body_phase(t, still, RATE) == pytest.approx(0.0)
    assert amplitude(t, still, WALKER, RATE) == pytest.approx(0.0)


def test_the_body_counts_right_contacts_whole_and_left_ones_half() -> None:
    phase = body_phase(T, WALK, RATE)
    for side, share in (("right", 0.0), ("left", 0.5)):
        times = [s.time_s for s in WALK.steps if s.side == side][1:-1]
        off = np.interp(times, T, phase) - share
        assert off == pytest.approx(np.rint(off), abs=0.01)
    assert np.diff(phase).min() >= -1e-12


def test_the_curves_are_full_while_walking_and_gone_while_standing() -> None:
    a = amplitude(T, WALK, WALKER, RATE)
    assert a[T < 1.7] == pytest.approx(0.0, abs=1e-12)
    assert a[(T > 2.8) & (T < 5.5)] == pytest.approx(1.0, abs=1e-9)
    assert a[WALK.steps[-1].time_s + 0.4 < T] == pytest.approx(0.0, abs=1e-12)
    assert a.max() <= 1.0 + 1e-12


@pytest.mark.parametrize(("share", "samples"), [(0.16, 17), (0.15, 15), (0.001, 3), (0.04, 5)])
def test_a_window_is_an_odd_share_of_a_stride(share: float, samples: int) -> None:
    assert size_window(WALK, RATE, share) == samples
