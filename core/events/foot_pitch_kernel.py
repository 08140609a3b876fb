"""Compiled foot-pitch rule (docs/science/events.md); explained in foot_pitch.py."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def foot_pitch_kernel(  # type: ignore[no-untyped-def]
    s, valid, ring, counters, held, window, need, threshold, fall, kind, index, known, offset
):
    """Process a block of one foot; returns the number of extrema.

    Parameters
    ----------
    s, valid : (n,) float64, bool. ring, counters, held, window, need, threshold, fall : see FootPitchState;
        the first three are advanced in place. kind, index, known, offset : output arrays: 0 = TC or 1 = IC,
        sample since the start, sample of detection, sub-sample offset.
    """
    size = window + 3
    found = 0
    for i in range(s.shape[0]):
        k = counters[0]
        counters[0] = k + 1
        if not valid[i]:
            # nothing is concluded across a gap: the phase is unknown after it
            counters[1] = 0
            counters[2] = 0
            counters[5] = -1
            continue
        ring[k % size] = s[i]
        counters[1] += 1
        if counters[1] < size:
            continue
        if counters[5] >= 0:
            # a maximum with the toes up is held until the foot has begun to come down: after a heel contact
            # it only falls, so what rises again was a plateau of the swing
            if s[i] > held[0]:
                held[0] = s[i]
                held[1] = ring[(k - 1) % size]
                counters[5] = k
                held[2] = 2.0
                continue
            if held[2] > 1.0:
                held[2] = 0.5 * (held[1] - s[i]) / (held[1] - 2.0 * held[0] + s[i])
            if s[i] > held[0] - min(fall, 0.5 * held[0]):
                continue
            kind[found] = 1
            index[found] = counters[5]
            known[found] = k
            offset[found] = held[2]
            found += 1
            counters[4] = k
            counters[2] = 0
            counters[5] = -1
            continue
        swing = counters[2]
        if k - counters[3 + swing] <= window or (s[i] < threshold) == (swing == 1):
            continue
        # look for a maximum in swing and for a minimum in stance by turning the sign
        sign = 1.0 if swing == 0 else -1.0
        here = sign * ring[(k - 1) % size]
        if here >= sign * s[i]:
            continue
        towards = 0
        extreme = True
        later = here
        for back in range(2, window + 3):
            earlier = sign * ring[(k - back) % size]
            if back <= window + 1 and earlier <= here:
                extreme = False
                break
            if back >= 3 and later < earlier:
                towards += 1
            later = earlier
        if not extreme or towards < need:
            continue
        before, after = sign * ring[(k - 2) % size], sign * s[i]
        middle = 0.5 * (before - after) / (before - 2.0 * here + after)
        peak = -here
        if swing == 1 and peak > 0.0 and s[i] > peak - min(fall, 0.5 * peak):
            held[0] = peak
            held[1] = -before
            held[2] = middle
            counters[5] = k - 1
            continue
        kind[found] = swing
        index[found] = k - 1
        known[found] = k
        offset[found] = middle
        found += 1
        counters[3 + swing] = k
        counters[2] = 1 - swing
    return found
