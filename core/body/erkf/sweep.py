"""Backward pass over a recorded segment: λ from block to block, and the resulting correction of the filtered
states.

Equations: docs/science/erkf.md, "Smoother".
"""

from __future__ import annotations

from sagittal.core.body.erkf.predict import propagate_back, propagate_error
from sagittal.core.body.erkf.updates import back_correct
from sagittal.core.rotation.compiled import turn
from sagittal.core.signals.inner import UNCOUNTED, inner_njit


@inner_njit(**UNCOUNTED)
def copy_row(source, target):  # type: ignore[no-untyped-def]
    """Copy one row (k,) to another; compiles ten times faster in numba than `target[:] = source`."""
    for c in range(len(target)):
        target[c] = source[c]


@inner_njit(**UNCOUNTED)
def sweep_back(lam, step, record, m, swept):  # type: ignore[no-untyped-def]
    """Sweep λ (N,) back over a recorded segment; `swept` (K, N): λ of each sample before its blocks."""
    for k in range(len(step) - 1, -1, -1):
        for B in range(record.blocks[k] - 1, -1, -1):
            back_correct(lam, record.place[k, B], record.H[k, B], record.V[k, B], record.E[k, B])
        copy_row(lam, swept[k])
        propagate_back(lam, record.F[k], m, step[k])


@inner_njit(**UNCOUNTED)
def multiply_lower(P, lam, d):  # type: ignore[no-untyped-def]
    """d ← −P λ, using only the lower triangle of P."""
    d[:] = 0.0
    for r in range(len(lam)):
        for c in range(r):
            d[r] -= P[r, c] * lam[c]
            d[c] -= P[r, c] * lam[r]
        d[r] -= P[r, r] * lam[r]


@inner_njit(**UNCOUNTED)
def move_smoothed(d, step, record, m, swept, out):  # type: ignore[no-untyped-def]
    """Convert a segment's filtered states `out` (K, n, 16) to smoothed ones.

    d (N,) is −P λ before the segment. From sample to sample d ← F d − Q λ − d̂x, which is −P λ again without
    using P (the forward form of the disturbance smoother: Koopman 1993; docs/science/erkf.md, "Smoother").
    """
    for k in range(len(step)):
        dx, Q = record.dx[k], record.Q[k]
        propagate_error(d, record.F[k], m, step[k])
        for r in range(len(d)):
            d[r] -= Q[r] * swept[k, r] + dx[r]
        for i in range(out.shape[1]):
            b, x = i * m, out[k, i]
            for c in range(3):
                x[c] += d[b + c]
                x[3 + c] += d[b + 3 + c]
                if m == 15:
                    x[10 + c] += d[b + 9 + c]
                    x[13 + c] += d[b + 12 + c]
            # P and λ are those before the reset; the state is the one after it: δθ ← G δθ
            a0, a1, a2 = 0.5 * dx[b + 6], 0.5 * dx[b + 7], 0.5 * dx[b + 8]
            t0, t1, t2 = d[b + 6], d[b + 7], d[b + 8]
            turn(x[6:10], t0 - (a1 * t2 - a2 * t1), t1 - (a2 * t0 - a0 * t2), t2 - (a0 * t1 - a1 * t0))
