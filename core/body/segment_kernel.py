"""From sensors to segments, compiled; `core.body.tree.ImuTree` explains it."""

from __future__ import annotations

import numba


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def write_segments(position, turned, mount, place, q, p):  # type: ignore[no-untyped-def]
    """Write orientation q (T, n, 4) and origin p (T, n, 3) of segments.

    Parameters
    ----------
    position, turned : (T, n, 3), (T, n, 4) of the sensors in W. mount : (n, 4) sensor to segment axes.
    place : (n, 3) sensor in segment axes, m.
    """
    for k in range(position.shape[0]):
        for i in range(position.shape[1]):
            a, b, c, d = turned[k, i]
            m = mount[i]
            # q ⊗ mount*
            w = a * m[0] + b * m[1] + c * m[2] + d * m[3]
            x = -a * m[1] + b * m[0] - c * m[3] + d * m[2]
            y = -a * m[2] + b * m[3] + c * m[0] - d * m[1]
            z = -a * m[3] - b * m[2] + c * m[1] + d * m[0]
            q[k, i, 0], q[k, i, 1], q[k, i, 2], q[k, i, 3] = w, x, y, z
            u, v, s = place[i]
            p[k, i, 0] = position[k, i, 0] - (1 - 2 * (y * y + z * z)) * u
            p[k, i, 0] -= 2 * (x * y - w * z) * v + 2 * (x * z + w * y) * s
            p[k, i, 1] = position[k, i, 1] - 2 * (x * y + w * z) * u
            p[k, i, 1] -= (1 - 2 * (x * x + z * z)) * v + 2 * (y * z - w * x) * s
            p[k, i, 2] = position[k, i, 2] - 2 * (x * z - w * y) * u
            p[k, i, 2] -= 2 * (y * z + w * x) * v + (1 - 2 * (x * x + y * y)) * s
