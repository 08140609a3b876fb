"""Compiled contact detection (docs/science/events.md, "Refinement"); explained in foot_contact.py."""

from __future__ import annotations

from math import asin, sqrt
from typing import Final

import numpy as np
from numba import njit

from sagittal.core.events.contact_moments_kernel import (
    ContactRule,
    deepest,
    guess_leaving,
    highest,
    lowest,
    refine_landing,
    refine_leaving,
)
from sagittal.core.events.foot_pitch_kernel import foot_pitch_kernel
from sagittal.core.signals.inner import inner_njit

# not plain numbers: for each of those all that takes it would be compiled once more
TC: Final = np.int64(0)
IC: Final = np.int64(1)
NO: Final = np.int64(0)
YES: Final = np.int64(1)
NONE: Final = -(1 << 40)

# places in `counters`
SEEN: Final = 0
MEASURED: Final = 1
RESTING: Final = 2
MOVING: Final = 3
START: Final = 4
TOLD: Final = 5
OPEN_TOP: Final = 6
OPEN_KNOWN: Final = 7
OPEN_NUMBER: Final = 8
NUMBER: Final = 9
BOTTOM: Final = 10
TOP: Final = 11
PITCHED: Final = 12
HELD: Final = 13
LEFT: Final = 14
LOOSE: Final = 15
UNTOLD: Final = 16
COUNTERS: Final = 17

# places in `sums`
FASTEST: Final = 0
SPEED: Final = 1
WAY: Final = 3
OFFSET: Final = 5
LEFT_AT: Final = 6
LOOSE_AT: Final = 7
SUMS: Final = 19

RHYTHM: Final = 3
"""So many swings without pitch, one after the other, are a gait. `LOOSE_AT` and the places after it have the
last of them, the oldest first, each as foot-off, its uncertainty, contact and its uncertainty."""
EVEN: Final = 1.5
"""The longer of two strides in a rhythm is at most so many times the shorter (our choice)."""
LEAST_SWING: Final = 0.2
"""A swing in a rhythm takes at least this share of the stride. Shorter ones are pieces of a swing that is
slower than the limit of rest, as in a severe shuffle (our choice; the paretic foot of stroke_treadmill swings
for 0.43)."""


@inner_njit()
def _read_rule(x):  # type: ignore[no-untyped-def]
    """The rule as an array (26,): passing a tuple would take longer than processing the block."""
    return ContactRule(
        x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13], x[14], x[15],
        x[16], int(x[17]), int(x[18]), int(x[19]), int(x[20]), int(x[21]), int(x[22]), int(x[23]), int(x[24]),
        int(x[25]),
    )  # fmt: skip


@inner_njit()
def _tell(found_int, found_float, total, kind, number, detection, last, sample, sd):  # type: ignore[no-untyped-def]
    """Write one report; returns the number of reports."""
    found_int[total, 0], found_int[total, 1] = kind, number
    found_int[total, 2], found_int[total, 3] = detection, last
    found_float[total, 0], found_float[total, 1] = sample, sd
    return total + 1


@inner_njit()
def _hold(counters, sums, k, off, off_sd, landing, landing_sd):  # type: ignore[no-untyped-def]
    """Store a swing without pitch that ended at sample k, replacing the oldest if there is no free slot."""
    if counters[LOOSE] == RHYTHM:
        counters[LOOSE] -= 1
        for j in range(LOOSE_AT, LOOSE_AT + 4 * counters[LOOSE]):
            sums[j] = sums[j + 4]
    place = LOOSE_AT + 4 * counters[LOOSE]
    sums[place], sums[place + 1], sums[place + 2], sums[place + 3] = off, off_sd, landing, landing_sd
    counters[LOOSE] += 1
    counters[UNTOLD] = min(counters[UNTOLD] + 1, counters[LOOSE])
    counters[HELD] = k


@inner_njit()
def _walks_on(counters, sums, rule):  # type: ignore[no-untyped-def]
    """Whether the last swings without pitch follow each other like strides."""
    if counters[LOOSE] < RHYTHM:
        return False
    first = sums[LOOSE_AT + 6] - sums[LOOSE_AT + 2]
    second = sums[LOOSE_AT + 10] - sums[LOOSE_AT + 6]
    shorter = min(first, second)
    for n in range(RHYTHM):
        if sums[LOOSE_AT + 4 * n + 2] - sums[LOOSE_AT + 4 * n] < LEAST_SWING * shorter:
            return False
    return max(first, second) <= min(float(rule.pause), EVEN * shorter)


@inner_njit()
def _tell_held(found_int, found_float, total, counters, sums, k, limit):  # type: ignore[no-untyped-def]
    """Report the unreported ones of the last `limit` swings without pitch; returns the number of reports."""
    for n in range(counters[LOOSE] - min(limit, counters[UNTOLD]), counters[LOOSE]):
        for kind, place in ((TC, LOOSE_AT + 4 * n), (IC, LOOSE_AT + 4 * n + 2)):
            sample, sd, number = sums[place], sums[place + 1], counters[NUMBER]
            total = _tell(found_int, found_float, total, kind, number, k, YES, sample, sd)
            counters[NUMBER] = number + 1
    counters[HELD], counters[UNTOLD] = NONE, NO
    return total


@inner_njit()
def _mend_leaving(found_int, found_float, total, pitch, counters, sums, k, reach, contact, rule):  # type: ignore[no-untyped-def]
    """Report the last foot-off again if the contact at `contact` is too close; returns the number of reports.

    No swing is that short: the lowest pitch was that of the landing, the foot left the floor when its
    movement began.
    """
    start, left = counters[START], sums[LEFT_AT]
    if contact - left >= rule.least or start < reach or start >= left:
        return total
    middle = start + (int(left) - start) // 2
    _, off, sd = guess_leaving(pitch, start, middle, reach, rule)
    return _tell(found_int, found_float, total, TC, counters[LEFT], k, YES, off, sd)


@inner_njit()
def _begin_movement(counters, sums, k, is_reported):  # type: ignore[no-untyped-def]
    """Start a movement of the foot at sample k."""
    counters[START], counters[TOP], counters[TOLD] = k, k, is_reported
    sums[:OFFSET] = 0.0


@inner_njit()
def _add_way(sums, q, acc, rate_hz):  # type: ignore[no-untyped-def]
    """Add one sample to the horizontal velocity and displacement of a movement; gravity has no horizontal
    component.
    """
    w, x, y, z = q
    ax, ay, az = acc
    a = (1.0 - 2.0 * (y * y + z * z)) * ax + 2.0 * (x * y - w * z) * ay + 2.0 * (x * z + w * y) * az
    b = 2.0 * (x * y + w * z) * ax + (1.0 - 2.0 * (x * x + z * z)) * ay + 2.0 * (y * z - w * x) * az
    sums[SPEED] += a / rate_hz
    sums[SPEED + 1] += b / rate_hz
    sums[WAY] += sums[SPEED] / rate_hz
    sums[WAY + 1] += sums[SPEED + 1] / rate_hz


@inner_njit()
def _leads_far(sums, samples, end, start, rate_hz, rule):  # type: ignore[no-untyped-def]
    """Whether a movement from rest to rest over `samples` is a swing: fast, long, and with displacement."""
    half = 0.5 * samples / rate_hz
    a, b = sums[WAY] - half * sums[SPEED], sums[WAY + 1] - half * sums[SPEED + 1]
    long = rule.swing <= end - start <= rule.longest
    return long and sums[FASTEST] >= rule.swing_rad_s and sqrt(a * a + b * b) >= rule.step_m


@inner_njit()
def _lands_between(pitch, counters, k, rate_hz, rule):  # type: ignore[no-untyped-def]
    """Whether the highest pitch of the movement, followed by a slap, was a landing."""
    start, top, size = counters[START], counters[TOP], pitch.shape[0]
    if k != top + rule.after or top - start < 2:
        return False
    rise = pitch[top % size] - pitch[lowest(pitch, start, top) % size]
    _, slap = deepest(pitch, rate_hz, top, k - 1)
    return rise >= rule.hump_rad and slap <= -2.0 * rule.least_rad_s


@inner_njit()
def _close_contact(  # type: ignore[no-untyped-def]
    found_int, found_float, total, pitch, acc, counters, sums, k, measured, reach, moves, rule
):  # fmt: skip
    """Report a contact whose window has ended, here or with the last `measured` sample; returns the number
    of reports.
    """
    top, first = counters[OPEN_TOP], max(reach, counters[BOTTOM])
    sample, sd = refine_landing(pitch, acc, top, first, measured, moves, rule.rate_hz, rule)
    if sample != sample:
        sample = top + sums[OFFSET] + rule.lead_s * rule.rate_hz
    if moves:
        total = _mend_leaving(found_int, found_float, total, pitch, counters, sums, k, reach, sample, rule)
    number = counters[OPEN_NUMBER]
    total = _tell(found_int, found_float, total, IC, number, k, YES, sample, sd)
    counters[OPEN_TOP] = -1
    # the foot is on the floor: what moves from here on is another movement
    _begin_movement(counters, sums, k, NO)
    return total


@inner_njit()
def _take_extreme(  # type: ignore[no-untyped-def]
    found_int, found_float, total, pitch, counters, sums, k, reach, kind, index, offset, rule
):  # fmt: skip
    """Report an event of the pitch rule: a foot-off finally, a contact provisionally until its window
    ends; returns the number of reports.
    """
    counters[TOLD], counters[PITCHED] = 1, k
    if counters[HELD] >= k - rule.pause:
        # the foot walks on: its step before was one
        total = _tell_held(found_int, found_float, total, counters, sums, k, YES)
    counters[HELD], counters[LOOSE], counters[UNTOLD] = NONE, NO, NO
    number = counters[NUMBER]
    counters[NUMBER] = number + 1
    if kind == TC:
        sample, sd = refine_leaving(pitch, index, reach, rule.rate_hz, rule)
        if sample != sample:
            sample = index + offset - rule.lag_s * rule.rate_hz
        counters[BOTTOM], counters[LEFT], sums[LEFT_AT] = index, number, sample
        return _tell(found_int, found_float, total, TC, number, k, YES, sample, sd)
    sample = index + offset + rule.lead_s * rule.rate_hz
    counters[OPEN_TOP], counters[OPEN_KNOWN], counters[OPEN_NUMBER] = index, k, number
    sums[OFFSET] = offset
    return _tell(found_int, found_float, total, IC, number, k, NO, sample, rule.late_sd_s)


@inner_njit()
def _find_swing(  # type: ignore[no-untyped-def]
    found_int, found_float, total, pitch, acc, counters, sums, k, reach, first, end, top, swinging, moves,
    off, off_sd, rule,
):  # fmt: skip
    """Report the contact of a swing that the pitch rule is waiting for, or store a step without pitch
    until walking continues; returns the number of reports. top : sample of the highest pitch, −1 if
    unknown.
    """
    if top < 0:
        top = highest(pitch, first + (end - first) // 2, end)
    sample, sd = refine_landing(pitch, acc, top, first, k, moves, rule.rate_hz, rule)
    sd = max(sd, rule.loose_sd_s)
    if swinging:
        total = _mend_leaving(found_int, found_float, total, pitch, counters, sums, k, reach, sample, rule)
        total = _tell(found_int, found_float, total, IC, counters[NUMBER], k, YES, sample, sd)
        counters[NUMBER] += 1
        return total
    _hold(counters, sums, k, off, off_sd, sample, sd)
    if _walks_on(counters, sums, rule):
        total = _tell_held(found_int, found_float, total, counters, sums, k, RHYTHM)
        counters[PITCHED] = k
    elif counters[PITCHED] >= k - rule.pause:
        total = _tell_held(found_int, found_float, total, counters, sums, k, YES)
    return total


@njit(cache=True, nogil=True)
def foot_contact_kernel(  # type: ignore[no-untyped-def]
    q, speed, acc, valid, moves, pitch_ring, pitch_counters, pitch_held, window, need, threshold,
    fall, pitch, accs, counters, sums, rules, found_int, found_float,
):  # fmt: skip
    """Process a block of one foot; returns the number of reports.

    Parameters
    ----------
    q, speed, acc, valid : (n, 4), (n,), (n, 3), (n,), see `advance_foot_contacts`; moves False: without speed
        and acc. pitch_ring to fall : arguments of the pitch rule. pitch to rules : see `FootContactState`;
        pitch, accs, counters and sums are advanced in place.
    found_int : (room, 4) kind, number of the event, sample of the report, 1 = its last report.
    found_float : (room, 2) sample of the event, uncertainty in s.
    """
    rule, size = _read_rule(rules), pitch.shape[0]
    rate_hz = rule.rate_hz
    kind, index, detections = np.empty(2, np.int64), np.empty(2, np.int64), np.empty(2, np.int64)
    offset, s = np.empty(2), np.empty(1)
    total = np.int64(0)
    for i in range(q.shape[0]):
        k = counters[SEEN]
        counters[SEEN] = k + 1
        w, x, y, z = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        s[0] = 2.0 * (x * z - w * y)
        if valid[i]:
            pitch[k % size] = asin(min(1.0, max(-1.0, s[0])))
            if moves:
                for c in range(3):
                    accs[k % size, c] = acc[i, c]
            counters[MEASURED] += 1
        measured = k if valid[i] else k - 1
        reach = max(measured - counters[MEASURED] + 1, measured - size + 1 + rule.apart)
        if counters[OPEN_TOP] >= 0 and (not valid[i] or k >= counters[OPEN_KNOWN] + rule.after):
            total = _close_contact(
                found_int, found_float, total, pitch, accs, counters, sums, k, measured, reach, moves, rule
            )
        n = foot_pitch_kernel(
            s, valid[i : i + 1], pitch_ring, pitch_counters, pitch_held,
            window, need, threshold, fall, kind, index, detections, offset,
        )  # fmt: skip
        if not valid[i]:
            counters[MEASURED], counters[RESTING], counters[MOVING], counters[BOTTOM] = 0, 0, 0, NONE
            counters[HELD], counters[LOOSE], counters[UNTOLD] = NONE, NO, NO
            continue
        if moves and n > 0 and kind[0] == TC and counters[MOVING] == 0:
            # the foot rests with its heel raised: what leaves the floor moves
            n, pitch_counters[2] = 0, 0
        for e in range(n):
            total = _take_extreme(
                found_int, found_float, total, pitch, counters, sums, k, reach, kind[e], index[e], offset[e],
                rule,
            )  # fmt: skip
        if not moves:
            continue
        if speed[i] < rule.still_rad_s:
            counters[RESTING] += 1
        else:
            counters[RESTING] = 0
            if counters[MOVING] == 0:
                counters[MOVING] = 1
                # where the take begins in a movement, it is not known where that began
                _begin_movement(counters, sums, k, YES if n > 0 or counters[MEASURED] < rule.quiet else NO)
        if counters[MOVING] == 0:
            continue
        _add_way(sums, q[i], acc[i], rate_hz)
        sums[FASTEST] = max(sums[FASTEST], speed[i])
        if pitch[k % size] >= pitch[counters[TOP] % size]:
            counters[TOP] = k
        swinging, stopped = pitch_counters[2] == 1, counters[RESTING] >= rule.quiet
        start, end, top = counters[START], k - rule.quiet + 1, -1
        is_first = not swinging and counters[TOLD] == 0 and counters[OPEN_TOP] < 0 and start >= reach
        if stopped:
            counters[MOVING] = 0
        elif is_first and _lands_between(pitch, counters, k, rate_hz, rule):
            end, top = k, counters[TOP]
        else:
            continue
        first, off, off_sd = start, 0.0, 0.0
        if swinging:
            first = max(reach, counters[BOTTOM])
        elif not is_first or not _leads_far(sums, k - start + 1, end, start, rate_hz, rule):
            continue
        else:
            middle = top if top >= 0 else start + (end - start) // 2
            first, off, off_sd = guess_leaving(pitch, start, middle, reach, rule)
        total = _find_swing(
            found_int, found_float, total, pitch, accs, counters, sums, k, reach, first, end, top, swinging,
            moves, off, off_sd, rule,
        )  # fmt: skip
        # the pitch rule need not wait for a maximum any more
        pitch_counters[2], pitch_counters[4], pitch_counters[5] = 0, k, -1
        _begin_movement(counters, sums, k, NO)
    return total
