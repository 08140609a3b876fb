"""The compiled part of swings by their way (docs/science/events.md, "Swings by their way"); foot_way.py
explains it."""

from __future__ import annotations

from math import acos, asin, exp, log, sqrt
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from sagittal.core.events.contact_moments_kernel import knock_at, lowest, refine_leaving
from sagittal.core.signals.inner import inner_njit

TC: Final = np.int64(0)
IC: Final = np.int64(1)
NEVER: Final = -(1 << 40)
UNKNOWN: Final = np.int64(-1)

# places in `counters`
SEEN: Final = 0
MEASURED: Final = 1
MOVING: Final = 2
START: Final = 3
CALM: Final = 4
NUMBER: Final = 5
LEARNED: Final = 6
LAST: Final = 7
COUNTERS: Final = 8

# places in `sums`
LEVEL: Final = 0
FROM_X: Final = 1
FROM_Y: Final = 2
TYPICAL: Final = 3
SUMS: Final = 4

# columns of the track: pitch, rad, and horizontal acceleration in the world, m/s²
PITCH: Final = 0
ACC_X: Final = 1
ACC_Y: Final = 2
TRACK: Final = 3

LATELY: Final = 0.2
"""Weight of the last swing in the person's typical way (our choice)."""

BINS: Final = 60
LOWEST_RATE: Final = 0.017
"""Rates of turning are counted in so many logarithmic bins from here, rad/s, to 1000 times as much."""
PER_BIN: Final = 6.907755278982137 / BINS


class WayRule(NamedTuple):
    """`FootWayParams` at a sample rate; whole numbers are samples. `refine_leaving` takes it as a
    `ContactRule`."""

    rate_hz: float
    leaving_share: float
    least_rad_s: float
    push_s: float
    leaving_sd_s: float
    late_sd_s: float
    dip_rad: float
    floor_rad_s: float
    ceiling_rad_s: float
    moved_rad_s: float
    least_m: float
    share: float
    edge_off: float
    edge_on: float
    least_knock: float
    sd_s: float
    calm_mps2: float
    contact_share: float
    last_share: float
    tilt_mps2: float
    leaving: int
    chord: int
    hold: int
    long: int
    shortest: int
    longest: int
    near: int
    apart: int
    learn: int
    landing: int
    lately: int
    near_push: int


@inner_njit()
def _read_rule(x):  # type: ignore[no-untyped-def]
    """The rule in an array (32,)."""
    return WayRule(
        x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13], x[14], x[15],
        x[16], x[17], x[18], x[19], int(x[20]), int(x[21]), int(x[22]), int(x[23]), int(x[24]), int(x[25]),
        int(x[26]), int(x[27]), int(x[28]), int(x[29]), int(x[30]), int(x[31]),
    )  # fmt: skip


@inner_njit()
def _chord(q, k, n, rate_hz):  # type: ignore[no-untyped-def]
    """Mean rate of turning over the n samples before k, rad/s: what oscillates within them cancels."""
    size = q.shape[0]
    a, b = q[k % size], q[(k - n) % size]
    dot = abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3])
    return 2.0 * acos(min(1.0, dot)) * rate_hz / n


@inner_njit()
def split_in_two(counts):  # type: ignore[no-untyped-def]
    """Otsu's threshold of a histogram of angular rates, rad/s; 0 if there is only one class."""
    total, moment = 0.0, 0.0
    for i in range(BINS):
        total += counts[i]
        moment += counts[i] * i
    best, cut, lower_count, first = 0.0, 0, 0.0, 0.0
    for i in range(BINS - 1):
        lower_count += counts[i]
        first += counts[i] * i
        upper_count = total - lower_count
        if lower_count <= 0.0 or upper_count <= 0.0:
            continue
        apart = (moment - first) / upper_count - first / lower_count
        class_variance = lower_count * upper_count * apart * apart
        if class_variance > best:
            best, cut = class_variance, i
    return LOWEST_RATE * exp((cut + 1) * PER_BIN) if best > 0.0 else 0.0


@inner_njit()
def count_rate(counts, rate):  # type: ignore[no-untyped-def]
    """Count one rate of turning, rad/s, in its bin."""
    i = int(log(max(rate, LOWEST_RATE) / LOWEST_RATE) / PER_BIN)
    counts[min(max(i, 0), BINS - 1)] += 1.0


@inner_njit()
def _set_level(counts, sums, rule):  # type: ignore[no-untyped-def]
    """Update the person's rest level from the histogram of angular rates."""
    cut = split_in_two(counts)
    if cut > 0.0:
        sums[LEVEL] = min(max(cut, rule.floor_rad_s), rule.ceiling_rad_s)


@inner_njit()
def _mean(track, column, first, last):  # type: ignore[no-untyped-def]
    """Mean of a column over samples first … last."""
    size, total = track.shape[0], 0.0
    for j in range(first, last + 1):
        total += track[j % size, column]
    return total / max(1, last - first + 1)


@inner_njit()
def _rest_force(track, first, last, most):  # type: ignore[no-untyped-def]
    """Horizontal acceleration (x, y) that a tilt leaves at rest, over samples first … last; at most so much.

    A foot that moved meanwhile has more: that is no tilt, and would be taken off all that follows.
    """
    x, y = _mean(track, ACC_X, first, last), _mean(track, ACC_Y, first, last)
    share = min(1.0, most / max(sqrt(x * x + y * y), 1e-9))
    return share * x, share * y


@inner_njit()
def _follow(track, course, start, end, rule):  # type: ignore[no-untyped-def]
    """Way (x, y), m, of a movement from rest to rest; its velocity goes into `course` (size, 2)."""
    size = track.shape[0]
    n = end - start
    rate_hz, half = rule.rate_hz, rule.chord // 2
    start_x, start_y = _rest_force(track, start - rule.chord, start, rule.tilt_mps2)
    end_x, end_y = _rest_force(track, end - half, end + half, rule.tilt_mps2)
    vx, vy = 0.0, 0.0
    for j in range(n + 1):
        u, i = j / n, (start + j) % size
        vx += (track[i, ACC_X] - (1.0 - u) * start_x - u * end_x) / rate_hz
        vy += (track[i, ACC_Y] - (1.0 - u) * start_y - u * end_y) / rate_hz
        course[i, 0], course[i, 1] = vx, vy
    x, y = 0.0, 0.0
    for j in range(n + 1):
        u, i = j / n, (start + j) % size
        course[i, 0] -= u * vx
        course[i, 1] -= u * vy
        x += course[i, 0] / rate_hz
        y += course[i, 1] / rate_hz
    return x, y


@inner_njit()
def _along(course, j, x, y):  # type: ignore[no-untyped-def]
    size = course.shape[0]
    return course[j % size, 0] * x + course[j % size, 1] * y


@inner_njit()
def _cross(course, j, neighbour, x, y, level):  # type: ignore[no-untyped-def]
    """Sample at which the speed along (x, y) crosses `level` between sample j and its `neighbour`, j ± 1."""
    a, b = _along(course, neighbour, x, y), _along(course, j, x, y)
    return j + (neighbour - j) * (level - b) / (a - b) if a != b else float(j)


@inner_njit()
def find_fastest(course, start, end, x, y):  # type: ignore[no-untyped-def]
    """Sample at which the foot is fastest along (x, y), a unit vector."""
    top = start
    for j in range(start, end + 1):
        if _along(course, j, x, y) > _along(course, top, x, y):
            top = j
    return top


@inner_njit()
def place_leaving(track, course, start, top, x, y, rule):  # type: ignore[no-untyped-def]
    """Foot-off, in samples, and its uncertainty, s: by a push-off where there is one, else by the speed."""
    level = rule.edge_off * _along(course, top, x, y)
    j = top
    while j > start and _along(course, j, x, y) >= level:
        j -= 1
    off = _cross(course, j, j + 1, x, y, level) if j < top else float(top)
    pitch = track[:, PITCH]
    size = pitch.shape[0]
    bottom = lowest(pitch, start, top)
    if pitch[start % size] - pitch[bottom % size] >= rule.dip_rad:
        sample, sd = refine_leaving(pitch, bottom, start, rule.rate_hz, rule)
        if sample == sample and abs(sample - off) <= rule.near_push:
            return sample, sd
    return off, 2.0 * rule.sd_s


@inner_njit()
def place_landing(course, acc, top, end, x, y, rule):  # type: ignore[no-untyped-def]
    """Contact, in samples: the last of the hard knocks once the foot slows down, else by the speed."""
    fastest = _along(course, top, x, y)
    half = top
    while half < end and _along(course, half, x, y) >= 0.5 * fastest:
        half += 1
    j = half
    while j < end and _along(course, j, x, y) >= rule.edge_on * fastest:
        j += 1
    on = _cross(course, j, j - 1, x, y, rule.edge_on * fastest) if j > top else float(top)
    hardest, last = 0.0, min(end, int(on) + rule.landing)
    for i in range(half, last + 1):
        hardest = max(hardest, knock_at(acc, i, rule.apart))
    if hardest < rule.least_knock:
        return on
    place = last
    while knock_at(acc, place, rule.apart) < rule.last_share * hardest:
        place -= 1
    first, peak = max(half, place - rule.near), 0.0
    for i in range(first, place + 1):
        peak = max(peak, knock_at(acc, i, rule.apart))
    while knock_at(acc, first, rule.apart) < rule.contact_share * peak:
        first += 1
    return first - 0.5 * rule.apart


@njit(cache=True, nogil=True)
def learn_level(q, valid, counts, sums, rules):  # type: ignore[no-untyped-def]
    """Learn the own level of rest from a whole take (n, 4); `counts` and `sums` are set."""
    rule = _read_rule(rules)
    n, moved = rule.chord, NEVER
    for k in range(n, q.shape[0]):
        if valid[k] and valid[k - n]:
            dot = abs(q[k, 0] * q[k - n, 0] + q[k, 1] * q[k - n, 1] + q[k, 2] * q[k - n, 2]
                      + q[k, 3] * q[k - n, 3])  # fmt: skip
            rate = 2.0 * acos(min(1.0, dot)) * rule.rate_hz / n
            if rate > rule.moved_rad_s:
                moved = k
            if k - moved <= rule.lately:
                count_rate(counts, rate)
    _set_level(counts, sums, rule)


@inner_njit()
def _take_sample(q, acc, k, turns, track, accs):  # type: ignore[no-untyped-def]
    """Store orientation (4,), force (3,) and derived quantities of sample k."""
    row = k % track.shape[0]
    w, x, y, z = q
    a, b, c = acc
    turns[row, 0], turns[row, 1], turns[row, 2], turns[row, 3] = w, x, y, z
    accs[row, 0], accs[row, 1], accs[row, 2] = a, b, c
    track[row, PITCH] = asin(min(1.0, max(-1.0, 2.0 * (x * z - w * y))))
    track[row, ACC_X] = (
        (1.0 - 2.0 * (y * y + z * z)) * a + 2.0 * (x * y - w * z) * b + 2.0 * (x * z + w * y) * c
    )
    track[row, ACC_Y] = (
        2.0 * (x * y + w * z) * a + (1.0 - 2.0 * (x * x + z * z)) * b + 2.0 * (y * z - w * x) * c
    )


@inner_njit()
def _begin_movement(track, counters, sums, k, rule):  # type: ignore[no-untyped-def]
    """The foot moves at sample k, and did so since the chord began."""
    start = k - rule.chord
    counters[MOVING], counters[START], counters[CALM] = 1, start, 0
    sums[FROM_X], sums[FROM_Y] = _rest_force(track, start - rule.chord, start, rule.tilt_mps2)


@inner_njit()
def _comes_to_rest(track, counters, sums, k, slow, rule):  # type: ignore[no-untyped-def]
    """Whether a foot that moves has come to rest at sample k; `slow`: it turns no faster than at rest.

    A foot that is carried evenly turns no more than one that rests, but is slowed down before it lands.
    """
    a = _mean(track, ACC_X, k - rule.chord, k) - sums[FROM_X]
    b = _mean(track, ACC_Y, k - rule.chord, k) - sums[FROM_Y]
    calm = slow and sqrt(a * a + b * b) <= rule.calm_mps2
    counters[CALM] = counters[CALM] + 1 if calm else 0
    return counters[CALM] >= rule.hold


@inner_njit()
def _tell_swing(found_int, found_float, total, track, course, accs, counters, sums, k, rule):  # type: ignore[no-untyped-def]
    """Report the movement that ended before sample k if it is a swing; returns how many reports there are."""
    start, end = counters[START], k - rule.chord // 2
    if end - start < rule.shortest:
        return total
    x, y = _follow(track, course, start, end, rule)
    way = sqrt(x * x + y * y)
    if way < max(rule.least_m, rule.share * sums[TYPICAL]):
        return total
    x, y = x / way, y / way
    top = find_fastest(course, start, end, x, y)
    off, off_sd = place_leaving(track, course, start, top, x, y, rule)
    on = place_landing(course, accs, top, end, x, y, rule)
    sums[TYPICAL] += (1.0 if sums[TYPICAL] == 0.0 else LATELY) * (way - sums[TYPICAL])
    for kind, sample, sd in ((TC, off, off_sd), (IC, on, rule.sd_s)):
        found_int[total, 0], found_int[total, 1] = kind, counters[NUMBER]
        found_int[total, 2], found_int[total, 3] = k, 1
        found_float[total, 0], found_float[total, 1] = sample, sd
        counters[NUMBER] += 1
        total += 1
    return total


@njit(cache=True, nogil=True)
def foot_way_kernel(  # type: ignore[no-untyped-def]
    q, acc, valid, turns, track, accs, course, counters, sums, counts, rules, learns, found_int, found_float
):
    """Run over a block of one foot; returns how many reports were made.

    Parameters
    ----------
    q, acc, valid : (n, 4), (n, 3), (n,), see `advance_foot_ways`. turns to counts : see `FootWayState`;
        advanced in place. learns : False where the level is known.
    found_int, found_float : as of `foot_contact_kernel`.
    """
    rule = _read_rule(rules)
    total = np.int64(0)
    for i in range(q.shape[0]):
        k = counters[SEEN]
        counters[SEEN] = k + 1
        if not valid[i]:
            counters[MEASURED], counters[MOVING], counters[CALM] = 0, UNKNOWN, 0
            continue
        _take_sample(q[i], acc[i], k, turns, track, accs)
        counters[MEASURED] += 1
        if counters[MEASURED] <= 2 * rule.chord:
            continue
        rate = _chord(turns, k, rule.chord, rule.rate_hz)
        if rate > rule.moved_rad_s:
            counters[LAST] = k
        if learns and k - counters[LAST] <= rule.lately:
            count_rate(counts, rate)
            counters[LEARNED] += 1
            if counters[LEARNED] % rule.learn == 0:
                _set_level(counts, sums, rule)
        slow = rate < sums[LEVEL]
        if counters[MOVING] == UNKNOWN:
            # where a movement began that nobody saw begin is not known
            counters[CALM] = counters[CALM] + 1 if slow else 0
            if counters[CALM] >= rule.hold:
                counters[MOVING] = 0
        elif counters[MOVING] == 0:
            if not slow:
                _begin_movement(track, counters, sums, k, rule)
        elif _comes_to_rest(track, counters, sums, k, slow, rule):
            previous_total = total
            total = _tell_swing(found_int, found_float, total, track, course, accs, counters, sums, k, rule)
            # a heel that rises and is held goes nowhere yet: the swing that follows began with it
            if total > previous_total or counters[CALM] >= rule.long:
                counters[MOVING] = 0
        elif k - counters[START] > rule.longest:
            counters[MOVING] = 0
    return total
