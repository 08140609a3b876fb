"""Engine E4: square-root sigma-point filters of [q, b, a] with five sets of points.

A set is a matrix of unit points and two rows of weights, so one loop serves all. State and measurement are
factorised together: one triangularisation gives the factor of the innovation, the gain and the factor of the
updated covariance. Equations: docs/science/filters.md, "E4 Sigma points".
"""

from __future__ import annotations

from math import sqrt
from typing import Final, Literal

import numba
import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.gain_kernel import choose_level
from sagittal.core.fusion.algorithms.kalman import take_away, triangularise
from sagittal.core.fusion.algorithms.vectors import normalise, rate_jacobian, read_sample, to_sensor, turn_by
from sagittal.core.message import Message

Points = Literal["merwe", "julier95", "spherical_simplex", "menegaz", "cubature"]
POINTS: Final[tuple[Points, ...]] = ("merwe", "julier95", "spherical_simplex", "menegaz", "cubature")

GAINS: Final = ("sigma_g", "sigma_a", "sigma_m")
CONSTANTS: Final = ("p0", "c_a", "s_a", "s_b")
P0, C_A, S_A, S_B = range(4)


def make_points(
    kind: str, n: int, *, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0, weight: float = 0.1
) -> tuple[Floats, Floats, Floats]:
    """Unit points of a set of sigma points in n dimensions: weighted mean 0, weighted covariance 1.

    Parameters
    ----------
    alpha, beta, kappa : of `merwe` (van der Merwe and Wan 2001). kappa : of `julier95`; may be negative.
    weight : of the first point of `spherical_simplex` (Julier 2003) and `menegaz` (Menegaz 2011), 0 to 1.

    Returns
    -------
    Points (N, n), weights of the mean (N,) and of the covariance (N,).

    Raises
    ------
    ParameterError `gain_out_of_range` if a set has no such points.
    """
    star = np.concatenate((np.eye(n), -np.eye(n)))
    if kind == "cubature":
        weights = np.full(2 * n, 0.5 / n)
        return sqrt(n) * star, weights, weights
    if kind in ("merwe", "julier95"):
        scale = alpha**2 * (n + kappa) if kind == "merwe" else n + kappa
        if not scale > 0.0:
            raise ParameterError(
                "gain_out_of_range",
                Message("κ = {kappa:g} must be above −{value}, α above 0.", kappa=kappa, value=n),
            )
        mean = np.full(2 * n + 1, 0.5 / scale)
        mean[0] = 1.0 - n / scale
        spread = mean.copy()
        if kind == "merwe":
            spread[0] += 1.0 - alpha**2 + beta
        return np.concatenate((np.zeros((1, n)), sqrt(scale) * star)), mean, spread
    if not 0.0 < weight < 1.0:
        raise ParameterError(
            "gain_out_of_range",
            Message("Weight {weight:g} of the first point is not in 0 to 1.", weight=weight),
        )
    if kind == "menegaz":
        share = sqrt((1.0 - weight) / n)
        C = np.linalg.cholesky(np.eye(n) - share**2)
        inverse = np.linalg.inv(C)
        remaining = np.diag(weight * share**2 * inverse @ np.ones((n, n)) @ inverse.T)
        first = np.full((1, n), -share / sqrt(weight))
        weights = np.concatenate(([weight], remaining))
        # in rows, as the other sets are: of columns the loop would be compiled once more
        return np.ascontiguousarray(np.concatenate((first, (C / np.sqrt(remaining)).T))), weights, weights
    if kind != "spherical_simplex":
        raise ParameterError("gain_out_of_range", Message("No set of sigma points '{kind}'.", kind=kind))
    w1 = (1.0 - weight) / (n + 1)
    X = np.zeros((n + 2, n))
    for j in range(1, n + 1):
        X[1 : j + 1, j - 1] = -1.0 / sqrt(j * (j + 1) * w1)
        X[j + 1, j - 1] = j / sqrt(j * (j + 1) * w1)
    weights = np.array([weight, *[w1] * (n + 1)])
    return X, weights, weights


def count_states(learns_bias: bool) -> int:
    """States [q, a] and, if observable, b."""
    return 10 if learns_bias else 7


def start_state(n: int, q: Floats, p0: float) -> Floats:
    """State (size,) at an orientation q (4,)."""
    return np.concatenate((q, np.zeros(n - 4), (sqrt(p0) * np.eye(n)).ravel()))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_sigma_point(points, mean, spread, gyr, acc, mag, dt, m_ref, rows, constants, state, out):  # type: ignore[no-untyped-def]
    """Advance S sensors over n samples; arrays as in `run_complementary`, rows of σ_G, σ_A, σ_M.

    States are [q, a, b]; without b n is 7.

    Parameters
    ----------
    points, mean, spread : of `make_points`.
    """
    N, n = points.shape
    w, a, m, up, xi = np.empty(3), np.empty(3), np.empty(3), np.zeros(3), np.empty((4, 3))
    up[2] = 1.0
    X, D, Y = np.empty((N, n)), np.empty((N, n)), np.empty((N, 6))
    predicted, new = np.empty(6), np.empty(n)
    noise = 3 + (n - 4)
    A, keep = np.empty((n, N + noise)), np.empty((n, n))
    # sizes of a joint factor with one vector or two
    B3, B6 = np.empty((n + 3, N + 3)), np.empty((n + 6, N + 6))
    L3, L6, K3, K6 = (
        np.empty((n + 3, n + 3)),
        np.empty((n + 6, n + 6)),
        np.empty((n + 3, n + 3)),
        np.empty((n + 6, n + 6)),
    )
    v3, v6, vn = np.empty(n + 3), np.empty(n + 6), np.empty(n)
    for s in range(gyr.shape[1]):
        x, L, r = state[s, :n], state[s, n:].reshape(n, n), m_ref[s]
        for k in range(gyr.shape[0]):
            has_a, has_m, da, dm, rate = read_sample(gyr, acc, mag, k, s, w, a, m)
            sigma_g = choose_level(rows, 0, da, dm, rate)
            sigma_a = choose_level(rows, 1, da, dm, rate)
            sigma_m = choose_level(rows, 2, da, dm, rate)
            rate_jacobian(x, xi)
            _place_points(x, L, points, X)
            new[:] = 0.0
            for i in range(N):
                point = X[i]
                if n == 10:
                    turn_by(point, dt * (w[0] - point[7]), dt * (w[1] - point[8]), dt * (w[2] - point[9]))
                else:
                    turn_by(point, dt * w[0], dt * w[1], dt * w[2])
                for j in range(4, 7):
                    point[j] *= constants[C_A]
                for j in range(n):
                    new[j] += mean[i] * point[j]
            for j in range(n):
                x[j] = new[j]
                for i in range(N):
                    D[i, j] = X[i, j] - new[j]
            A[:] = 0.0
            for i in range(N):
                c = sqrt(max(spread[i], 0.0))
                for j in range(n):
                    A[j, i] = c * D[i, j]
            for i in range(3):
                for j in range(4):
                    A[j, N + i] = 0.5 * dt * sigma_g * xi[j, i]
            for j in range(4, n):
                A[j, N + j - 1] = (constants[S_A] if j < 7 else constants[S_B]) * sqrt(dt)
            triangularise(A, L)
            _take_negative(spread, D, L, keep, vn)
            normalise(x)
            if not (has_a or has_m):
                for i in range(4):
                    out[k, s, i] = x[i]
                continue
            _place_points(x, L, points, X)
            rows_used = 0
            if has_a:
                _measure(X, up, True, Y, 0)
                rows_used = 3
            if has_m:
                _measure(X, r, False, Y, rows_used)
                rows_used += 3
            for j in range(rows_used):
                total = 0.0
                for i in range(N):
                    total += mean[i] * Y[i, j]
                predicted[j] = total
                for i in range(N):
                    Y[i, j] -= total
            for i in range(N):
                for j in range(n):
                    D[i, j] = X[i, j] - x[j]
            if rows_used == 6:
                _correct(x, L, D, Y, predicted, a, m, sigma_a, sigma_m, spread, B6, L6, K6, v6)
            elif has_a:
                _correct(x, L, D, Y, predicted, a, a, sigma_a, sigma_a, spread, B3, L3, K3, v3)
            else:
                _correct(x, L, D, Y, predicted, m, m, sigma_m, sigma_m, spread, B3, L3, K3, v3)
            normalise(x)
            for i in range(4):
                out[k, s, i] = x[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _place_points(x, L, points, X):  # type: ignore[no-untyped-def]
    """Write x + L c of every unit point c, (N, n)."""
    N, n = points.shape
    for i in range(N):
        for j in range(n):
            X[i, j] = x[j]
        for k in range(n):
            c = points[i, k]
            if c != 0.0:
                for j in range(k, n):
                    X[i, j] += L[j, k] * c


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _measure(X, r, adds, Y, at):  # type: ignore[no-untyped-def]
    """Write the prediction of every point for the world's r, plus its acceleration, to Y[:, at : at + 3]."""
    for i in range(X.shape[0]):
        to_sensor(X[i], r, Y[i, at : at + 3])
        if adds:
            for j in range(3):
                Y[i, at + j] += X[i, 4 + j]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _correct(x, L, D, Y, predicted, one, two, sigma_one, sigma_two, spread, B, joint, keep, v):  # type: ignore[no-untyped-def]
    """Factorise [measurement; state] together: the first columns contain the gain, the last block the new
    L.
    """
    N, n = D.shape
    p = B.shape[0] - n
    B[:] = 0.0
    for i in range(N):
        c = sqrt(max(spread[i], 0.0))
        for j in range(p):
            B[j, i] = c * Y[i, j]
        for j in range(n):
            B[p + j, i] = c * D[i, j]
    for j in range(p):
        B[j, N + j] = sigma_one if j < 3 else sigma_two
    triangularise(B, joint)
    for i in range(N):
        if spread[i] < 0.0:
            keep[:] = joint
            c = sqrt(-spread[i])
            for j in range(p):
                v[j] = c * Y[i, j]
            for j in range(n):
                v[p + j] = c * D[i, j]
            if not take_away(joint, v):
                # what cannot be taken away stays: the covariance is larger, never wrong by sign
                joint[:] = keep
    # joint = [[S, 0], [G, L]]: the correction is G S⁻¹ (measured − predicted)
    for i in range(p):
        v[i] = (one[i] if i < 3 else two[i - 3]) - predicted[i]
        for j in range(i):
            v[i] -= joint[i, j] * v[j]
        v[i] /= joint[i, i]
    for i in range(n):
        for j in range(p):
            x[i] += joint[p + i, j] * v[j]
        for j in range(n):
            L[i, j] = joint[p + i, p + j]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _take_negative(spread, D, L, keep, v):  # type: ignore[no-untyped-def]
    """Downdate L by points of negative weight; a downdate that fails is skipped."""
    for i in range(spread.shape[0]):
        if spread[i] < 0.0:
            keep[:] = L
            for j in range(L.shape[0]):
                v[j] = sqrt(-spread[i]) * D[i, j]
            if not take_away(L, v):
                L[:] = keep
