"""The compiled legs of L7S, sample by sample; core/body/l7s/legs.py explains them."""

from __future__ import annotations

from math import acos, cos, sin, sqrt

import numba
import numpy as np

from sagittal.core.rotation.compiled import cross, from_matrix, multiply3


@numba.njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc, unused-ignore]
def _unit(a):  # type: ignore[no-untyped-def]
    length = sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2)
    for c in range(3):
        a[c] /= length


@numba.njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc, unused-ignore]
def write_legs(  # type: ignore[no-untyped-def]
    R, p, hip_width, thigh, shank, foot, side, to_leg, to_foot, q, positions, reach, hinge
):
    """Write q (T, 7, 4) and positions `positions` (T, 7, 3): pelvis, and thigh, shank, foot of each leg, from
    the filter's R, p.

    side : (2,) sign of the hip on the pelvis' y axis. to_leg, to_foot : (3, 3) M of R_ISB = R_Sy M. reach,
    hinge : (T, 2) written, distance between ankle and hip, distance of the hip from the plane of the foot.
    """
    M, turned = np.empty((3, 3)), np.empty((3, 3))
    along, bent, x, y, z, lateral = np.empty((6, 3))
    for k in range(R.shape[0]):
        multiply3(R[k, 0], to_leg, turned)
        from_matrix(turned, q[k, 0])
        for c in range(3):
            positions[k, 0, c] = p[k, 0, c]
        for leg in range(2):
            first = 1 + 3 * leg
            distance = off = 0.0
            for c in range(3):
                hip = p[k, 0, c] + 0.5 * side[leg] * hip_width * R[k, 0, c, 1]
                ankle = p[k, 1 + leg, c] - 0.5 * foot * R[k, 1 + leg, c, 2]
                positions[k, first, c], positions[k, first + 2, c] = hip, ankle
                y[c] = R[k, 1 + leg, c, 1]
                along[c] = hip - ankle
                distance += along[c] ** 2
                off += y[c] * along[c]
            distance = sqrt(distance)
            reach[k, leg], hinge[k, leg] = distance, off
            cosine = (shank**2 + distance**2 - thigh**2) / (2.0 * shank * distance)
            angle = acos(min(1.0, max(-1.0, cosine)))
            for c in range(3):
                along[c] /= distance
            cross(y, along, bent)
            # knee above the ankle by the law of cosines, thigh from knee to hip
            for c in range(3):
                z[c] = cos(angle) * along[c] + sin(angle) * bent[c]
                positions[k, first + 1, c] = positions[k, first + 2, c] + shank * z[c]
            for part in range(2):
                if part == 1:
                    for c in range(3):
                        z[c] = positions[k, first, c] - positions[k, first + 1, c]
                    _unit(z)
                cross(y, z, x)
                _unit(x)
                cross(z, x, lateral)
                for c in range(3):
                    M[c, 0], M[c, 1], M[c, 2] = x[c], lateral[c], z[c]
                multiply3(M, to_leg, turned)
                from_matrix(turned, q[k, first + 1 - part])
            multiply3(R[k, 1 + leg], to_foot, turned)
            from_matrix(turned, q[k, first + 2])
