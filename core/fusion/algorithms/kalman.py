"""Steps of Kalman filters with dense covariances, inside compiled loops, in place and without allocation."""

from __future__ import annotations

from math import sqrt

import numba


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def take_scalar(P, h, variance, residual, dx, u):  # type: ignore[no-untyped-def]
    """Scalar measurement update: P (n, n) and the correction dx (n,) of one linearisation, in place.

    Sequential rows equal the joint update if their noises are independent. The rank-one form keeps P exactly
    symmetric.

    Parameters
    ----------
    h : (n,) row of the Jacobian. residual : measured − predicted before the first row. u : (n,) work.
    """
    n = P.shape[0]
    u[:] = 0.0
    for k in range(n):
        if h[k] != 0.0:
            c = h[k]
            for i in range(n):
                u[i] += c * P[k, i]
    s = variance
    for k in range(n):
        if h[k] != 0.0:
            s += h[k] * u[k]
            residual -= h[k] * dx[k]
    r = sqrt(1.0 / s)
    for i in range(n):
        u[i] *= r
        dx[i] += u[i] * (r * residual)
    for i in range(n):
        for j in range(n):
            P[i, j] -= u[i] * u[j]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def factor(A, L):  # type: ignore[no-untyped-def]
    """Write the lower triangular L with L Lᵀ = A (n, n); False if A is not positive definite."""
    n = A.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = total / L[j, j]
            elif total > 0.0:
                L[i, i] = sqrt(total)
            else:
                return False
        for j in range(i + 1, n):
            L[i, j] = 0.0
    return True


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def take_block(P, H, R, y, dx, S, L, V):  # type: ignore[no-untyped-def]
    """Joint measurement update with correlated noise R (m, m): P (n, n) and dx (n,) in place.

    Parameters
    ----------
    H : (m, n). y : (m,) residual, overwritten. S, L : (m, m) and V : (m, n) work.

    Returns
    -------
    False, with P and dx unchanged, if H P Hᵀ + R is not positive definite.
    """
    m, n = H.shape
    for i in range(m):
        for j in range(n):
            V[i, j] = 0.0
        for k in range(n):
            if H[i, k] != 0.0:
                for j in range(n):
                    V[i, j] += H[i, k] * P[k, j]
    for i in range(m):
        for j in range(i + 1):
            total = R[i, j]
            for k in range(n):
                total += V[i, k] * H[j, k]
            S[i, j] = total
            S[j, i] = total
    if not factor(S, L):
        return False
    # V ← L⁻¹ H P and y ← L⁻¹ y: then P − Vᵀ V is symmetric to the bit
    for i in range(m):
        for k in range(i):
            y[i] -= L[i, k] * y[k]
            for j in range(n):
                V[i, j] -= L[i, k] * V[k, j]
        y[i] /= L[i, i]
        for j in range(n):
            V[i, j] /= L[i, i]
    for i in range(m):
        for j in range(n):
            dx[j] += V[i, j] * y[i]
            for k in range(n):
                P[j, k] -= V[i, j] * V[i, k]
    return True


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def bound_worst_case(P, square, A, L, V):  # type: ignore[no-untyped-def]
    """H∞ step after a Kalman update: P ← P + P (γ² 1 − P)⁻¹ P in place (Nazarahari 2021, eq 47).

    Parameters
    ----------
    square : γ². A, L, V : (n, n) work.

    Returns
    -------
    False, with P unchanged, if no such filter exists: γ² does not exceed the largest eigenvalue of P.
    """
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            A[i, j] = -P[i, j]
            V[i, j] = P[i, j]
        A[i, i] += square
    if not factor(A, L):
        return False
    for i in range(n):
        for k in range(i):
            for j in range(n):
                V[i, j] -= L[i, k] * V[k, j]
        for j in range(n):
            V[i, j] /= L[i, i]
    for i in range(n):
        for j in range(n):
            for k in range(n):
                P[j, k] += V[i, j] * V[i, k]
    return True


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def triangularise(A, L):  # type: ignore[no-untyped-def]
    """Write the lower triangular L (n, n), diagonal ≥ 0, L Lᵀ = A Aᵀ, of A (n, m), m ≥ n; A is overwritten.

    By Householder reflections of the rows, without forming the product A Aᵀ.
    """
    n, m = A.shape
    for i in range(n):
        square = 0.0
        for k in range(i, m):
            square += A[i, k] * A[i, k]
        norm = sqrt(square)
        for j in range(i + 1, n):
            L[i, j] = 0.0
        L[i, i] = norm
        if norm == 0.0:
            for j in range(i + 1, n):
                L[j, i] = A[j, i]
            continue
        # reflect row i onto −sign(head) norm e_i; L takes the sign out again
        sign = 1.0 if A[i, i] >= 0.0 else -1.0
        A[i, i] += sign * norm
        scale = 1.0 / (norm * abs(A[i, i]))
        for j in range(i + 1, n):
            p0, p1 = 0.0, 0.0
            k = i
            # two sums hide half of the waiting for each addition
            while k + 1 < m:
                p0 += A[i, k] * A[j, k]
                p1 += A[i, k + 1] * A[j, k + 1]
                k += 2
            if k < m:
                p0 += A[i, k] * A[j, k]
            c = (p0 + p1) * scale
            for k in range(i, m):
                A[j, k] -= c * A[i, k]
            L[j, i] = -sign * A[j, i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def take_away(L, v):  # type: ignore[no-untyped-def]
    """Downdate the lower triangular L (n, n) by v vᵀ: L Lᵀ − v vᵀ; v (n,) is overwritten.

    Returns
    -------
    False if the result is not positive definite; L is then unusable.
    """
    n = L.shape[0]
    for k in range(n):
        square = L[k, k] * L[k, k] - v[k] * v[k]
        if not square > 0.0:
            return False
        r = sqrt(square)
        c, s = r / L[k, k], v[k] / L[k, k]
        L[k, k] = r
        for i in range(k + 1, n):
            L[i, k] = (L[i, k] - s * v[i]) / c
            v[i] = c * v[i] - s * L[i, k]
    return True
