"""Quaternion algebra of the filters, inside compiled loops; array results are written to the last argument.

Quaternions are scalar first and map sensor to world. Other functions: `sagittal.core.rotation.compiled`.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

import numba

from sagittal.core.rotation.compiled import cross, multiply

LEAST_NORM = 0.1
"""A reading shorter than this share of its norm at rest has no direction."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def read_sample(gyr, acc, mag, k, s, w, a, m):  # type: ignore[no-untyped-def]
    """Copy sample k of sensor s of each (n, S, 3) to w, a, m (3,); a non-finite rate becomes zero.

    Returns
    -------
    Whether accelerometer and magnetometer can be used, their deviations from 1 (0 if not), and the norm of
    the rate.
    """
    rate, acc2, mag2 = 0.0, 0.0, 0.0
    for i in range(3):
        w[i], a[i], m[i] = gyr[k, s, i], acc[k, s, i], mag[k, s, i]
        rate += w[i] * w[i]
        acc2 += a[i] * a[i]
        mag2 += m[i] * m[i]
    if not rate < 1e12:
        rate = 0.0
        w[0], w[1], w[2] = 0.0, 0.0, 0.0
    least = LEAST_NORM * LEAST_NORM
    has_acc, has_mag = least < acc2 < 1e12, least < mag2 < 1e12
    deviation_acc = abs(sqrt(acc2) - 1.0) if has_acc else 0.0
    deviation_mag = abs(sqrt(mag2) - 1.0) if has_mag else 0.0
    return has_acc, has_mag, deviation_acc, deviation_mag, sqrt(rate)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def half_turn(x, y, z):  # type: ignore[no-untyped-def]
    """Quaternion (w, x, y, z) of the rotation vector (x, y, z) in rad."""
    square = 0.25 * (x * x + y * y + z * z)
    if square < 0.01:
        # series of sin(p)/p and cos(p) for half an angle p < 0.1 rad: exact to 3e-14
        s = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
        c = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)))
    else:
        p = sqrt(square)
        s, c = sin(p) / p, cos(p)
    s *= 0.5
    return c, s * x, s * y, s * z


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def turn_by(q, x, y, z):  # type: ignore[no-untyped-def]
    """Rotate q (4,) in place by the rotation vector (x, y, z) of sensor axes, without normalising."""
    c, i, j, k = half_turn(x, y, z)
    q[0], q[1], q[2], q[3] = multiply(q[0], q[1], q[2], q[3], c, i, j, k)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def normalise(q):  # type: ignore[no-untyped-def]
    """Scale q (4,) to unit length in place."""
    r = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    q[0], q[1], q[2], q[3] = q[0] * r, q[1] * r, q[2] * r, q[3] * r


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def turn_to_sensor(q, x, y, z):  # type: ignore[no-untyped-def]
    """R(q)ᵀ (x, y, z): a direction of the world in sensor axes (Nazarahari 2021, eq 31)."""
    w, a, b, c = q[0], q[1], q[2], q[3]
    i, j, k = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return x - w * i + b * k - c * j, y - w * j + c * i - a * k, z - w * k + a * j - b * i


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def turn_to_world(q, x, y, z):  # type: ignore[no-untyped-def]
    """R(q) (x, y, z)."""
    w, a, b, c = q[0], q[1], q[2], q[3]
    i, j, k = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return x + w * i + b * k - c * j, y + w * j + c * i - a * k, z + w * k + a * j - b * i


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def to_sensor(q, r, out):  # type: ignore[no-untyped-def]
    """Write R(q)ᵀ r (3,)."""
    out[0], out[1], out[2] = turn_to_sensor(q, r[0], r[1], r[2])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def to_world(q, v, out):  # type: ignore[no-untyped-def]
    """Write R(q) v (3,)."""
    out[0], out[1], out[2] = turn_to_world(q, v[0], v[1], v[2])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def direction_jacobian(q, r, J):  # type: ignore[no-untyped-def]
    """Write d(R(q)ᵀ r)/dq (3, 4) in the form of `to_sensor` (Nazarahari 2021, eq 34)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    u = (x, y, z)
    along = x * r[0] + y * r[1] + z * r[2]
    J[0, 0] = 2.0 * (z * r[1] - y * r[2])
    J[1, 0] = 2.0 * (x * r[2] - z * r[0])
    J[2, 0] = 2.0 * (y * r[0] - x * r[1])
    for i in range(3):
        for j in range(3):
            J[i, j + 1] = 2.0 * (u[i] * r[j] - 2.0 * r[i] * u[j])
        J[i, i + 1] += 2.0 * along
    J[0, 2] -= 2.0 * w * r[2]
    J[0, 3] += 2.0 * w * r[1]
    J[1, 1] += 2.0 * w * r[2]
    J[1, 3] -= 2.0 * w * r[0]
    J[2, 1] -= 2.0 * w * r[1]
    J[2, 2] += 2.0 * w * r[0]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def climb_direction(q, x, y, z, a, b, c):  # type: ignore[no-untyped-def]
    """Jᵀ (a, b, c) (w, x, y, z), J of `direction_jacobian` for the direction (x, y, z) of the world.

    2 [d · r × u, (u · d) r − 2 (r · d) u + (r · u) d + w d × r] with q = (w, u).
    """
    w, i, j, k = q[0], q[1], q[2], q[3]
    u_d, r_d, r_u = i * a + j * b + k * c, 2.0 * (x * a + y * b + z * c), x * i + y * j + z * k
    return (
        2.0 * (a * (y * k - z * j) + b * (z * i - x * k) + c * (x * j - y * i)),
        2.0 * (u_d * x - r_d * i + r_u * a + w * (b * z - c * y)),
        2.0 * (u_d * y - r_d * j + r_u * b + w * (c * x - a * z)),
        2.0 * (u_d * z - r_d * k + r_u * c + w * (a * y - b * x)),
    )


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def rate_jacobian(q, out):  # type: ignore[no-untyped-def]
    """Write Ξ(q) (4, 3): q̇ = ½ Ξ(q) ω, Ξᵀ q = 0."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0], out[0, 1], out[0, 2] = -x, -y, -z
    out[1, 0], out[1, 1], out[1, 2] = w, -z, y
    out[2, 0], out[2, 1], out[2, 2] = z, w, -x
    out[3, 0], out[3, 1], out[3, 2] = -y, x, w


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def observe_turn(r0, r1, r2, b0, b1, b2, q):  # type: ignore[no-untyped-def]
    """W(r, b) q = −r ⊗ q ⊗ b (w, x, y, z), which is q itself where b = R(q)ᵀ r (Wu 2016)."""
    w, x, y, z = multiply(0.0, -r0, -r1, -r2, q[0], q[1], q[2], q[3])
    return multiply(w, x, y, z, 0.0, b0, b1, b2)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def observe(r, b, q, out):  # type: ignore[no-untyped-def]
    """Write W(r, b) q (4,)."""
    out[0], out[1], out[2], out[3] = observe_turn(r[0], r[1], r[2], b[0], b[1], b[2], q)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def scale_to_unit(x, y, z):  # type: ignore[no-untyped-def]
    """(x, y, z) / ‖(x, y, z)‖ and the norm; zero stays zero."""
    norm = sqrt(x * x + y * y + z * z)
    r = 1.0 / norm if norm > 0.0 else 0.0
    return x * r, y * r, z * r, norm


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def unit(v, out):  # type: ignore[no-untyped-def]
    """Write v / ‖v‖ (3,) and return ‖v‖."""
    out[0], out[1], out[2], norm = scale_to_unit(v[0], v[1], v[2])
    return norm


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def dot(a, b):  # type: ignore[no-untyped-def]
    """a · b of vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def heading_error(q, m, work):  # type: ignore[no-untyped-def]
    """Angle in rad by which the world must be rotated about the vertical so that m (3,) points north (+y)."""
    to_world(q, m, work)
    return atan2(work[0], work[1])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def level(up, north, R):  # type: ignore[no-untyped-def]
    """Write the rotation R (3, 3), sensor to world, from vertical and field, both (3,) in sensor axes.

    Rows east, north, up (Black 1964, TRIAD); False, with R unchanged, if the two are parallel.
    """
    x = north[1] * up[2] - north[2] * up[1]
    y = north[2] * up[0] - north[0] * up[2]
    z = north[0] * up[1] - north[1] * up[0]
    east, vertical = sqrt(x * x + y * y + z * z), sqrt(dot(up, up))
    if east < 1e-6 * vertical * sqrt(dot(north, north)):
        return False
    R[0, 0], R[0, 1], R[0, 2] = x / east, y / east, z / east
    R[2, 0], R[2, 1], R[2, 2] = up[0] / vertical, up[1] / vertical, up[2] / vertical
    cross(R[2], R[0], R[1])
    return True
