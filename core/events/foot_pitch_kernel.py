"""Compiled foot-pitch rule (docs/science/events.md); explained in foot_pitch.py."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def foot_pitch_kernel(  # type: ignore[no-untyped-def]
    s, valid, ring, counters, held, window, need, threshold, fall, kind, index, detections, offset
):
    """Process a block of one foot; returns the number of extrema.

    Parameters
    ----------
    s, valid : (n,) float64, bool. ring, counters, held, window, need, threshold, fall : see FootPitchState;
        the first three are advanced in place. kind, index, detections, offset : output arrays: 0 = TC or
        1 = IC, sample since the start, sample of detection, sub-sample offset.
    """
    size = window + 3
    count = 0
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
            kind[count] = 1
            index[count] = counters[5]
            detections[count] = k
            offset[count] = held[2]
            count += 1
            counters[4] = k
            counters[2] = 0
            counters[5] = -1
            continue
        swing = counters[2]
        if k - counters[3 + swing] <= window or (s[i] < threshold) == (swing == 1):
            continue
        # look for a maximum in swing and for a minimum in stance by turning the sign
        sign = 1.0 if swing == 0 else -1.0
        current_value = sign * ring[(k - 1) % size]
        if current_value >= sign * s[i]:
            continue
        towards = 0
        extreme = True
        later = current_value
        for back in range(2, window + 3):
            earlier = sign * ring[(k - back) % size]
            if back <= window + 1 and earlier <= current_value:
                extreme = False
                break
            if back >= 3 and later < earlier:
                towards += 1
            later = earlier
        if not extreme or towards < need:
            continue
        previous_value, next_value = sign * ring[(k - 2) % size], sign * s[i]
        middle = 0.5 * (previous_value - next_value) / (previous_value - 2.0 * current_value + next_value)
        peak = -current_value
        if swing == 1 and peak > 0.0 and s[i] > peak - min(fall, 0.5 * peak):
            held[0] = peak
            held[1] = -previous_value
            held[2] = middle
            counters[5] = k - 1
            continue
        kind[count] = swing
        index[count] = k - 1
        detections[count] = k
        offset[count] = middle
        count += 1
        counters[3 + swing] = k
        counters[2] = 1 - swing
    return count
