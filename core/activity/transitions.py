"""Trunk leans and their classification as rising, sitting down or bowing; periods of lying
(docs/science/activity.md, "Transitions"; Nazarahari 2021, 7.2.4 and 7.2.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np

from sagittal.core.activity.frames import FRAME_HZ, Frames, Singles, measure_length
from sagittal.core.activity.params import TransitionParams
from sagittal.core.activity.result import (
    PosturalTransition,
    TransitionCandidate,
    TransitionKind,
    TransitionRefusal,
)
from sagittal.core.frames import GRAVITY, Bools, Floats
from sagittal.core.signals.peaks import find_peaks
from sagittal.core.signals.rest import find_runs

EDGE_RISE = 0.035
"""A lean ends where the inclination rises again by so much, rad: 2°, above the unrest of sitting."""

CALM_FRAMES = 2
"""Calm is judged over so many frames to both sides."""

JOIN_LYING_S = 60.0
JOIN_LYING_RAD = 0.7
"""Lying goes on through shorter stretches in which the trunk stays below the limit, but above this."""


HALF_WAY = 3 * FRAME_HZ
"""Lying begins and ends half way down and up, at most so many frames from the limit."""


@dataclass(frozen=True)
class Lying:
    """Lying between the midpoints of lying down (frame a) and getting up (frame b); `still` if it includes
    stillness.
    """

    a: int
    b: int
    still: bool


@dataclass(frozen=True)
class Lean:
    """A lean: first frame, frame of the largest inclination, last frame; largest inclination, rad."""

    a: int
    top: int
    b: int
    rad: float


def find_lying(tilt: Singles, frames: Frames, is_known: Bools, params: TransitionParams) -> list[Lying]:
    """Periods with an inclination above the lying limit.

    Parameters
    ----------
    tilt : (f,) inclination in any direction, rad. is_known : (f,) sensor worn and upright direction known.
    """
    joined: list[tuple[int, int]] = []
    for a, b in find_runs((tilt > params.lying_rad) & is_known):
        gap = slice(joined[-1][1], a) if joined else slice(0, 0)
        if (
            joined
            and a - joined[-1][1] < JOIN_LYING_S * FRAME_HZ
            and tilt[gap].min() > JOIN_LYING_RAD
            and is_known[gap].all()
        ):
            joined[-1] = (joined[-1][0], b)
        else:
            joined.append((a, b))
    calm = frames.spread < params.still**2
    length = round(params.still_s * FRAME_HZ)
    periods = []
    for a, b in joined:
        still = b - a >= params.shortest_lie_s * FRAME_HZ and any(
            y - x >= length for x, y in find_runs(calm[a:b])
        )
        if still:
            half = 0.5 * float(np.median(tilt[a:b]))
            a -= _count_above(
                tilt[max(0, a - HALF_WAY) : a][::-1], is_known[max(0, a - HALF_WAY) : a][::-1], half
            )
            b += _count_above(tilt[b : b + HALF_WAY], is_known[b : b + HALF_WAY], half)
        periods.append(Lying(a, b, still))
    return periods


def mark_near(lying: Sequence[Lying], close: int, n: int) -> Bools:
    """Frames (n,) in lying or within `close` frames of it."""
    mask = np.zeros(n, np.bool_)
    for x in lying:
        mask[max(0, x.a - close) : x.b + close + 1] = True
    return mask


def _count_above(tilt: Singles, is_known: Bools, limit: float) -> int:
    """Number of frames, from the first one, that stay above a limit."""
    over = (tilt > limit) & is_known
    return len(over) if over.all() else int(np.argmin(over))


def find_leans(theta: Singles, is_known: Bools, params: TransitionParams) -> list[Lean]:
    """Peaks of the inclination (f,) as candidate leans, each with the adjacent minima."""
    least = 0.5 * params.prominence_rad
    foot = max(0.0, params.candidate_rad - least)
    tops: list[int] = []
    # a peak stands out enough above all that lies at the foot: what lies beyond changes nothing
    for first, last in find_runs(is_known & (theta > foot)):
        part = slice(max(0, first - 1), last + 1)
        rising = np.where(is_known[part], theta[part], 0.0)
        peaks = find_peaks(rising, height=params.candidate_rad, prominence=least)
        tops += (part.start + peaks).tolist()
    reach = round(params.half_s * FRAME_HZ)
    return [
        Lean(
            top - _edge(theta[max(0, top - reach) : top + 1][::-1]),
            top,
            top + _edge(theta[top : top + reach + 1]),
            float(theta[top]),
        )
        for top in tops
    ]


def _edge(theta: Singles) -> int:
    """Distance from the peak, the first sample, to the minimum of the inclination (n,) before it rises
    again.
    """
    low = np.minimum.accumulate(theta)
    risen = np.flatnonzero(theta > low + EDGE_RISE)
    upto = int(risen[0]) if len(risen) else len(theta)
    return int(np.argmin(theta[:upto]))


def find_calm_ends(lean: Lean, frames: Frames, params: TransitionParams) -> tuple[int, int]:
    """Frames around a lean between which the chest moves up or down: the calmest ones near its two ends.

    When the trunk becomes upright again the body may still be stepping, or dropping onto the seat.
    """
    around, inside = round(params.calm_s * FRAME_HZ), round(params.calm_inside_s * FRAME_HZ)
    n = len(frames.spread)

    def calmest(a: int, b: int) -> int:
        a, b = max(CALM_FRAMES, a), min(n - CALM_FRAMES - 1, b)
        if b <= a:
            return int(np.clip(a, 0, n - 1))
        run = np.cumsum(frames.spread[a - CALM_FRAMES : b + CALM_FRAMES + 1], dtype=np.float64)
        width = 2 * CALM_FRAMES + 1
        means = run[width - 1 :] - np.concatenate(([0.0], run[:-width]))
        return a + int(np.argmin(means))

    return calmest(lean.a - around, lean.a + inside), calmest(lean.b - inside, lean.b + around)


def measure_rise(up: Floats) -> float:
    """Vertical displacement of the chest over a lean, m (thesis Eq. 56).

    Parameters
    ----------
    up : (n,) upward acceleration in frames; its mean is subtracted, which removes velocity drift because the
    chest is still at both ends.
    """
    a = up - up.mean()
    velocity = np.concatenate(([0.0], np.cumsum(a))) / FRAME_HZ
    return float(0.5 * (velocity[1:] + velocity[:-1]).sum() / FRAME_HZ)


def tell_direction(size: Floats) -> float:
    """Direction of a transition, positive = rising, negative = sitting down: the extreme of the running
    sum of the low-passed acceleration norm (n,) minus gravity, m/s (thesis Eq. 57 and 7.2.5).
    """
    a = size - GRAVITY
    running = np.cumsum(a - a.mean()) / FRAME_HZ
    return float(running[int(np.argmax(np.abs(running)))])


def judge_leans(
    leans: Sequence[Lean],
    theta: Singles,
    frames: Frames,
    lying: Sequence[Lying],
    walking: Bools,
    thigh_m: float,
    params: TransitionParams,
) -> tuple[list[PosturalTransition], list[TransitionCandidate]]:
    """Classify leans as rising or sitting down; of the others keep those worth reporting as candidates."""
    transitions: list[PosturalTransition] = []
    refused: list[TransitionCandidate] = []
    close = round(params.near_lying_s * FRAME_HZ)
    near_lying = mark_near(lying, close, len(frames.valid))
    for lean in leans:
        first, last = find_calm_ends(lean, frames, params)
        part = slice(first, last + 1)
        amidst = walking[lean.a] and walking[lean.b]
        if lean.b - lean.a < 3 or not frames.valid[part].all() or amidst:
            continue
        rise = measure_rise(frames.up[part].astype(np.float64))
        direction = tell_direction(measure_length(frames.gravity[part]))
        likely: TransitionKind = "sit_to_stand" if rise > 0.0 else "stand_to_sit"
        near = bool(near_lying[lean.top])
        prominent = lean.rad - max(theta[lean.a], theta[lean.b]) >= params.prominence_rad
        # from upright, or from how the person sat where that is further back
        far = lean.rad - min(0.0, theta[lean.a], theta[lean.b])
        large = far >= params.lean_rad and prominent
        rises = abs(rise) >= params.rise_share * thigh_m
        time, start, end = ((frames.first + i + 0.5) / FRAME_HZ for i in (lean.top, lean.a, lean.b))
        reason: TransitionRefusal | None
        if not rises:
            reason = "chest_did_not_rise"
        elif near:
            reason = "near_lying"
        elif direction * rise <= 0.0:
            reason = "direction_unclear"
        elif not large:
            reason = "lean_below_limit"
        else:
            reason = None
        if lean.rad >= params.lying_rad or (reason == "chest_did_not_rise" and not large):
            continue
        if reason is None:
            transitions.append(PosturalTransition(likely, time, start, end, degrees(far), rise))
        else:
            named = None if reason in ("chest_did_not_rise", "direction_unclear") else likely
            refused.append(TransitionCandidate(time, start, end, degrees(far), rise, reason, named))
    return transitions, refused


def tell_lying(lying: Sequence[Lying], frames: Frames, tilt: Singles) -> list[PosturalTransition]:
    """Lying down and getting up at the ends of a lying period, with the direction of the tilt."""
    transitions = []
    n = len(frames.valid)
    for x in lying:
        if not x.still:
            continue
        ends: tuple[tuple[TransitionKind, int], ...] = (("sit_to_lie", x.a), ("lie_to_sit", x.b))
        for kind, i in ends:
            measured = 0 < i < n and bool(frames.valid[max(0, i - 1) : i + 1].all())
            if measured:
                time = (frames.first + i) / FRAME_HZ
                most = float(tilt[x.a : x.b].max())
                transitions.append(PosturalTransition(kind, time, time, time, degrees(most), None))
    return transitions
