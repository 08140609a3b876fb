"""The compiled Gauss–Newton pass of L7S over the nodes of a recording (core/body/l7s/smoother.py).

The normal equations couple neighbouring nodes: 9 × 9 within one, a full block to the next and, through the
accelerations, a diagonal one to the next but one. Each node is written and eliminated in one step, and the
updates follow backwards, so that a pass traverses memory twice. With A the block of a node after elimination
of the previous ones, B and G its coupling to the next two and g its right-hand side, V = −A⁻¹ and [B g]ᵀ V
are stored.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import numba
import numpy as np

from sagittal.core.signals.inner import UNCOUNTED, inner_njit

SIZE: Final = 9
"""Places of a node: pelvis, left foot, right foot."""

KEPT: Final = SIZE * (2 * SIZE + 1)
"""Numbers that are kept of a node."""

_WIDTH: Final = 12
"""Of a row of [B g], filled up."""


@inner_njit(error_model="numpy", **UNCOUNTED)
def _combine(factors, apart, rows, width, base, out, n):  # type: ignore[no-untyped-def]
    """Write the first n of `base` plus nine rows of this width, each times its factor; the factors are
    `apart` entries apart.
    """
    a, b, c = factors[0], factors[apart], factors[2 * apart]
    d, e, g = factors[3 * apart], factors[4 * apart], factors[5 * apart]
    h, p, q = factors[6 * apart], factors[7 * apart], factors[8 * apart]
    for j in range(n):
        out[j] = base[j] + (
            a * rows[j] + b * rows[j + width] + c * rows[j + 2 * width]
            + d * rows[j + 3 * width] + e * rows[j + 4 * width] + g * rows[j + 5 * width]
            + h * rows[j + 6 * width] + p * rows[j + 7 * width] + q * rows[j + 8 * width]
        )  # fmt: skip


@inner_njit(error_model="numpy", **UNCOUNTED)
def _sweep(A, column):  # type: ignore[no-untyped-def]
    """Write −A⁻¹ to the lower triangle of A (81,); False if A is not positive definite."""
    for k in range(SIZE):
        for i in range(SIZE):
            column[i] = A[SIZE * k + i] if i < k else A[SIZE * i + k]
        if not column[k] > 0.0:
            return False
        inverse = 1.0 / column[k]
        for i in range(SIZE):
            share = column[i] * inverse
            for j in range(i + 1):
                A[SIZE * i + j] -= share * column[j]
        for i in range(k):
            A[SIZE * k + i] = column[i] * inverse
        for i in range(k + 1, SIZE):
            A[SIZE * i + k] = column[i] * inverse
        A[(SIZE + 1) * k] = -inverse
    return True


@inner_njit(error_model="numpy", **UNCOUNTED)
def _add_legs(x, R, k, still, spread, lengths, A, B):  # type: ignore[no-untyped-def]
    """Add the rows of both legs at node k: hinge, supporting leg, leg too long.

    spread : weights of the three. Every row acts on hip and ankle along one direction, so that a leg is one
    matrix (3, 3) for pelvis and foot, and its negative between them.
    """
    for leg in range(2):
        f = 3 * (1 + leg)
        side = lengths[0] if leg == 0 else -lengths[0]
        tx = x[k, 0] + side * R[k, 0, 0, 1] - x[k, f] + lengths[1] * R[k, 1 + leg, 0, 2]
        ty = x[k, 1] + side * R[k, 0, 1, 1] - x[k, f + 1] + lengths[1] * R[k, 1 + leg, 1, 2]
        tz = x[k, 2] + side * R[k, 0, 2, 1] - x[k, f + 2] + lengths[1] * R[k, 1 + leg, 2, 2]
        reach = sqrt(tx * tx + ty * ty + tz * tz)
        yx, yy, yz = R[k, 1 + leg, 0, 1], R[k, 1 + leg, 1, 1], R[k, 1 + leg, 2, 1]
        weight, along, pull = spread[0] * (yx * tx + yy * ty + yz * tz), 0.0, 0.0
        if still[k, leg] and not still[k, 1 - leg]:
            along += spread[1]
            pull += spread[1] * (reach - lengths[3])
        if reach > lengths[2]:
            along += spread[2]
            pull += spread[2] * (reach - lengths[2])
        along, pull = along / (reach * reach), pull / reach
        u, y = (tx, ty, tz), (yx, yy, yz)
        for i in range(3):
            slope = weight * y[i] + pull * u[i]
            B[_WIDTH * i + SIZE] += slope
            B[_WIDTH * (f + i) + SIZE] -= slope
            for j in range(3):
                entry = spread[0] * y[i] * y[j] + along * u[i] * u[j]
                A[SIZE * (f + i) + j] -= entry
                if j <= i:
                    A[SIZE * i + j] += entry
                    A[SIZE * (f + i) + f + j] += entry


@numba.njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc, unused-ignore]
def move_nodes(  # type: ignore[no-untyped-def]
    x, start, R, bent, stiff, still, hold, spread, lengths, heights, work
):
    """Update the positions x (T, 9) by one pass; return the largest change of a position, NaN without a
    solution.

    Parameters
    ----------
    start : the filter's. R : (T, 3, 3, 3). bent : second differences of the integrated accelerations. still :
    (T, 2) from each node to the next. lengths : half hip width, half foot, leg, supporting leg. heights :
    pelvis, foot. work : (T, KEPT) scratch. Weights: stiff (T + 1, 3) of the second differences, 0 at both
    ends; hold (6,) of the filter's positions, displacement of a resting foot, the mid-pelvis, the heights of
    pelvis, moving foot and resting foot; spread (3,) of hinge, supporting leg, leg too long.
    """
    T, n = len(x), SIZE
    A, column = np.zeros(n * n), np.zeros(n)
    B, following = np.zeros(n * _WIDTH), np.zeros(n * _WIDTH)
    now, second_next, tie = np.zeros(n), np.zeros(n), np.zeros(n)
    previous, rested = np.zeros(n), np.zeros(2)
    V, W, nothing = np.empty(n * n), np.empty(n * (n + 1)), np.zeros(n)
    for k in range(T):
        # accelerations, resting feet, the filter's places
        for j in range(n):
            b = j // 3
            last = stiff[k - 1, b] if k > 0 else 0.0
            stiffness, next_ = stiff[k, b], stiff[k + 1, b]
            second_next[j] = 0.0
            if next_ > 0.0:
                second_next[j] = next_ * (x[k, j] - 2.0 * x[k + 1, j] + x[k + 2, j] - bent[k + 1, j])
            slope = previous[j] - 2.0 * now[j] + second_next[j] + hold[0] * (x[k, j] - start[k, j])
            square, coupling = last + 4.0 * stiffness + next_ + hold[0], -2.0 * (stiffness + next_)
            if b > 0:
                if rested[b - 1] > 0.0:
                    slope += hold[1] * (x[k, j] - x[k - 1, j])
                    square += hold[1]
                if still[k, b - 1] and k < T - 1:
                    slope -= hold[1] * (x[k + 1, j] - x[k, j])
                    square += hold[1]
                    coupling -= hold[1]
            A[(n + 1) * j] += square
            B[(_WIDTH + 1) * j] += coupling
            B[_WIDTH * j + n] += slope
            tie[j] = next_
        # mid-pelvis over the feet, heights
        for i in range(2):
            off = hold[2] * (x[k, i] - 0.5 * x[k, 3 + i] - 0.5 * x[k, 6 + i])
            B[_WIDTH * i + n] += off
            B[_WIDTH * (3 + i) + n] -= 0.5 * off
            B[_WIDTH * (6 + i) + n] -= 0.5 * off
            A[(n + 1) * i] += hold[2]
            A[n * (3 + i) + i] -= 0.5 * hold[2]
            A[n * (6 + i) + i] -= 0.5 * hold[2]
            A[(n + 1) * (3 + i)] += 0.25 * hold[2]
            A[(n + 1) * (6 + i)] += 0.25 * hold[2]
            A[n * (6 + i) + 3 + i] += 0.25 * hold[2]
        for b in range(3):
            j, height, weight = 3 * b + 2, heights[0], hold[3]
            if b > 0:
                height, weight = heights[1], hold[5] if still[k, b - 1] else hold[4]
                rested[b - 1] = 1.0 if still[k, b - 1] and k < T - 1 else 0.0
            A[(n + 1) * j] += weight
            B[_WIDTH * j + n] += weight * (x[k, j] - height)
        _add_legs(x, R, k, still, spread, lengths, A, B)
        # eliminate the node
        if not _sweep(A, column):
            return np.nan
        for i in range(n):
            for j in range(i + 1):
                V[n * i + j] = A[n * i + j]
                V[n * j + i] = A[n * i + j]
        for i in range(n + 1):
            _combine(B[i:], _WIDTH, V, n, nothing, W[n * i :], n)
        # what that leaves of the next two
        for i in range(n):
            _combine(W[n * i :], 1, B, _WIDTH, following[_WIDTH * i :], following[_WIDTH * i :], n + 1)
        for i in range(n):
            for j in range(n):
                A[n * i + j] = following[_WIDTH * i + j]
                following[_WIDTH * i + j] = tie[i] * V[n * i + j] * tie[j]
        for i in range(n):
            for j in range(n):
                B[_WIDTH * i + j] = W[n * i + j] * tie[j]
            B[_WIDTH * i + n] = following[_WIDTH * i + n]
            following[_WIDTH * i + n] = tie[i] * W[n * n + i]
        for j in range(len(V)):
            work[k, j] = V[j]
        for j in range(len(W)):
            work[k, n * n + j] = W[j]
        for j in range(n):
            previous[j], now[j] = now[j], second_next[j]
    most = 0.0
    for j in range(n):
        now[j], second_next[j] = 0.0, 0.0
    for k in range(T - 1, -1, -1):
        # now : move of the next node. then : of the next but one
        for j in range(n):
            column[j] = work[k, n * n + n * n + j]
            tie[j] = stiff[k + 1, j // 3] * second_next[j]
        _combine(now, 1, work[k, n * n :], n, column, column, n)
        _combine(tie, 1, work[k], n, column, column, n)
        for j in range(n):
            x[k, j] += column[j]
            most = max(most, abs(column[j]))
            second_next[j], now[j] = now[j], column[j]
    return most
