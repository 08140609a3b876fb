"""The compiled rule on stuck channels; explained in stuck.py."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sagittal.core.frames import Bools, Floats
from sagittal.core.signals.inner import UNCOUNTED, inner_njit

CHANNELS: Final = 6
"""Of a sensor: three axes of the accelerometer, three of the gyroscope."""

DEAD: Final = 1
CLIPPED: Final = 2
FROZEN: Final = 3
LOOPED: Final = 4
"""What is wrong with a sensor. The first two stay: such a sensor is out from then on. A sensor that repeats
its last sample, or its last packet, has lost samples and is there again with the next new one."""

Ints = NDArray[np.int64]


class StuckRule(NamedTuple):
    """`StuckParams` at a sample rate; times are samples. relief : decrease of the count of samples at the
    range limit per sample below it.
    """

    share: float
    moving_acc: float
    moving_gyr: float
    dead: float
    change: float
    clipped: float
    relief: float
    acc_floor: float
    gyr_floor: float
    frozen: float
    resting: float
    rest_acc: float
    rest_gyr: float
    looped: float
    gravity: float
    jump: float


class StuckState(NamedTuple):
    """State of n sensors.

    Parameters
    ----------
    now : (1,) index of the next sample. last, mean, dev, top : (n, 6) last sample, its mean and mean
        deviation, and the largest size. stays, begun, clip, clip_begun : (n, 6) repeats, samples at the range
        limit, and where either began. same : (n,) consecutive samples equal to the previous one.
    others, others_begun : (n, 2) the same of all of acc, of gyr, while another sensor moved, and where that
        began. ring : (n, P, 6) last samples, `place` (1,) the next to be written. loop : (n, P) consecutive
        samples equal to the one p + 1 earlier. kind : (n,) permanent fault. channels : (n, 6) affected ones.
    """

    now: Ints
    last: Floats
    mean: Floats
    dev: Floats
    top: Floats
    stays: Floats
    begun: Ints
    clip: Floats
    clip_begun: Ints
    same: Ints
    others: Ints
    others_begun: Ints
    ring: Floats
    loop: Ints
    place: Ints
    kind: Ints
    channels: Bools


@inner_njit(**UNCOUNTED)
def _rests(x, rule):  # type: ignore[no-untyped-def]
    """Whether a sample (6,) is that of a sensor at rest."""
    force = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    rate = np.sqrt(x[3] ** 2 + x[4] ** 2 + x[5] ** 2)
    return abs(force - rule.gravity) < rule.rest_acc and rate < rule.rest_gyr


@inner_njit(**UNCOUNTED)
def _find_movers(dev, valid, rule, moving):  # type: ignore[no-untyped-def]
    """Write which sensors move (n,); returns the number of sensors that measure."""
    movers = 0
    for i in range(len(moving)):
        moving[i] = False
        for c in range(CHANNELS):
            if dev[i, c] > (rule.moving_acc if c < 3 else rule.moving_gyr):
                moving[i] = True
        movers += moving[i] and valid[i]
    return movers


@inner_njit(**UNCOUNTED)
def _read_sample(acc, gyr, last, x, equal):  # type: ignore[no-untyped-def]
    """Write a sample (6,) and which channels equal the previous one; returns whether all do."""
    whole = True
    for c in range(CHANNELS):
        x[c] = acc[c] if c < 3 else gyr[c - 3]
        equal[c] = x[c] == last[c]
        whole = whole and equal[c]
    return whole


@inner_njit(**UNCOUNTED)
def _follow_repeats(s, i, x, equal, whole, elsewhere, sample, rule):  # type: ignore[no-untyped-def]
    """Count repeats of one sample by a whole sensor; returns the number of lost samples, −1 if it measures.

    elsewhere : another sensor moves.
    """
    earlier = s.same[i]
    s.same[i] = earlier + 1 if whole else 0
    for t in range(2):
        if equal[3 * t] and equal[3 * t + 1] and equal[3 * t + 2]:
            s.others[i, t] += elsewhere
        else:
            s.others[i, t] = 0
            s.others_begun[i, t] = sample
    long = min(s.others[i, 0], s.others[i, 1]) >= rule.resting
    if long or (s.same[i] >= rule.frozen and not _rests(x, rule)):
        return s.same[i]
    rate = np.sqrt(x[3] ** 2 + x[4] ** 2 + x[5] ** 2)
    # a sample of rest that was repeated, and the next one turns as nobody goes off
    if earlier >= rule.frozen and not whole and rate > rule.jump and _rests(s.last[i], rule):
        return earlier
    return np.int64(-1)


@inner_njit(**UNCOUNTED)
def _follow_loops(ring, loop, place, same, x, looped):  # type: ignore[no-untyped-def]
    """Count repeats of the last samples (P, 6) of a sensor; returns the number of lost samples, −1 if
    none.
    """
    P = len(ring)
    lost = np.int64(-1)
    j = place - 1
    for p in range(1, P):
        j = j - 1 if j > 0 else j - 1 + P
        repeats = True
        for c in range(CHANNELS):
            if x[c] != ring[j, c]:
                repeats = False
                break
        loop[p] = loop[p] + 1 if repeats else 0
        if loop[p] >= looped and loop[p] >= 2 * (p + 1) and same < p and lost < 0:
            lost = loop[p]
    for c in range(CHANNELS):
        ring[place, c] = x[c]
    return lost


@inner_njit(**UNCOUNTED)
def _ends_a_range(size, full):  # type: ignore[no-untyped-def]
    """Whether a value equals the limit of a common range."""
    near = False
    for f in range(len(full)):
        near = near or abs(size / full[f] - 1.0) < 0.01
    return near


@inner_njit(**UNCOUNTED)
def _follow_channels(s, i, x, equal, stays, sample, full, rule):  # type: ignore[no-untyped-def]
    """Count repeats and samples at the range limit for each channel; store the sample.

    stays : repeats are counted: the sensor moves, and not all of its channels repeat.
    """
    for c in range(CHANNELS):
        size = abs(x[c])
        if not equal[c]:
            s.stays[i, c] = max(0.0, s.stays[i, c] - rule.change)
            if s.stays[i, c] == 0.0:
                s.begun[i, c] = sample
        elif stays:
            s.stays[i, c] += 1.0
        s.top[i, c] = max(s.top[i, c], size)
        end = size >= 0.99 * s.top[i, c] and size >= (rule.acc_floor if c < 3 else rule.gyr_floor)
        if end and not equal[c]:
            end = _ends_a_range(size, full) and abs(s.last[i, c]) >= 0.99 * s.top[i, c]
        if end:
            if s.clip[i, c] == 0.0:
                s.clip_begun[i, c] = sample - 1
            s.clip[i, c] += 1.0
        else:
            s.clip[i, c] = max(0.0, s.clip[i, c] - rule.relief)
        if np.isnan(s.last[i, c]):
            s.mean[i, c] = x[c]
        s.mean[i, c] += rule.share * (x[c] - s.mean[i, c])
        s.dev[i, c] += rule.share * (abs(x[c] - s.mean[i, c]) - s.dev[i, c])
        s.last[i, c] = x[c]


@inner_njit(**UNCOUNTED)
def _judge(s, i, whole, at, rule):  # type: ignore[no-untyped-def]
    """Write whether a sensor is permanently faulty from now on, and its channels; returns the start."""
    first = at
    for c in range(CHANNELS):
        s.channels[i, c] = s.stays[i, c] >= 0.8 * rule.dead
        if s.stays[i, c] >= rule.dead:
            s.kind[i] = DEAD
            first = min(first, s.begun[i, c])
    for t in range(2):
        if s.others[i, t] >= rule.resting and not whole:
            s.kind[i] = DEAD
            for c in range(3 * t, 3 * t + 3):
                s.channels[i, c] = True
            first = min(first, s.others_begun[i, t])
    if s.kind[i] == 0:
        for c in range(CHANNELS):
            s.channels[i, c] = s.clip[i, c] >= 0.8 * rule.clipped
            if s.clip[i, c] >= rule.clipped:
                s.kind[i] = CLIPPED
                first = min(first, s.clip_begun[i, c])
    return first


@njit(cache=True, nogil=True)
def stuck_kernel(acc, gyr, valid, rule, full, state, bad, back):  # type: ignore[no-untyped-def]
    """Advance the state over a block; returns whether any sensor does not measure.

    Parameters
    ----------
    acc, gyr : (T, n, 3). valid : (T, n). rule, state : `StuckRule`, `StuckState` as plain tuples.
    full : limits of common ranges. bad : (T, n) written, the fault. back : (T, n) written, number of
        preceding samples also affected.
    """
    room = np.empty(CHANNELS), np.empty(CHANNELS, np.bool_), np.zeros(valid.shape[1], np.bool_)
    return _watch(acc, gyr, valid, StuckRule(*rule), full, StuckState(*state), bad, back, room)


@inner_njit(**UNCOUNTED)
def _watch(acc, gyr, valid, rule, full, s, bad, back, room):  # type: ignore[no-untyped-def]
    """`stuck_kernel` with work arrays provided by the caller."""
    x, equal, moving = room
    any_fault = False
    for k in range(len(valid)):
        sample = s.now[0] + k
        movers = _find_movers(s.dev, valid[k], rule, moving)
        for i in range(len(moving)):
            fault, earlier = s.kind[i], np.int64(0)
            if valid[k, i]:
                whole = _read_sample(acc[k, i], gyr[k, i], s.last[i], x, equal)
                frozen = _follow_repeats(s, i, x, equal, whole, movers - moving[i] > 0, sample, rule)
                looped = _follow_loops(s.ring[i], s.loop[i], s.place[0], s.same[i], x, rule.looped)
                if fault == 0 and frozen >= 0:
                    fault, earlier = FROZEN, frozen
                elif fault == 0 and looped >= 0 and movers > 0:
                    fault, earlier = LOOPED, looped
                _follow_channels(s, i, x, equal, moving[i] and not whole, sample, full, rule)
                if s.kind[i] == 0:
                    first = _judge(s, i, whole, sample, rule)
                    if s.kind[i] != 0:
                        fault, earlier = s.kind[i], sample - first
            bad[k, i], back[k, i] = fault, earlier
            any_fault = any_fault or fault != 0
        s.place[0] = (s.place[0] + 1) % s.ring.shape[1]
    s.now[0] += len(valid)
    return any_fault
