"""Event times in each leg's cycle, and the gait phase at which the target curves are read."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sagittal.core.frames import Bools, Floats, Side
from sagittal.core.simulate.script import Plan
from sagittal.core.simulate.shapes import smooth
from sagittal.core.simulate.walker import SideGait, Walker

RELEASE_PHASE = 0.59
"""Phase at which the foot leaves the floor; WBDS foot-off, 0.62, is about when the sole is 5 mm up."""

STANDING_PHASE = 0.3
"""The phase is held here while standing: mid-stance, both knees nearly straight."""


@dataclass(frozen=True, eq=False)
class FootTiming:
    """Times in s of swing i of one foot, from its footprint i to i + 1; arrays (swings,).

    Parameters
    ----------
    heel_off : heel rise. opposite : previous contact of the other foot, or the start of the first step.
        release : end of contact. contact : next initial contact. flat : start of the flat and still phase.
        paused : there is standing between the two contacts.
    """

    heel_off: Floats
    opposite: Floats
    release: Floats
    contact: Floats
    flat: Floats
    paused: Bools


def foot_timing(plan: Plan, walker: Walker, side: Side) -> FootTiming:
    """Times of one foot (docs/science/simulation.md, "Timing")."""
    gait = walker.sides[side]
    prints = plan.footprints[side]
    rows = []
    for previous, landing in pairwise(prints):
        step = landing.step_s
        stride = landing.time_s - previous.time_s
        paused = any(previous.time_s <= start < landing.time_s for start, _ in plan.stands)
        cycle = 2.0 * step if paused else stride
        opposite = landing.start_s
        release = min(opposite + gait.double_support * cycle, landing.time_s - 0.5 * step)
        # the heel rises for the other foot's contact, not for the own release: who shares the weight
        # longer lets go later, and a heel that waited for that would hold the ankle bent over a flat foot
        before_release = RELEASE_PHASE - gait.heel_off + (gait.double_support - SideGait.double_support)
        heel_off = max(
            release - before_release * cycle,
            previous.time_s + (gait.flat_from + 0.02) * cycle,
        )
        rows.append(
            (
                heel_off,
                opposite,
                release,
                landing.time_s,
                landing.time_s + 2.0 * gait.flat_from * step,
                paused,
            )
        )
    table = np.array(rows, np.float64).reshape(-1, 6)
    flat = table[:, 4].copy()
    flat[:-1] = np.minimum(flat[:-1], table[1:, 0] - 0.01)
    heel_off, opposite, release, contact = table[:, :4].T.copy()
    return FootTiming(heel_off, opposite, release, contact, flat, table[:, 5].astype(bool))


def size_window(plan: Plan, rate_hz: float, share: float) -> int:
    """Odd number of samples of a smoothing window of `share` of a typical stride."""
    return max(3, int(share * 2.0 * plan.typical_step_s * rate_hz) | 1)


def gait_phase(t: Floats, plan: Plan, timing: FootTiming, rate_hz: float) -> Floats:
    """Unwrapped phase (n,) of one leg: integers at its contacts.

    The other foot's contact is fixed at one half: without that, slow or uneven gaits land with 20–29° knee
    flexion instead of 4–9° (docs/science/simulation.md, "Timing").
    """
    if not len(timing.contact):
        return np.full(len(t), STANDING_PHASE)
    knots = [(0.0, STANDING_PHASE)]
    for i, contact in enumerate(timing.contact):
        step = contact - timing.opposite[i]
        if timing.paused[i]:
            if i:
                knots.append((timing.contact[i - 1] + 0.6 * step, i + STANDING_PHASE))
            knots.append(
                (timing.release[i] - (RELEASE_PHASE - STANDING_PHASE) * 2.0 * step, i + STANDING_PHASE)
            )
        knots += [(timing.opposite[i], i + 0.5), (timing.release[i], i + RELEASE_PHASE), (contact, i + 1.0)]
    knots.append((knots[-1][0] + 0.6 * plan.typical_step_s, knots[-1][1] + STANDING_PHASE))
    knots_s, value = np.array(sorted(knots)).T
    return smooth(np.interp(t, knots_s, value), size_window(plan, rate_hz, 0.025))


def body_phase(t: Floats, plan: Plan, rate_hz: float) -> Floats:
    """Unwrapped phase (n,) of the pelvis curves: integers at right contacts, half-integers at left ones."""
    phase = 0.5 if plan.steps and plan.steps[0].side == "right" else 0.0
    knots = [(0.0, phase)]
    for step in plan.steps:
        knots += [(step.start_s, phase), (step.time_s, phase + 0.5)]
        phase += 0.5
    knots_s, value = np.array(knots).T
    return smooth(np.interp(t, knots_s, value), size_window(plan, rate_hz, 0.04))


def amplitude(t: Floats, plan: Plan, walker: Walker, rate_hz: float) -> Floats:
    """Factor (n,) on the pelvis and stance curves: 0 in standing, about 1 at the reference step length."""
    knots = [(0.0, 0.0)]
    for step in plan.steps:
        a = walker.amplitude(step.step_m)
        if step.opens:
            knots += [(step.start_s - 0.15, 0.0), (step.start_s + 0.2 * step.step_s, a)]
        knots.append((step.time_s - 0.5 * step.step_s, a))
        if step.closes:
            knots += [(step.time_s - 0.2 * step.step_s, 0.6 * a), (step.time_s + 0.25, 0.0)]
    knots_s, value = np.array(sorted(knots)).T
    return smooth(np.interp(t, knots_s, value), size_window(plan, rate_hz, 0.05))
