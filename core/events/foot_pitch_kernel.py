"""The compiled part of the foot-pitch rule (spec/fusion.md §5.2); core/events/foot_pitch.py explains it."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def foot_pitch_kernel(s, valid, ring, counters, window, need, threshold, kind, index, offset):  # type: ignore[no-untyped-def]
    """Run over a block of one foot; returns how many extrema were found.

    Parameters
    ----------
    s, valid : (n,) float64, bool. ring, counters, window, need, threshold : see FootPitchState; the first two
        are advanced in place. kind, index, offset : room for the results: 0 = TC or 1 = IC, sample since the
        start, sub-sample offset.
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
            continue
        ring[k % size] = s[i]
        counters[1] += 1
        if counters[1] < size:
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
        kind[found] = swing
        index[found] = k - 1
        offset[found] = 0.5 * (before - after) / (before - 2.0 * here + after)
        found += 1
        counters[3 + swing] = k
        counters[2] = 1 - swing
    return found
