"""One time step of the ErKF: Potter 2021 eq 8–15 with both ends of the step, and P ← F P Fᵀ + Q.

F has no coupling between IMUs, so P is processed by blocks: rows, then columns, of the lower block triangle.
Only the lower triangle of P is maintained; the upper one has arbitrary contents. (A full row and column pass
is not symmetric in floating point, and the asymmetry grows without bound: docs/science/erkf.md,
"Prediction".)
"""

from __future__ import annotations

import numba

from sagittal.core.body.erkf.lanes import (
    IN_LINE,
    STEP,
    mix,
    read_columns,
    read_lanes,
    write_columns,
    write_lanes,
)
from sagittal.core.frames import GRAVITY
from sagittal.core.rotation.compiled import (
    multiply3,
    sine_quotients,
    skew_polynomial,
    times_cross,
    to_matrix,
    turn,
)
from sagittal.core.signals.inner import UNCOUNTED, inner_njit

A, S, D, GAMMA, C = range(5)
"""Blocks of F per IMU, δv'=δv+A δθ+D δb_g+C δb_a, δp'=δp+Δt δv+½Δt(δv'−δv), δθ'=S δθ+Γ δb_g."""


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def move(x, previous, acc, gyr, dt, first, R, F, scratch):  # type: ignore[no-untyped-def]
    """Advance one IMU's nominal state x (16,) and write its blocks F (5, 3, 3) and new matrix R (3, 3).

    `first` is the weight of the sample at the start of the step: 1 Euler (eq 8), ½ trapezoid. F is the exact
    derivative: with φ = ω̄Δt, S = Exp(−φ), Γ = −J_r(φ)Δt, and f̄ at both ends rotated by the respective
    orientation.
    """
    phi, f0, f1, accelerated = scratch[0], scratch[1], scratch[2], scratch[3]
    start, turned = scratch[4:7], scratch[7:10]
    last = 1.0 - first
    for i in range(3):
        phi[i] = (first * previous[3 + i] + last * gyr[i] - x[10 + i]) * dt
        f0[i] = first * (previous[i] - x[13 + i])
        f1[i] = last * (acc[i] - x[13 + i])
    to_matrix(x[6:10], start)
    turn(x[6:10], phi[0], phi[1], phi[2])
    to_matrix(x[6:10], R)
    for i in range(3):
        accelerated[i] = start[i, 0] * f0[0] + start[i, 1] * f0[1] + start[i, 2] * f0[2]
        accelerated[i] += R[i, 0] * f1[0] + R[i, 1] * f1[1] + R[i, 2] * f1[2]
    accelerated[2] -= GRAVITY
    for i in range(3):
        x[i] += dt * x[3 + i] + 0.5 * dt * dt * accelerated[i]
        x[3 + i] += dt * accelerated[i]

    s1, s2, s3 = sine_quotients(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    skew_polynomial(phi, 1.0, -s1, s2, F[S])
    skew_polynomial(phi, -dt, dt * s2, -dt * s3, F[GAMMA])
    times_cross(R, f1, -dt, turned)
    multiply3(turned, F[S], F[A])
    multiply3(turned, F[GAMMA], F[D])
    times_cross(start, f0, -dt, F[C])
    for i in range(3):
        for j in range(3):
            F[A, i, j] += F[C, i, j]
            F[C, i, j] = -dt * (first * start[i, j] + last * R[i, j])


@inner_njit(**UNCOUNTED)
def reset_before(F, d):  # type: ignore[no-untyped-def]
    """Fold the reset Jacobian G = 1 − ½[δθ̂]× of the last correction (eq 27) into A and S: F ← F G."""
    a, b, c = 0.5 * d[0], 0.5 * d[1], 0.5 * d[2]
    for k in range(2):
        for i in range(3):
            x, y, z = F[k, i, 0], F[k, i, 1], F[k, i, 2]
            F[k, i, 0] = x - (y * c - z * b)
            F[k, i, 1] = y - (z * a - x * c)
            F[k, i, 2] = z - (x * b - y * a)


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def propagate(P, F, m, dt):  # type: ignore[no-untyped-def]
    """P ← F P Fᵀ, on and below the diagonal, for the blocks F (n, 5, 3, 3) of n IMUs with m errors each.

    Rows, then columns, eight numbers at a time: P has whole lines and rows to spare (`memory_of`).
    """
    N = P.shape[0]
    half = 0.5 * dt
    for j in range(N // m):
        b, end = j * m, (j + 1) * m
        # the block on the diagonal is passed through whole
        for r in range(b + 1, end):
            for c in range(b, r):
                P[c, r] = P[r, c]
        move_rows(P, F[j], b, m, dt, half)
    for j in range(N // m):
        for r in range(j * m, N, STEP):
            move_columns(P, F[j], r, j * m, m, dt, half)


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def move_rows(P, f, b, m, dt, half):  # type: ignore[no-untyped-def]
    """The rows of one IMU, whose error state begins at b, up to the end of its block."""
    a, s, d, g, e = f[A], f[S], f[D], f[GAMMA], f[C]
    for c in range(0, b + m, STEP):
        t0, t1, t2 = read_lanes(P, b + 6, c), read_lanes(P, b + 7, c), read_lanes(P, b + 8, c)
        if m == 15:
            g0, g1, g2 = read_lanes(P, b + 9, c), read_lanes(P, b + 10, c), read_lanes(P, b + 11, c)
            e0, e1, e2 = read_lanes(P, b + 12, c), read_lanes(P, b + 13, c), read_lanes(P, b + 14, c)
        for i in range(3):
            dv = mix(a, i, t0, t1, t2)
            turned = mix(s, i, t0, t1, t2)
            if m == 15:
                dv = dv + mix(d, i, g0, g1, g2) + mix(e, i, e0, e1, e2)
                turned = turned + mix(g, i, g0, g1, g2)
            p, v = read_lanes(P, b + i, c), read_lanes(P, b + 3 + i, c)
            write_lanes(P, b + i, c, p + (dt * v + half * dv))
            write_lanes(P, b + 3 + i, c, v + dv)
            write_lanes(P, b + 6 + i, c, turned)


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def move_columns(P, f, r, b, m, dt, half):  # type: ignore[no-untyped-def]
    """As many rows from r on as there are lanes, in the columns of the IMU whose error state begins at b."""
    a, s, d, g, e = f[A], f[S], f[D], f[GAMMA], f[C]
    p0, p1, p2, v0, v1, v2, t0, t1 = read_columns(P, r, b)
    # of 15 columns the second eight begin with t1, of 9 with p1
    _, u1, u2, u3, u4, u5, u6, u7 = read_columns(P, r, b + m - IN_LINE)
    t2 = u1 if m == 15 else u7
    x0, x1, x2 = mix(a, 0, t0, t1, t2), mix(a, 1, t0, t1, t2), mix(a, 2, t0, t1, t2)
    y0, y1, y2 = mix(s, 0, t0, t1, t2), mix(s, 1, t0, t1, t2), mix(s, 2, t0, t1, t2)
    if m == 15:
        x0 = x0 + mix(d, 0, u2, u3, u4) + mix(e, 0, u5, u6, u7)
        x1 = x1 + mix(d, 1, u2, u3, u4) + mix(e, 1, u5, u6, u7)
        x2 = x2 + mix(d, 2, u2, u3, u4) + mix(e, 2, u5, u6, u7)
        y0 = y0 + (g[0, 0] * u2 + g[0, 1] * u3) + g[0, 2] * u4
        y1 = y1 + (g[1, 0] * u2 + g[1, 1] * u3) + g[1, 2] * u4
        y2 = y2 + (g[2, 0] * u2 + g[2, 1] * u3) + g[2, 2] * u4
    p0, p1, p2 = p0 + (dt * v0 + half * x0), p1 + (dt * v1 + half * x1), p2 + (dt * v2 + half * x2)
    v0, v1, v2 = v0 + x0, v1 + x1, v2 + x2
    write_columns(P, r, b, (p0, p1, p2, v0, v1, v2, y0, y1))
    if m == 15:
        write_columns(P, r, b + 7, (y1, y2, u2, u3, u4, u5, u6, u7))
    else:
        write_columns(P, r, b + 1, (p1, p2, v0, v1, v2, y0, y1, y2))


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def propagate_error(d, F, m, dt):  # type: ignore[no-untyped-def]
    """δ ← F δ, the same step for one error (N,)."""
    for j in range(len(d) // m):
        x = d[j * m : (j + 1) * m]
        f = F[j]
        t0, t1, t2 = x[6], x[7], x[8]
        for i in range(3):
            dv = f[A, i, 0] * t0 + f[A, i, 1] * t1 + f[A, i, 2] * t2
            turned = f[S, i, 0] * t0 + f[S, i, 1] * t1 + f[S, i, 2] * t2
            if m == 15:
                dv += f[D, i, 0] * x[9] + f[D, i, 1] * x[10] + f[D, i, 2] * x[11]
                dv += f[C, i, 0] * x[12] + f[C, i, 1] * x[13] + f[C, i, 2] * x[14]
                turned += f[GAMMA, i, 0] * x[9] + f[GAMMA, i, 1] * x[10] + f[GAMMA, i, 2] * x[11]
            x[i] += dt * x[3 + i] + 0.5 * dt * dv
            x[3 + i] += dv
            x[6 + i] = turned


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def propagate_back(lam, F, m, dt):  # type: ignore[no-untyped-def]
    """λ ← Fᵀ λ, the same step for the smoother."""
    for j in range(len(lam) // m):
        x = lam[j * m : (j + 1) * m]
        f = F[j]
        # dv enters δv with weight 1 and δp with ½Δt
        u0, u1, u2 = x[3] + 0.5 * dt * x[0], x[4] + 0.5 * dt * x[1], x[5] + 0.5 * dt * x[2]
        t0, t1, t2 = x[6], x[7], x[8]
        for i in range(3):
            x[3 + i] += dt * x[i]
            x[6 + i] = f[A, 0, i] * u0 + f[A, 1, i] * u1 + f[A, 2, i] * u2
            x[6 + i] += f[S, 0, i] * t0 + f[S, 1, i] * t1 + f[S, 2, i] * t2
        if m == 15:
            for i in range(3):
                x[9 + i] += f[D, 0, i] * u0 + f[D, 1, i] * u1 + f[D, 2, i] * u2
                x[9 + i] += f[GAMMA, 0, i] * t0 + f[GAMMA, 1, i] * t1 + f[GAMMA, 2, i] * t2
                x[12 + i] += f[C, 0, i] * u0 + f[C, 1, i] * u1 + f[C, 2, i] * u2
