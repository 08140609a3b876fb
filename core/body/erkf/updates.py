"""Measurements of the ErKF: their rows in closed form, and the update by one block of three rows.

A block is 0 = h(x) + noise with at most two IMUs. Its H is ±1 on three errors (position, velocity or bias)
and a 3 × 3 matrix on δθ, so H P involves only a few rows of P. Blocks are processed sequentially against the
accumulated correction dx, which is injected once per step: with diagonal noise that equals the paper's
stacked update. Rows: Potter 2021 eq 28–35; V = L⁻¹ H P, P ← P − VᵀV: docs/science/erkf.md, "Corrections".
"""

from __future__ import annotations

from math import atan2, sqrt

import numba

from sagittal.core.body.erkf.lanes import STEP, mix, read_lanes, spread, write_lanes
from sagittal.core.rotation.compiled import skew, times_cross, wrap_angle
from sagittal.core.signals.inner import UNCOUNTED, inner_njit

FIRST, SECOND, UNIT, TURNS = range(4)
"""A block's place: first error of its IMUs (SECOND is −1 for one IMU), offset of the ±1 (−1: none), whether
it has a part on δθ."""

POSITION, VELOCITY = 0, 3
"""Offsets in an IMU's errors."""


@inner_njit(**UNCOUNTED)
def turn_apart(R, i, j, ri, rj, y):  # type: ignore[no-untyped-def]
    """Write R_j r_j − R_i r_i (3,)."""
    for k in range(3):
        y[k] = R[j, k, 0] * rj[0] + R[j, k, 1] * rj[1] + R[j, k, 2] * rj[2]
        y[k] -= R[i, k, 0] * ri[0] + R[i, k, 1] * ri[1] + R[i, k, 2] * ri[2]


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def joint_rows(x, R, m, i, j, ri, rj, centre, place, H, y):  # type: ignore[no-untyped-def]
    """Joint centre p_i + R_i r_i = p_j + R_j r_j, or with centre False joint axis R_i e_i = R_j e_j."""
    place[FIRST], place[SECOND] = i * m, j * m
    place[UNIT], place[TURNS] = (POSITION if centre else -1), 1
    times_cross(R[i], ri, -1.0, H[0])
    times_cross(R[j], rj, 1.0, H[1])
    turn_apart(R, i, j, ri, rj, y)
    if centre:
        for k in range(3):
            y[k] += x[j, k] - x[i, k]


@inner_njit(**UNCOUNTED)
def second_order_variance(P, R, m, i, j, ri, rj):  # type: ignore[no-untyped-def]
    """Variance of the joint centre's second-order term, ½ σ⁴ |r_xy|² of both levers, in m².

    σ² is the variance of the relative heading of the two sensors: with a heading error ψ the end of a lever
    is displaced by (1 − cos ψ) r, which the linearised rows do not include. Added to the variance of the
    centre as in the second-order filter (Jazwinski 1970 §9.3; Bar-Shalom 2001 §10.3.2) it prevents the first
    steps from fixing headings too early; at the 2° or less of a walk it is below 0.3 mm. At most 1.5 |r_xy|²,
    the mean square of (1 − cos ψ) r over all headings.
    """
    a, b = i * m + 6, j * m + 6
    var = 0.0
    for k in range(3):
        for c in range(3):
            own, cross = P[a + max(k, c), a + min(k, c)], P[max(a + k, b + c), min(a + k, b + c)]
            var += R[i, 2, k] * (own * R[i, 2, c] - 2.0 * cross * R[j, 2, c])
            var += R[j, 2, k] * P[b + max(k, c), b + min(k, c)] * R[j, 2, c]
    reach = 0.0
    for k in range(2):
        reach += (R[i, k, 0] * ri[0] + R[i, k, 1] * ri[1] + R[i, k, 2] * ri[2]) ** 2
        reach += (R[j, k, 0] * rj[0] + R[j, k, 1] * rj[1] + R[j, k, 2] * rj[2]) ** 2
    return min(0.5 * var * var, 1.5) * reach


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def velocity_rows(v, m, i, place, y):  # type: ignore[no-untyped-def]
    """Zero velocity: the error of v (3,) itself is observed."""
    place[FIRST], place[SECOND], place[UNIT], place[TURNS] = i * m, -1, VELOCITY, 0
    for k in range(3):
        y[k] = -v[k]


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def tilt_rows(R, f, m, i, place, H, y):  # type: ignore[no-untyped-def]
    """Tilt: Rᵀẑ is the direction of the specific force at rest; δθ: [Rᵀẑ]×."""
    place[FIRST], place[SECOND], place[UNIT], place[TURNS] = i * m, -1, -1, 1
    norm = 1.0 / sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    skew(R[2], H[0])
    for k in range(3):
        y[k] = f[k] * norm - R[2, k]


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def heading_rows(R, forward, measured, m, i, place, H, y):  # type: ignore[no-untyped-def]
    """Heading of the axis t = R f; two empty rows complete a block of three. False if t is near vertical."""
    tx = R[0, 0] * forward[0] + R[0, 1] * forward[1] + R[0, 2] * forward[2]
    ty = R[1, 0] * forward[0] + R[1, 1] * forward[1] + R[1, 2] * forward[2]
    level = tx * tx + ty * ty
    if level < 0.01:
        return False
    place[FIRST], place[SECOND], place[UNIT], place[TURNS] = i * m, -1, -1, 1
    times_cross(R, forward, -1.0, H[1])
    for k in range(3):
        H[0, 0, k] = (tx * H[1, 1, k] - ty * H[1, 0, k]) / level
        H[0, 1, k] = 0.0
        H[0, 2, k] = 0.0
    y[0], y[1], y[2] = wrap_angle(measured - atan2(ty, tx)), 0.0, 0.0
    return True


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def complete_rows(P, first):  # type: ignore[no-untyped-def]
    """Copy the lower triangle of P into its rows first … first + 2, to make them complete."""
    for q in range(3):
        for c in range(q):
            P[first + c, first + q] = P[first + q, first + c]
    for c in range(first + 3, P.shape[0]):
        P[first, c], P[first + 1, c], P[first + 2, c] = P[c, first], P[c, first + 1], P[c, first + 2]


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def take_rows(P, place, H, V, U, accepted):  # type: ignore[no-untyped-def]
    """Write H (P − Σ VᵀV) of a block into V[taken], summed over the previous blocks; U[a]: H V[a]ᵀ."""
    b, b2, unit = place[FIRST], place[SECOND], place[UNIT]
    new = V[accepted]
    h, g = H[0], H[1]
    for c in range(0, P.shape[1], STEP):
        if place[TURNS] == 1:
            x, y, z = read_lanes(P, b + 6, c), read_lanes(P, b + 7, c), read_lanes(P, b + 8, c)
            n0, n1, n2 = mix(h, 0, x, y, z), mix(h, 1, x, y, z), mix(h, 2, x, y, z)
            if b2 >= 0:
                x, y, z = read_lanes(P, b2 + 6, c), read_lanes(P, b2 + 7, c), read_lanes(P, b2 + 8, c)
                n0 = n0 + g[0, 0] * x + g[0, 1] * y + g[0, 2] * z
                n1 = n1 + g[1, 0] * x + g[1, 1] * y + g[1, 2] * z
                n2 = n2 + g[2, 0] * x + g[2, 1] * y + g[2, 2] * z
                if unit >= 0:
                    n0 = n0 + (read_lanes(P, b + unit, c) - read_lanes(P, b2 + unit, c))
                    n1 = n1 + (read_lanes(P, b + unit + 1, c) - read_lanes(P, b2 + unit + 1, c))
                    n2 = n2 + (read_lanes(P, b + unit + 2, c) - read_lanes(P, b2 + unit + 2, c))
        else:
            i = b + unit
            n0, n1, n2 = read_lanes(P, i, c), read_lanes(P, i + 1, c), read_lanes(P, i + 2, c)
        for a in range(accepted):
            x, y, z = read_lanes(V[a], 0, c), read_lanes(V[a], 1, c), read_lanes(V[a], 2, c)
            n0 = n0 - mix(U[a], 0, x, y, z)
            n1 = n1 - mix(U[a], 1, x, y, z)
            n2 = n2 - mix(U[a], 2, x, y, z)
        write_lanes(new, 0, c, n0)
        write_lanes(new, 1, c, n1)
        write_lanes(new, 2, c, n2)


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def take_block(P, dx, place, H, y, sd, V, accepted, E, U):  # type: ignore[no-untyped-def]
    """Accumulate one block in dx, but not yet in P; False if S is not positive definite.

    The effect of the previous blocks on P is subtracted from H P: H (P − Σ VᵀV). So P passes through the
    processor's cache once per sample (`subtract_blocks`) and not once per block.

    Parameters
    ----------
    P : before all blocks, with the rows used by H complete (`complete_rows`). accepted : number of previous
    blocks. V (blocks, 3, as P) and E (9,) = (e, L) of this one are kept for the smoother.
    U (> taken, 3, 3) : scratch. y (3,) becomes the residual of the block after dx.
    """
    b, b2, unit = place[FIRST], place[SECOND], place[UNIT]
    has_second, turns = b2 >= 0, place[TURNS] == 1
    for a in range(accepted):
        old = V[a]
        for k in range(3):
            for r in range(3):
                total = 0.0
                if turns:
                    for i in range(3):
                        total += H[0, r, i] * old[k, b + 6 + i]
                        if has_second:
                            total += H[1, r, i] * old[k, b2 + 6 + i]
                if unit >= 0:
                    total += old[k, b + unit + r]
                    if has_second:
                        total -= old[k, b2 + unit + r]
                U[a, r, k] = total
    take_rows(P, place, H, V, U, accepted)
    new, S = V[accepted], U[accepted]
    for r in range(3):
        for k in range(3):
            S[r, k] = 0.0
            if turns:
                for i in range(3):
                    S[r, k] += H[0, k, i] * new[r, b + 6 + i]
                    if has_second:
                        S[r, k] += H[1, k, i] * new[r, b2 + 6 + i]
            if unit >= 0:
                S[r, k] += new[r, b + unit + k]
                if has_second:
                    S[r, k] -= new[r, b2 + unit + k]
        if turns:
            for i in range(3):
                y[r] -= H[0, r, i] * dx[b + 6 + i]
                if has_second:
                    y[r] -= H[1, r, i] * dx[b2 + 6 + i]
        if unit >= 0:
            y[r] -= dx[b + unit + r]
            if has_second:
                y[r] += dx[b2 + unit + r]
        S[r, r] += sd * sd
    if not (S[0, 0] > 0.0):
        return False
    i0 = 1.0 / sqrt(S[0, 0])
    l10, l20 = S[1, 0] * i0, S[2, 0] * i0
    pivot = S[1, 1] - l10 * l10
    if not (pivot > 0.0):
        return False
    i1 = 1.0 / sqrt(pivot)
    l21 = (S[2, 1] - l20 * l10) * i1
    pivot = S[2, 2] - l20 * l20 - l21 * l21
    if not (pivot > 0.0):
        return False
    i2 = 1.0 / sqrt(pivot)
    e0 = y[0] * i0
    e1 = (y[1] - l10 * e0) * i1
    e2 = (y[2] - l20 * e0 - l21 * e1) * i2
    for c in range(0, new.shape[1], STEP):
        v0 = i0 * read_lanes(new, 0, c)
        v1 = i1 * (read_lanes(new, 1, c) - l10 * v0)
        v2 = i2 * (read_lanes(new, 2, c) - l20 * v0 - l21 * v1)
        write_lanes(new, 0, c, v0)
        write_lanes(new, 1, c, v1)
        write_lanes(new, 2, c, v2)
    for c in range(P.shape[0]):
        dx[c] += new[0, c] * e0 + new[1, c] * e1 + new[2, c] * e2
    E[0], E[1], E[2] = e0, e1, e2
    E[3], E[4], E[5], E[6], E[7], E[8] = i0, l10, l20, i1, l21, i2
    return True


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def subtract_blocks(P, V, blocks):  # type: ignore[no-untyped-def]
    """P ← P − Σ VᵀV in the lower triangle, four rows and two cache lines at a time; V (≥ blocks, 3, as P).

    Each row is processed up to two whole cache lines; the upper triangle has arbitrary contents. P has spare
    rows (`memory_of`).
    """
    last = P.shape[1] - STEP
    for r in range(0, P.shape[0], 4):
        for c in range(0, r + 4, 2 * STEP):
            # in the last pair the second line may be the first again
            e = min(c + STEP, last)
            p0, p1 = read_lanes(P, r, c), read_lanes(P, r + 1, c)
            p2, p3 = read_lanes(P, r + 2, c), read_lanes(P, r + 3, c)
            q0, q1 = read_lanes(P, r, e), read_lanes(P, r + 1, e)
            q2, q3 = read_lanes(P, r + 2, e), read_lanes(P, r + 3, e)
            for a in range(blocks):
                x, y, z = V[a, 0], V[a, 1], V[a, 2]
                u, v, w = read_lanes(V[a], 0, c), read_lanes(V[a], 1, c), read_lanes(V[a], 2, c)
                f, g, h = read_lanes(V[a], 0, e), read_lanes(V[a], 1, e), read_lanes(V[a], 2, e)
                i, j, k = spread(x[r]), spread(y[r]), spread(z[r])
                p0 = p0 - (i * u + j * v + k * w)
                q0 = q0 - (i * f + j * g + k * h)
                i, j, k = spread(x[r + 1]), spread(y[r + 1]), spread(z[r + 1])
                p1 = p1 - (i * u + j * v + k * w)
                q1 = q1 - (i * f + j * g + k * h)
                i, j, k = spread(x[r + 2]), spread(y[r + 2]), spread(z[r + 2])
                p2 = p2 - (i * u + j * v + k * w)
                q2 = q2 - (i * f + j * g + k * h)
                i, j, k = spread(x[r + 3]), spread(y[r + 3]), spread(z[r + 3])
                p3 = p3 - (i * u + j * v + k * w)
                q3 = q3 - (i * f + j * g + k * h)
            write_lanes(P, r, c, p0)
            write_lanes(P, r + 1, c, p1)
            write_lanes(P, r + 2, c, p2)
            write_lanes(P, r + 3, c, p3)
            write_lanes(P, r, e, q0)
            write_lanes(P, r + 1, e, q1)
            write_lanes(P, r + 2, e, q2)
            write_lanes(P, r + 3, e, q3)


@inner_njit(**UNCOUNTED)
def back_correct(lam, place, H, V, E):  # type: ignore[no-untyped-def]
    """λ ← λ − Hᵀ L⁻ᵀ (V λ + e): one block of the modified Bryson–Frazier smoother
    (docs/science/erkf.md, "Smoother")."""
    z0, z1, z2 = E[0], E[1], E[2]
    for c in range(len(lam)):
        z0 += V[0, c] * lam[c]
        z1 += V[1, c] * lam[c]
        z2 += V[2, c] * lam[c]
    w2 = z2 * E[8]
    w1 = (z1 - E[7] * w2) * E[6]
    w0 = (z0 - E[4] * w1 - E[5] * w2) * E[3]
    b, b2, unit = place[FIRST], place[SECOND], place[UNIT]
    if unit >= 0:
        lam[b + unit] -= w0
        lam[b + unit + 1] -= w1
        lam[b + unit + 2] -= w2
        if b2 >= 0:
            lam[b2 + unit] += w0
            lam[b2 + unit + 1] += w1
            lam[b2 + unit + 2] += w2
    if place[TURNS] == 1:
        for i in range(3):
            lam[b + 6 + i] -= H[0, 0, i] * w0 + H[0, 1, i] * w1 + H[0, 2, i] * w2
            if b2 >= 0:
                lam[b2 + 6 + i] -= H[1, 0, i] * w0 + H[1, 1, i] * w1 + H[1, 2, i] * w2
