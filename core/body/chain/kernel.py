"""The compiled loop of the chain's filters: one extended Kalman filter per sensor, from the base up.

Equations: docs/science/squat.md, with the same symbols. A motion (6, 3) is that of a link: rows 0 to 2 its
orientation R in the world, 3 its rate ω, 4 its angular acceleration α, 5 the acceleration a of its joint.
Derivatives (n, 4, 3) are those of rotation, ω, α and a with respect to the n states of the group of joints.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import GRAVITY, Bools, Floats
from sagittal.core.rotation.compiled import cross, exp_so3, multiply3, transform
from sagittal.core.signals.inner import inner_njit

LOST_TURN = 2.0
"""rad²/s by which an angle becomes uncertain while its sensor is silent, up to `MOST_TURN`, rad²."""
MOST_TURN = 1.0
START_RATE = 0.1
START_ACCELERATION = 1.0
"""Standard deviations of rate and acceleration of a joint at the start and after a silence, rad/s, rad/s²."""


class ChainArrays(NamedTuple):
    """`RevoluteChain` in the form used by the loops; first (S + 1,), bounded (J,)."""

    axes: Floats
    offsets: Floats
    first: NDArray[np.int64]
    places: Floats
    mounts: Floats
    base: Floats
    bounded: Bools


class ChainNoise(NamedTuple):
    """Standard deviations: gyr rad/s, acc m/s² and yaw rad per sample; jerk rad/s³/√Hz; step s."""

    gyr: float
    acc: float
    jerk: float
    yaw: float
    step: float


class ChainScratch(NamedTuple):
    """Work arrays for one sample: motion (2, 6, 3) · d (n, 4, 3) · H (6, n) · h (6,) · v (9, 3) · M (3, 3,
    3) · K (n,) · dx (n,).
    """

    motion: Floats
    d: Floats
    H: Floats
    h: Floats
    v: Floats
    M: Floats
    K: Floats
    dx: Floats


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def make_scratch(n):  # type: ignore[no-untyped-def]
    """Allocate work arrays for groups of up to n states."""
    return ChainScratch(
        np.zeros((2, 6, 3)), np.zeros((n, 4, 3)), np.zeros((6, n)), np.zeros(6), np.zeros((9, 3)),
        np.zeros((3, 3, 3)), np.zeros(n), np.zeros(n),
    )  # fmt: skip


@inner_njit()
def accelerate(w, al, v, out, work):  # type: ignore[no-untyped-def]
    """Add α × v + ω × (ω × v), the acceleration of a point at v on a rotating link, to out (3,)."""
    cross(al, v, work[0])
    cross(w, v, work[1])
    cross(w, work[1], work[2])
    for c in range(3):
        out[c] += work[0, c] + work[2, c]


@inner_njit()
def differentiate_point(w, al, v, d, out, work):  # type: ignore[no-untyped-def]
    """Add the derivative of `accelerate` by one state to out (3,); d (4, 3) of rotation, ω, α and a."""
    cross(d[0], v, work[0])
    cross(d[1], v, work[1])
    cross(w, work[0], work[2])
    for c in range(3):
        work[1, c] += work[2, c]
    cross(w, work[1], work[2])
    cross(w, v, work[3])
    cross(d[1], work[3], work[1])
    cross(d[2], v, work[3])
    cross(al, work[0], work[4])
    for c in range(3):
        out[c] += work[1, c] + work[2, c] + work[3, c] + work[4, c]


@inner_njit()
def pass_joint(motion, axis, offset, x, j, n, s):  # type: ignore[no-untyped-def]
    """Propagate a motion from the link below a joint to the one above, in place; x (3,) angle, rate,
    acceleration.

    Parameters
    ----------
    j : index of the joint in its group. n : number of states with propagated derivatives, 0 for none.
    """
    R, w, al, a = motion[0:3], motion[3], motion[4], motion[5]
    v, z, u = s.v[6], s.v[7], s.v[8]
    transform(R, offset, v)
    transform(R, axis, z)
    # the states of the joints above do not move this one
    for k in range(min(n, 3 * j)):
        d = s.d[k]
        differentiate_point(w, al, v, d, d[3], s.v)
        cross(d[0], z, u)
        cross(d[1], z, s.v[0])
        cross(w, u, s.v[1])
        for c in range(3):
            d[2, c] += u[c] * x[2] + (s.v[0, c] + s.v[1, c]) * x[1]
            d[1, c] += u[c] * x[1]
    accelerate(w, al, v, a, s.v)
    cross(w, z, u)
    for c in range(3):
        al[c] += z[c] * x[2] + u[c] * x[1]
        w[c] += z[c] * x[1]
        s.v[0, c] = axis[c] * x[0]
        if n > 0:
            s.d[3 * j, 0, c] += z[c]
            s.d[3 * j + 1, 1, c] += z[c]
            s.d[3 * j + 1, 2, c] += u[c]
            s.d[3 * j + 2, 2, c] += z[c]
    exp_so3(s.v[0], s.M[0], s.M[1])
    multiply3(R, s.M[0], s.M[2])
    for r in range(3):
        for c in range(3):
            R[r, c] = s.M[2, r, c]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def predict_signals(motion, place, mount, n, s):  # type: ignore[no-untyped-def]
    """Write the predicted sensor signals h (6,), rate and specific force, and their derivatives H (6, n)."""
    R, w, al, a = motion[0:3], motion[3], motion[4], motion[5]
    v, force, u = s.v[6], s.v[7], s.v[8]
    transform(R, place, v)
    multiply3(R, mount, s.M[0])
    for c in range(3):
        force[c] = a[c]
    force[2] += GRAVITY
    accelerate(w, al, v, force, s.v)
    for r in range(3):
        s.h[r] = s.h[3 + r] = 0.0
        for c in range(3):
            s.h[r] += s.M[0, c, r] * w[c]
            s.h[3 + r] += s.M[0, c, r] * force[c]
    for k in range(n):
        d = s.d[k]
        for c in range(3):
            u[c] = d[3, c]
        differentiate_point(w, al, v, d, u, s.v)
        cross(d[0], w, s.v[0])
        cross(d[0], force, s.v[1])
        for r in range(3):
            s.H[r, k] = s.H[3 + r, k] = 0.0
            for c in range(3):
                s.H[r, k] += s.M[0, c, r] * (d[1, c] - s.v[0, c])
                s.H[3 + r, k] += s.M[0, c, r] * (u[c] - s.v[1, c])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def climb(chain, i, x, lower, motion, n, s):  # type: ignore[no-untyped-def]
    """Write the motion of the link of sensor i from that of the link below its group, x (J, 3)."""
    motion[:] = lower
    if n > 0:
        s.d[:n] = 0.0
    for j in range(chain.first[i], chain.first[i + 1]):
        pass_joint(motion, chain.axes[j], chain.offsets[j], x[j], j - chain.first[i], n, s)


@inner_njit()
def predict_states(x, P, noise):  # type: ignore[no-untyped-def]
    """Constant acceleration over a step for the joints of a group: x (m, 3), P (3 m, 3 m) in place."""
    T, m = noise.step, x.shape[0]
    for j in range(m):
        x[j, 0] += T * (x[j, 1] + 0.5 * T * x[j, 2])
        x[j, 1] += T * x[j, 2]
    for r in range(m):
        a = 3 * r
        for k in range(3 * m):
            P[a, k] += T * (P[a + 1, k] + 0.5 * T * P[a + 2, k])
            P[a + 1, k] += T * P[a + 2, k]
    for r in range(m):
        a = 3 * r
        for k in range(3 * m):
            P[k, a] += T * (P[k, a + 1] + 0.5 * T * P[k, a + 2])
            P[k, a + 1] += T * P[k, a + 2]
    g = (T**3 / 6.0, T**2 / 2.0, T)
    for r in range(m):
        for b in range(3):
            for c in range(3):
                P[3 * r + b, 3 * r + c] += noise.jerk**2 / T * g[b] * g[c]


@inner_njit()
def lose_states(x, P, step):  # type: ignore[no-untyped-def]
    """Prediction without sensor data: angles are held with growing uncertainty; x (m, 3), P (3 m, 3 m) in
    place.
    """
    for j in range(x.shape[0]):
        x[j, 1] = x[j, 2] = 0.0
        for b in range(1, 3):
            for k in range(P.shape[0]):
                P[3 * j + b, k] = P[k, 3 * j + b] = 0.0
        P[3 * j + 1, 3 * j + 1] = START_RATE**2
        P[3 * j + 2, 3 * j + 2] = START_ACCELERATION**2
        if P[3 * j, 3 * j] < MOST_TURN:
            P[3 * j, 3 * j] += LOST_TURN * step


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def take_row(P, row, variance, innovation, s):  # type: ignore[no-untyped-def]
    """Scalar measurement update with row (n,): changes P (n, n) and the correction s.dx."""
    n = P.shape[0]
    total = variance
    for r in range(n):
        t = 0.0
        for c in range(n):
            t += P[r, c] * row[c]
        s.K[r] = t
        total += row[r] * t
        innovation -= row[r] * s.dx[r]
    inverse = 1.0 / total
    for r in range(n):
        gain = s.K[r] * inverse
        s.dx[r] += gain * innovation
        for c in range(r + 1):
            P[r, c] -= gain * s.K[c]
            P[c, r] = P[r, c]


@inner_njit()
def correct_states(x, P, gyr, acc, bounded, noise, s):  # type: ignore[no-untyped-def]
    """Update a group with its sensor and the virtual one; x (m, 3), P in place; False if P is not
    positive.
    """
    n = P.shape[0]
    s.dx[:n] = 0.0
    for r in range(3):
        take_row(P, s.H[r, :n], noise.gyr**2, gyr[r] - s.h[r], s)
    for r in range(3):
        take_row(P, s.H[3 + r, :n], noise.acc**2, acc[r] - s.h[3 + r], s)
    for j in range(x.shape[0]):
        if bounded[j]:
            s.H[0, :n] = 0.0
            s.H[0, 3 * j] = 1.0
            take_row(P, s.H[0, :n], noise.yaw**2, -x[j, 0], s)
    good = True
    for r in range(n):
        x[r // 3, r % 3] += s.dx[r]
        good &= P[r, r] > 0.0 and abs(x[r // 3, r % 3]) < 1e6
    return good


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def filter_chain(chain, noise, x, P, gyr, acc, valid, out):  # type: ignore[no-untyped-def]
    """Filter a block of samples; state x (J, 3) and P (S, n, n) in place; returns the sample of failure, or
    −1.

    Parameters
    ----------
    gyr, acc : (T, S, 3) rad/s, m/s². valid : (T, S). out : (T, J, 3) angle, rate, and sd of the angle.
    """
    s = make_scratch(P.shape[1])
    for k in range(gyr.shape[0]):
        lower, motion = s.motion[0], s.motion[1]
        lower[:] = 0.0
        lower[0:3] = chain.base
        for i in range(gyr.shape[1]):
            a, b = chain.first[i], chain.first[i + 1]
            n = 3 * (b - a)
            own = P[i, :n, :n]
            if valid[k, i]:
                predict_states(x[a:b], own, noise)
                climb(chain, i, x, lower, motion, n, s)
                predict_signals(motion, chain.places[i], chain.mounts[i], n, s)
                if not correct_states(x[a:b], own, gyr[k, i], acc[k, i], chain.bounded[a:b], noise, s):
                    return k
            else:
                lose_states(x[a:b], own, noise.step)
            climb(chain, i, x, lower, motion, 0, s)
            lower[:] = motion
            for j in range(a, b):
                out[k, j, 0], out[k, j, 1] = x[j, 0], x[j, 1]
                out[k, j, 2] = np.sqrt(P[i, 3 * (j - a), 3 * (j - a)])
    return -1
