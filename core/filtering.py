"""Zero-phase low-pass of whole signals: what scipy.signal gives, to the bit, without importing it.

That package takes half a second and 43 MB of every process that analyses.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numba
import numpy as np

from core.frames import Floats

PAD_S: Final = 2.0
"""Both ends of a signal are continued by their point reflection over so long, or its length."""


@lru_cache(maxsize=64)
def _design(cutoff_hz: float, rate_hz: float) -> tuple[Floats, Floats]:
    """Section b0, b1, b2, a1, a2 of the Butterworth filter of second order, and its states (2,) at rest at 1.

    A stream asks for the same ones again and again. The poles on the unit circle of an analogue filter are
    moved to the warped cut-off and mapped by the bilinear transform (Oppenheim & Schafer 2010, §7.2).
    """
    twice = 4.0
    warped = twice * np.tan(np.pi * min(0.99, cutoff_hz / (0.5 * rate_hz)) / 2.0)
    poles = warped * -np.exp(1j * np.pi * np.array([-1.0, 1.0]) / 4.0)
    gain = warped**2 * np.real(1.0 / np.prod(twice - poles))
    pole = ((twice + poles) / (twice - poles))[0]
    a1, a2 = -2.0 * pole.real, (pole * pole.conjugate()).real
    b, a = np.array([gain, 2.0 * gain, gain]), np.array([1.0, a1, a2])
    rest = np.linalg.solve(np.array([[1.0 + a1, -1.0], [a2, 1.0]]), b[1:] - a[1:] * gain)
    return np.concatenate((b, a[1:])), rest


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _run_both_ways(x, section, rest, reach, out):  # type: ignore[no-untyped-def]
    """Write the rows of x (m, n) filtered both ways into out, their ends continued by `reach` samples."""
    m, n = x.shape
    b0, b1, b2, a1, a2 = section[0], section[1], section[2], section[3], section[4]
    y = np.empty((n + 2 * reach, m))
    now, next_ = np.empty(m), np.empty(m)
    for r in range(m):
        for k in range(reach):
            y[k, r] = 2.0 * x[r, 0] - x[r, reach - k]
            y[reach + n + k, r] = 2.0 * x[r, n - 1] - x[r, n - 2 - k]
        for k in range(n):
            y[reach + k, r] = x[r, k]
    for way in range(2):
        at, step = (0, 1) if way == 0 else (len(y) - 1, -1)
        for r in range(m):
            now[r], next_[r] = rest[0] * y[at, r], rest[1] * y[at, r]
        for _ in range(len(y)):
            # all rows at once: along one, a sample waits for the one before
            for r in range(m):
                put = y[at, r]
                got = b0 * put + now[r]
                now[r] = b1 * put - a1 * got + next_[r]
                next_[r] = b2 * put - a2 * got
                y[at, r] = got
            at += step
    for r in range(m):
        for k in range(n):
            out[r, k] = y[reach + k, r]


def low_pass(x: Floats, cutoff_hz: float, rate_hz: float, pad: int | None = None) -> Floats:
    """Butterworth of second order forwards and backwards along the last axis of x (..., n), n ≥ 1.

    Parameters
    ----------
    pad : samples by which the ends are continued, None = `PAD_S`.
    """
    reach = min(x.shape[-1] - 1, round(PAD_S * rate_hz) if pad is None else pad)
    rows = np.ascontiguousarray(x, np.float64).reshape(-1, x.shape[-1])
    out = np.empty_like(rows)
    _run_both_ways(rows, *_design(float(cutoff_hz), float(rate_hz)), reach, out)
    return out.reshape(x.shape)


def compile_low_pass() -> None:
    """Compile the filter or load it."""
    low_pass(np.zeros((1, 8)), 1.0, 100.0)
