"""Refined times of contact and foot-off from pitch and impacts of a foot, compiled
(docs/science/events.md, "Refinement"); foot_contact.py explains them, foot_contact_kernel.py applies
them to a recording or a stream.
"""

from __future__ import annotations

from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from sagittal.core.signals.inner import inner_njit

STOP_SHARE: Final = 0.2
"""Where there is neither slap nor acceleration, a foot lands where its pitch rate falls under this share of
its fastest (our choice). No take is without acceleration, so it is no parameter."""


class ContactRule(NamedTuple):
    """`FootContactParams` at a sample rate; integers are samples."""

    rate_hz: float
    contact_share: float
    leaving_share: float
    least_rad_s: float
    push_s: float
    lead_s: float
    lag_s: float
    still_rad_s: float
    swing_rad_s: float
    step_m: float
    hump_rad: float
    dip_rad: float
    contact_sd_s: float
    leaving_sd_s: float
    flat_sd_s: float
    late_sd_s: float
    loose_sd_s: float
    leaving: int
    after: int
    quiet: int
    apart: int
    swing: int
    longest: int
    onset: int
    pause: int
    least: int


@inner_njit()
def rate_at(pitch, j, rate_hz):  # type: ignore[no-untyped-def]
    """Pitch rate between samples j and j + 1, rad/s."""
    size = pitch.shape[0]
    return (pitch[(j + 1) % size] - pitch[j % size]) * rate_hz


@inner_njit()
def knock_at(acc, j, apart):  # type: ignore[no-untyped-def]
    """Change of the acceleration over the `apart` samples before j, m/s²."""
    size = acc.shape[0]
    a, b = acc[(j - apart) % size], acc[j % size]
    return sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)


@inner_njit()
def deepest(pitch, rate_hz, first, last):  # type: ignore[no-untyped-def]
    """Sample j and value of the minimum pitch rate between samples first and last + 1."""
    place, least = first, rate_at(pitch, first, rate_hz)
    for j in range(first + 1, last + 1):
        r = rate_at(pitch, j, rate_hz)
        if r < least:
            place, least = j, r
    return place, least


@inner_njit()
def highest(pitch, first, last):  # type: ignore[no-untyped-def]
    """Sample of the maximum pitch among first … last."""
    size = pitch.shape[0]
    place = first
    for j in range(first, last + 1):
        if pitch[j % size] > pitch[place % size]:
            place = j
    return place


@inner_njit()
def lowest(pitch, first, last):  # type: ignore[no-untyped-def]
    """Sample of the minimum pitch among first … last."""
    size = pitch.shape[0]
    place = first
    for j in range(first, last + 1):
        if pitch[j % size] < pitch[place % size]:
            place = j
    return place


@inner_njit()
def refine_landing(pitch, acc, top, first, last, moves, rate_hz, rule):  # type: ignore[no-untyped-def]
    """Sample and uncertainty (s) of a contact with its maximum pitch at `top`, from samples first … last.

    NaN if neither pitch nor acceleration shows it.
    """
    if last - top >= 2:
        place, slap = deepest(pitch, rate_hz, top, last - 1)
        if slap <= -rule.least_rad_s:
            level, start = rule.contact_share * slap, max(first, top - 2)
            j = place
            while j >= start and rate_at(pitch, j, rate_hz) < level:
                j -= 1
            if j >= start:
                current_rate, next_rate = rate_at(pitch, j, rate_hz), rate_at(pitch, j + 1, rate_hz)
                sample = j + 0.5 + (level - current_rate) / (next_rate - current_rate)
                start += rule.apart
                if not moves or start > place:
                    return sample, rule.contact_sd_s
                hardest = 0.0
                for j in range(start, place + 2):
                    hardest = max(hardest, knock_at(acc, j, rule.apart))
                j = start
                while knock_at(acc, j, rule.apart) < rule.contact_share * hardest:
                    j += 1
                half = 0.5 * (j - 0.5 * rule.apart - sample)
                return sample + half, sqrt(rule.contact_sd_s**2 + (half / rate_hz) ** 2)
    # no slap: the foot came down flat or on its tip
    peak, place = 0.0, first
    for j in range(first, min(top, last - 1) + 1):
        r = rate_at(pitch, j, rate_hz)
        if r > peak:
            peak, place = r, j
    size = pitch.shape[0]
    if moves:
        half = 0.5 * (pitch[lowest(pitch, first, top) % size] + pitch[top % size])
        place = max(place, first + rule.apart)
        while place < top and pitch[place % size] < half:
            place += 1
        hardest = place
        for j in range(place, last + 1):
            if knock_at(acc, j, rule.apart) > knock_at(acc, hardest, rule.apart):
                hardest = j
        return hardest - 0.5 * rule.apart, rule.flat_sd_s
    if peak < rule.least_rad_s:
        return np.nan, rule.late_sd_s
    level = STOP_SHARE * peak
    j = min(top, last - 1)
    while j > first and rate_at(pitch, j, rate_hz) < level:
        j -= 1
    if j >= last - 1:
        return np.nan, rule.late_sd_s
    current_rate, next_rate = rate_at(pitch, j, rate_hz), rate_at(pitch, j + 1, rate_hz)
    return j + 0.5 + (level - current_rate) / min(next_rate - current_rate, -1e-9), rule.flat_sd_s


@inner_njit()
def refine_leaving(pitch, bottom, first, rate_hz, rule):  # type: ignore[no-untyped-def]
    """Sample and uncertainty (s) of a foot-off with its minimum pitch at `bottom`, from samples first …

    NaN if the pitch rate shows no push-off, or one that ended long before.
    """
    first = max(first, bottom - rule.leaving)
    if bottom - first < 2:
        return np.nan, rule.late_sd_s
    place, push = deepest(pitch, rate_hz, first, bottom - 1)
    if push > -rule.least_rad_s:
        return np.nan, rule.late_sd_s
    level = rule.leaving_share * push
    j = place
    while j < bottom and rate_at(pitch, j, rate_hz) < level:
        j += 1
    previous_rate, current_rate = rate_at(pitch, j - 1, rate_hz), rate_at(pitch, j, rate_hz)
    if current_rate <= previous_rate:
        return np.nan, rule.late_sd_s
    sample = j - 0.5 + (level - previous_rate) / (current_rate - previous_rate)
    width = (bottom - sample) / rate_hz
    if width > rule.push_s:
        return np.nan, rule.late_sd_s
    return sample, sqrt(rule.leaving_sd_s**2 + 0.25 * width * width)


@inner_njit()
def guess_leaving(pitch, start, middle, reach, rule):  # type: ignore[no-untyped-def]
    """Sample of the minimum pitch, foot-off and its uncertainty (s) for a movement from `start` on."""
    size = pitch.shape[0]
    bottom = lowest(pitch, start, middle)
    sample, sd = np.nan, 0.0
    if bottom < middle - 1 and pitch[start % size] - pitch[bottom % size] >= rule.dip_rad:
        sample, sd = refine_leaving(pitch, bottom, reach, rule.rate_hz, rule)
    if sample != sample:
        # the foot left the floor without a push
        bottom = min(start + rule.onset, middle)
        sample, sd = float(bottom), 2.0 * rule.loose_sd_s
    return bottom, sample, max(sd, rule.loose_sd_s)
