"""Relative heading in long live sessions without linked joints: a causal version of core/fusion/drift.py.

Each gyroscope drifts about the vertical independently: two feet and a pelvis diverge by 13° in five simulated
minutes. In straight walking the heading of a segment relative to the pelvis, averaged over strides, remains
that of the first straight walking. The deviation of its mean over the last seconds is removed.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, radians, sin
from typing import Final

import numba
import numpy as np

from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.fusion.drift import DriftParams

REFERENCE_S: Final = 15.0
"""Straight walking that defines the mean; half of offline, as a session begins with the calibration walk."""

MEAN_S: Final = 8.0
"""Time constant of the mean: some seven strides, the width of the window offline."""

LEAST_S: Final = DriftParams.least_s
"""Straight walking after a gap before the mean is believed again."""

TURNING: Final = radians(15.0)
"""Heading off its mean over a second beyond which somebody turns; the pelvis' own rotation is 4 to 8°."""

QUICK_S: Final = 1.0


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _hold(  # type: ignore[no-untyped-def]
    q, gyr, valid, lead, dt, moving, scalars, first, mean, counts, turn, ahead, quiet
):
    """Rotate segments q (T, n, 4) about the vertical in place.

    Parameters
    ----------
    gyr : (T, n, 3) of their sensors. lead : index of the reference, −1 = the mean of all. moving : rad/s.
    scalars : samples of the reference and minimum after a gap; mean_s, quick_s, rad of a turn. first, mean :
        (n, 2) sum of the reference, running mean. counts : (n, 2) samples in both. turn : (n,) rad. ahead :
        (2,) slow heading. quiet : (1,) samples since the last movement.
    """
    n = q.shape[1]
    heading = np.empty((n, 2))
    for k in range(q.shape[0]):
        quiet[0] += 1
        cx = cy = 0.0
        whole = True
        for i in range(n):
            w, x, y, z = q[k, i]
            fx, fy = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
            length = np.sqrt(fx * fx + fy * fy)
            heading[i, 0], heading[i, 1] = fx / max(length, 1e-9), fy / max(length, 1e-9)
            speed = gyr[k, i, 0] ** 2 + gyr[k, i, 1] ** 2 + gyr[k, i, 2] ** 2
            if valid[k, i] and speed > moving * moving:
                quiet[0] = 0
            if not valid[k, i]:
                counts[i, 1] = 0
            # of the corrected headings, so that those that drift do not lead
            if lead < 0:
                whole &= valid[k, i]
                c, s = cos(turn[i]), sin(turn[i])
                cx += c * heading[i, 0] + s * heading[i, 1]
                cy += c * heading[i, 1] - s * heading[i, 0]
        if lead >= 0:
            whole = valid[k, lead]
            cx, cy = heading[lead, 0], heading[lead, 1]
        length = np.sqrt(cx * cx + cy * cy)
        if whole and length > 1e-6:
            cx, cy = cx / length, cy / length
            share = min(1.0, dt / scalars[3])
            ahead[0] += share * (cx - ahead[0])
            ahead[1] += share * (cy - ahead[1])
            off = abs(atan2(cy * ahead[0] - cx * ahead[1], cx * ahead[0] + cy * ahead[1]))
            straight = off < scalars[4] and quiet[0] * dt < scalars[3]
            for i in range(n):
                if i == lead or not straight or not valid[k, i]:
                    continue
                rx = heading[i, 0] * cx + heading[i, 1] * cy
                ry = heading[i, 1] * cx - heading[i, 0] * cy
                if counts[i, 0] < scalars[0]:
                    first[i, 0] += rx
                    first[i, 1] += ry
                    counts[i, 0] += 1
                counts[i, 1] += 1
                share = max(dt / scalars[2], 1.0 / counts[i, 1])
                mean[i, 0] += share * (rx - mean[i, 0])
                mean[i, 1] += share * (ry - mean[i, 1])
                if counts[i, 0] >= scalars[0] and counts[i, 1] >= scalars[1]:
                    a, b = mean[i], first[i]
                    turn[i] = atan2(a[1] * b[0] - a[0] * b[1], a[0] * b[0] + a[1] * b[1])
        for i in range(n):
            if turn[i] == 0.0:
                continue
            c, s = cos(0.5 * turn[i]), -sin(0.5 * turn[i])
            w, x, y, z = q[k, i]
            q[k, i, 0], q[k, i, 1] = c * w - s * z, c * x - s * y
            q[k, i, 2], q[k, i, 3] = c * y + s * x, c * z + s * w


class HeadingHold:
    """The correction of some segments; results are bit-identical for any division into blocks.

    Parameters
    ----------
    segments : a single one is not corrected; the pelvis is the reference if included.
    moving_rps : angular rate of a sensor above which the person moves, rad/s.
    """

    def __init__(self, segments: Sequence[Segment], rate_hz: float, moving_rps: float) -> None:
        n = len(segments)
        self._lead = segments.index("pelvis") if "pelvis" in segments else -1
        self._dt, self._moving = 1.0 / rate_hz, moving_rps
        self._scalars = np.array(
            [REFERENCE_S * rate_hz, LEAST_S * rate_hz, MEAN_S, QUICK_S, TURNING], np.float64
        )
        self._first, self._mean = np.zeros((n, 2)), np.zeros((n, 2))
        self._seen, self.turn = np.zeros((n, 2), np.int64), np.zeros(n)
        self._ahead, self._quiet = np.array([1.0, 0.0]), np.array([1 << 30], np.int64)

    def push(self, q: Floats, gyr: Floats, valid: Bools) -> None:
        """Rotate segments q (T, n, 4) to W in place; gyr (T, n, 3), valid (T, n) of their sensors."""
        if q.shape[1] > 1:
            _hold(
                q, gyr, valid, self._lead, self._dt, self._moving, self._scalars, self._first,
                self._mean, self._seen, self.turn, self._ahead, self._quiet,
            )  # fmt: skip
