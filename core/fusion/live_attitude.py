"""Orientation of single sensors in real time: the filter of core/fusion/attitude.py, forward only."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from sagittal.core.frames import R_NEUTRAL, Bools, Floats
from sagittal.core.fusion.attitude import AttitudeParams, attitude_kernel
from sagittal.core.fusion.live_rest import LOST_TILT, RestLooks
from sagittal.core.rotation import from_matrix
from sagittal.core.rotation.compiled import multiply
from sagittal.core.signals.calibrated import SegmentCalibration


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _settle(state, force):  # type: ignore[no-untyped-def]
    """Rotate a filter's orientation by the shortest rotation so that this mean force (3,) in W points up."""
    x, y, z = force[0], force[1], force[2]
    sine, length = np.sqrt(x * x + y * y), np.sqrt(x * x + y * y + z * z)
    half = 0.5 * np.arctan2(sine, z)
    s = np.sin(half) / sine if sine > 1e-9 * length else 0.0
    # about force × up
    w, i, j, k = multiply(np.cos(half), s * y, -s * x, 0.0, state[0], state[1], state[2], state[3])
    state[0], state[1], state[2], state[3] = w, i, j, k


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _turn(  # type: ignore[no-untyped-def]
    acc,
    gyr,
    valid,
    still,
    look,
    which,
    bias,
    norm,
    mount,
    dt,
    kp,
    relearn_s,
    state,
    doubt,
    force_sum,
    out,
    is_known,
):
    """Advance the filters of some sensors, of which the first still.shape[1] are feet.

    Parameters
    ----------
    still, look : (T, feet). state : (f, 9), doubt : (feet,), force_sum : (feet, 3) advanced in place: s since
        the orientation was lost, −1 = known; sum of the force in W over the rest.
    out : (T, f, 4) written, segment to W. is_known : (T, f) written.
    """
    T = acc.shape[0]
    f, w, ok, q = np.empty((T, 3)), np.empty((T, 3)), np.empty(T, np.bool_), np.empty((T, 4))
    for s in range(which.shape[0]):
        i, foot = which[s], s < still.shape[1]
        for k in range(T):
            ok[k] = is_known[k, s] = valid[k, i]
            for c in range(3):
                f[k, c], w[k, c] = acc[k, i, c], gyr[k, i, c] - bias[s, c]
        first = 0
        for k in range(T):
            if k < T - 1 and not (foot and look[k, s]):
                continue
            past = k + 1
            attitude_kernel(
                w[first:past], f[first:past], ok[first:past], dt, norm[s], kp, relearn_s, state[s],
                q[first:past],
            )  # fmt: skip
            if foot:
                for e in range(first, past):
                    if not ok[e]:
                        doubt[s] = 0.0
                    elif doubt[s] >= 0.0:
                        doubt[s] += dt
                        if doubt[s] * kp >= 1.0:
                            # the filter has learnt its tilt again by itself
                            doubt[s] = -1.0
                    is_known[e, s] = ok[e] and doubt[s] < 0.0
                    if not still[e, s]:
                        force_sum[s, :] = 0.0
                        continue
                    a, b, c, d = q[e]
                    x, y, z = f[e]
                    p0, p1, p2, p3 = multiply(a, b, c, d, 0.0, x, y, z)
                    _, x, y, z = multiply(p0, p1, p2, p3, a, -b, -c, -d)
                    force_sum[s, 0] += x
                    force_sum[s, 1] += y
                    force_sum[s, 2] += z
                if look[k, s]:
                    tilt = np.arctan2(np.sqrt(force_sum[s, 0] ** 2 + force_sum[s, 1] ** 2), force_sum[s, 2])
                    lost = doubt[s] >= 0.0
                    if lost or tilt > LOST_TILT:
                        _settle(state[s], force_sum[s])
                        state[s, 7], doubt[s] = np.inf, -1.0
                        q[k] = state[s, :4]
                        # what was measured before does not fit what comes
                        is_known[k, s] = lost
            first = past
        m = mount[s]
        for k in range(T):
            a, b, c, d = q[k]
            # q ⊗ mount*
            w0, x, y, z = multiply(a, b, c, d, m[0], -m[1], -m[2], -m[3])
            out[k, s, 0], out[k, s, 1], out[k, s, 2], out[k, s, 3] = w0, x, y, z


class AttitudeTracker:
    """Attitude of single sensors, starting from standing; independent of the division into blocks.

    A data loss during swing causes a pitch error of a right angle or more, which the filter alone takes ten
    seconds to correct. Therefore the orientation of a foot is unknown after a loss until gravity in its next
    rest determines the tilt, or those ten seconds have passed; and it is reinitialised at any rest that
    contradicts it.

    Parameters
    ----------
    which : indices of the chain's sensors. mounted : their alignment. feet : number of feet, which come
        first.
    """

    def __init__(
        self,
        which: Sequence[int],
        mounted: Sequence[SegmentCalibration],
        rate_hz: float,
        params: AttitudeParams | None = None,
        feet: int = 0,
    ) -> None:
        params = params or AttitudeParams()
        self._which = np.array(which, np.int64)
        self._bias = np.array([m.gyro_bias for m in mounted], np.float64).reshape(-1, 3)
        self._norm = np.array([m.rest_norm for m in mounted], np.float64)
        self._mount = np.array([from_matrix(m.R_segment_sensor) for m in mounted]).reshape(-1, 4)
        self._scalars = 1.0 / rate_hz, params.kp, params.relearn_s
        self._state = np.zeros((len(which), 9))
        for x, m in zip(self._state, mounted, strict=True):
            x[:4], x[7] = from_matrix(R_NEUTRAL @ m.R_segment_sensor), np.inf
        self._looks = RestLooks(feet, rate_hz)
        self._doubt, self._rest = np.full(feet, -1.0), np.zeros((feet, 3))

    def push(self, acc: Floats, gyr: Floats, valid: Bools, still: Bools) -> tuple[Floats, Bools]:
        """Segments to W (T, f, 4), and their validity (T, f).

        Parameters
        ----------
        acc, gyr : (T, n, 3) as measured. valid : (T, n). still : (T, feet) the foot is at rest.
        """
        out = np.empty((len(acc), len(self._which), 4))
        is_known = np.empty(out.shape[:2], np.bool_)
        _turn(
            acc, gyr, valid, still, self._looks.push(still), self._which, self._bias, self._norm, self._mount,
            *self._scalars, self._state, self._doubt, self._rest, out, is_known,
        )  # fmt: skip
        return out, is_known
