"""Projection onto the legs: hinged knees and ankles, and no leg longer than thigh and shank (eq 28–39)."""

from __future__ import annotations

import numba
import numpy as np

from core.body.l7s.updates import N, inject


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def constraint_rows(R, p, leg, half_hip, half_foot, leg_length, C, d):  # type: ignore[no-untyped-def]
    """Write the rows of one leg into C (2, 27), what is missing into d (2,); return how many hold.

    Hinge: the ankle-to-hip vector τ is across the foot's y axis (eq 34). Length: |τ| ≤ L (eq 37).
    """
    C[:] = 0.0
    f = 1 + leg
    side = 1.0 if leg == 0 else -1.0
    Rp, Rf = R[0], R[f]
    tau, y = np.empty(3), np.empty(3)
    for i in range(3):
        tau[i] = p[0, i] + side * half_hip * Rp[i, 1] - p[f, i] + half_foot * Rf[i, 2]
        y[i] = Rf[i, 1]
    square = tau[0] * tau[0] + tau[1] * tau[1] + tau[2] * tau[2]
    count = 2 if square > leg_length * leg_length else 1
    for row in range(count):
        # along·τ̇ with along = y (hinge) or 2τ (length); hip h = (0, ±w, 0), ankle a = (0, 0, −half foot)
        up, uf = np.empty(3), np.empty(3)
        for i in range(3):
            s = t = 0.0
            for k in range(3):
                along = y[k] if row == 0 else 2.0 * tau[k]
                s += along * Rp[k, i]
                t += along * Rf[k, i]
            up[i], uf[i] = s, t
        h, a = side * half_hip, -half_foot
        for i in range(3):
            C[row, i] = up[i]
            C[row, 6 * f + i] = -uf[i]
        # −uᵀ[h]× = (h × u)ᵀ and +uᵀ[a]× = −(a × u)ᵀ
        C[row, 3], C[row, 5] = h * up[2], -h * up[0]
        C[row, 6 * f + 3], C[row, 6 * f + 4] = a * uf[1], -a * uf[0]
    # the hinge turns with the foot: τᵀ R_f (−[e_y]×)
    tx = tz = 0.0
    for k in range(3):
        tx += tau[k] * Rf[k, 0]
        tz += tau[k] * Rf[k, 2]
    C[0, 6 * f + 3] += tz
    C[0, 6 * f + 5] -= tx
    d[0] = -(y[0] * tau[0] + y[1] * tau[1] + y[2] * tau[2])
    d[1] = leg_length * leg_length - square
    return count


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def project(R, p, v, P, half_hip, half_foot, leg_length, dx, work):  # type: ignore[no-untyped-def]
    """One projection ν = P Cᵀ (C P Cᵀ)⁻¹ d, injected; P stays (eq 28–31). False if C P Cᵀ is singular."""
    C, d = np.zeros((4, N)), np.zeros(4)
    rows = 0
    part, missing = np.empty((2, N)), np.empty(2)
    for leg in range(2):
        count = constraint_rows(R, p, leg, half_hip, half_foot, leg_length, part, missing)
        for k in range(count):
            C[rows] = part[k]
            d[rows] = missing[k]
            rows += 1
    PC, S = np.zeros((4, N)), np.zeros((4, 4))
    for r in range(rows):
        for j in range(N):
            c = C[r, j]
            if c != 0.0:
                for k in range(N):
                    PC[r, k] += c * P[j, k]
    for r in range(rows):
        for s in range(r + 1):
            total = 0.0
            for k in range(N):
                total += PC[r, k] * C[s, k]
            S[r, s] = total
    # Cholesky S = L Lᵀ in the lower triangle, then both solves in d
    for r in range(rows):
        for s in range(r + 1):
            total = S[r, s]
            for k in range(s):
                total -= S[r, k] * S[s, k]
            if r == s:
                if not total > 0.0:
                    return False
                S[r, r] = np.sqrt(total)
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
    for k in range(N):
        dx[k] = 0.0
        for r in range(rows):
            dx[k] += PC[r, k] * d[r]
    inject(R, p, v, dx, work)
    return True
