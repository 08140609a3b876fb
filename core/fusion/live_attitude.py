"""Orientation of single sensors as samples come: the filter of core/fusion/attitude.py, forward only."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from core.calibration.result import SegmentCalibration
from core.frames import R_NEUTRAL, Bools, Floats
from core.fusion.attitude import AttitudeParams, attitude_kernel
from core.rotation import from_matrix
from core.rotation.compiled import multiply


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _turn(acc, gyr, valid, which, bias, norm, mount, dt, kp, relearn_s, state, out):  # type: ignore[no-untyped-def]
    """Advance the filters of some sensors: `out` (T, f, 4) segment to W, `state` (f, 9) in place."""
    T = acc.shape[0]
    f, w, ok, q = np.empty((T, 3)), np.empty((T, 3)), np.empty(T, np.bool_), np.empty((T, 4))
    for s in range(which.shape[0]):
        i = which[s]
        for k in range(T):
            ok[k] = valid[k, i]
            for c in range(3):
                f[k, c], w[k, c] = acc[k, i, c], gyr[k, i, c] - bias[s, c]
        attitude_kernel(w, f, ok, dt, norm[s], kp, relearn_s, state[s], q)
        m = mount[s]
        for k in range(T):
            a, b, c, d = q[k]
            # q ⊗ mount*
            w0, x, y, z = multiply(a, b, c, d, m[0], -m[1], -m[2], -m[3])
            out[k, s, 0], out[k, s, 1], out[k, s, 2], out[k, s, 3] = w0, x, y, z


class AttitudeTracker:
    """Tilt and turn of some sensors by themselves, from standing on; blocks do not matter.

    Parameters
    ----------
    which : of the chain's sensors. mounted : how these sit.
    """

    def __init__(
        self,
        which: Sequence[int],
        mounted: Sequence[SegmentCalibration],
        rate_hz: float,
        params: AttitudeParams | None = None,
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

    def push(self, acc: Floats, gyr: Floats, valid: Bools) -> Floats:
        """Segments to W (T, f, 4) from signals as measured (T, n, 3)."""
        out = np.empty((len(acc), len(self._which), 4))
        _turn(
            acc, gyr, valid, self._which, self._bias, self._norm, self._mount, *self._scalars, self._state,
            out,
        )  # fmt: skip
        return out
