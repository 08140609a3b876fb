"""Projection onto the leg constraints: hinged knees and ankles, and no leg longer than thigh and shank (eq
28–39).
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import numba
import numpy as np

from sagittal.core.body.l7s.updates import WIDTH, inject
from sagittal.core.body.se3 import move_pose
from sagittal.core.signals.inner import UNCOUNTED, inner_njit

MOST: Final = 4
"""Rows: two of a leg."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def constraint_rows(R, p, leg, half_hip, half_foot, leg_length, C, d, first):  # type: ignore[no-untyped-def]
    """Write the constraint rows of one leg into C (·, 12), residuals into d, from row `first` on; return
    their number.

    Columns: ρ and φ of the pelvis, then of the foot. Hinge: the ankle-to-hip vector τ is perpendicular to the
    foot's y axis (eq 34). Length: |τ| ≤ L (eq 37).
    """
    f = 1 + leg
    side = half_hip if leg == 0 else -half_hip
    x = p[0, 0] + side * R[0, 0, 1] - p[f, 0] + half_foot * R[f, 0, 2]
    y = p[0, 1] + side * R[0, 1, 1] - p[f, 1] + half_foot * R[f, 1, 2]
    z = p[0, 2] + side * R[0, 2, 1] - p[f, 2] + half_foot * R[f, 2, 2]
    square = x * x + y * y + z * z
    count = 2 if square > leg_length * leg_length else 1
    for row in range(first, first + count):
        # along·τ̇ with along = y_f (hinge) or 2τ (length); hip h = (0, ±w, 0), ankle a = (0, 0, −half foot)
        i, j, k = 2.0 * x, 2.0 * y, 2.0 * z
        if row == first:
            i, j, k = R[f, 0, 1], R[f, 1, 1], R[f, 2, 1]
        for c in range(3):
            C[row, c] = i * R[0, 0, c] + j * R[0, 1, c] + k * R[0, 2, c]
            C[row, 6 + c] = -(i * R[f, 0, c] + j * R[f, 1, c] + k * R[f, 2, c])
        # −uᵀ[h]× = (h × u)ᵀ and +uᵀ[a]× = −(a × u)ᵀ
        C[row, 3], C[row, 4], C[row, 5] = side * C[row, 2], 0.0, -side * C[row, 0]
        C[row, 9], C[row, 10], C[row, 11] = half_foot * C[row, 7], -half_foot * C[row, 6], 0.0
    # the hinge turns with the foot: τᵀ R_f (−[e_y]×)
    C[first, 9] += x * R[f, 0, 2] + y * R[f, 1, 2] + z * R[f, 2, 2]
    C[first, 11] -= x * R[f, 0, 0] + y * R[f, 1, 0] + z * R[f, 2, 0]
    d[first] = -(R[f, 0, 1] * x + R[f, 1, 1] * y + R[f, 2, 1] * z)
    if count == 2:
        d[first + 1] = leg_length * leg_length - square
    return count


@inner_njit(**UNCOUNTED)
def _solve(S, d, rows):  # type: ignore[no-untyped-def]
    """d ← S⁻¹ d by Cholesky in the lower triangle of S (4, 4); False if S is singular."""
    for r in range(rows):
        for s in range(r + 1):
            total = S[r, s]
            for k in range(s):
                total -= S[r, k] * S[s, k]
            if r == s:
                if not total > 0.0:
                    return False
                S[r, r] = sqrt(total)
            else:
                S[r, s] = total / S[s, s]
    for r in range(rows):
        for s in range(r):
            d[r] -= S[r, s] * d[s]
        d[r] /= S[r, r]
    for r in range(rows - 1, -1, -1):
        for s in range(r + 1, rows):
            d[r] -= S[s, r] * d[s]
        d[r] /= S[r, r]
    return True


@inner_njit()
def make_scratch():  # type: ignore[no-untyped-def]
    """Work arrays of `project` and `project_places`."""
    S, d = np.empty((MOST, MOST)), np.empty(MOST)
    return np.empty((MOST, 12)), np.empty((MOST, WIDTH)), S, d, np.empty((3, 3, 3))


@inner_njit()
def project(R, p, v, P, lengths, dx, scratch):  # type: ignore[no-untyped-def]
    """One projection ν = P Cᵀ (C P Cᵀ)⁻¹ d, injected; P is unchanged (eq 28–31). False if C P Cᵀ is singular.

    lengths : half hip width, half foot, leg. dx : (28,) as in `apply_rows`, written.
    """
    C, PC, S, d, work = scratch
    n = len(dx)
    left = constraint_rows(R, p, 0, lengths[0], lengths[1], lengths[2], C, d, 0)
    rows = left + constraint_rows(R, p, 1, lengths[0], lengths[1], lengths[2], C, d, left)
    for r in range(rows):
        foot = 6 if r < left else 12
        for k in range(n):
            PC[r, k] = 0.0
        for c in range(0, 12, 6):
            block = P[:] if c == 0 else P[WIDTH * foot :]
            e, f, g, h, i, j = C[r, c], C[r, c + 1], C[r, c + 2], C[r, c + 3], C[r, c + 4], C[r, c + 5]
            for k in range(n):
                PC[r, k] += (
                    e * block[k] + f * block[WIDTH + k] + g * block[2 * WIDTH + k]
                    + h * block[3 * WIDTH + k] + i * block[4 * WIDTH + k] + j * block[5 * WIDTH + k]
                )  # fmt: skip
        for s in range(r + 1):
            foot = 6 if s < left else 12
            total = 0.0
            for c in range(6):
                total += PC[r, c] * C[s, c] + PC[r, foot + c] * C[s, 6 + c]
            S[r, s] = total
    if not _solve(S, d, rows):
        return False
    for k in range(n):
        dx[k] = 0.0
    for r in range(rows):
        for k in range(n):
            dx[k] += PC[r, k] * d[r]
    inject(R, p, v, dx, work)
    return True


@inner_njit()
def project_places(R, p, spread, lengths, dx, scratch):  # type: ignore[no-untyped-def]
    """The same with variances `spread` (12,) of ρ and φ of pelvis and foot, instead of P."""
    C, PC, S, d, work = scratch
    left = constraint_rows(R, p, 0, lengths[0], lengths[1], lengths[2], C, d, 0)
    rows = left + constraint_rows(R, p, 1, lengths[0], lengths[1], lengths[2], C, d, left)
    for r in range(rows):
        for c in range(12):
            PC[r, c] = spread[c] * C[r, c]
        for s in range(r + 1):
            total = 0.0
            for c in range(6):
                total += PC[r, c] * C[s, c]
            if (r < left) == (s < left):
                for c in range(6, 12):
                    total += PC[r, c] * C[s, c]
            S[r, s] = total
    if not _solve(S, d, rows):
        return False
    for k in range(18):
        dx[k] = 0.0
    for r in range(rows):
        foot = 6 if r < left else 12
        for c in range(6):
            dx[c] += PC[r, c] * d[r]
            dx[foot + c] += PC[r, 6 + c] * d[r]
    for b in range(3):
        move_pose(R[b], p[b], dx, 6 * b, work)
    return True
