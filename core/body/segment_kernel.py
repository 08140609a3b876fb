"""From sensors to segments, compiled; `sagittal.core.body.tree.ImuTree` explains it."""

from __future__ import annotations

import numba
import numpy as np

from sagittal.core.rotation.compiled import multiply, to_matrix, transform


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def write_segments(position, turned, mount, place, q, p):  # type: ignore[no-untyped-def]
    """Write orientation q (T, n, 4) and origin p (T, n, 3) of segments.

    Parameters
    ----------
    position, turned : (T, n, 3), (T, n, 4) of the sensors in W. mount : (n, 4) sensor to segment axes.
    place : (n, 3) sensor in segment axes, m.
    """
    R, arm = np.empty((3, 3)), np.empty(3)
    for k in range(position.shape[0]):
        for i in range(position.shape[1]):
            a, b, c, d = turned[k, i]
            m = mount[i]
            # q ⊗ mount*
            w, x, y, z = multiply(a, b, c, d, m[0], -m[1], -m[2], -m[3])
            q[k, i, 0], q[k, i, 1], q[k, i, 2], q[k, i, 3] = w, x, y, z
            to_matrix(q[k, i], R)
            transform(R, place[i], arm)
            for e in range(3):
                p[k, i, e] = position[k, i, e] - arm[e]
