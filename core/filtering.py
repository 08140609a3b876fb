"""Zero-phase low-pass of whole signals: what scipy.signal gives, to the bit, without importing it.

That package takes half a second and 43 MB of every process that analyses.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

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


def low_pass(x: Floats, cutoff_hz: float, rate_hz: float, pad: int | None = None) -> Floats:
    """Butterworth of second order forwards and backwards along the last axis of x (..., n), n ≥ 1.

    Parameters
    ----------
    pad : samples by which the ends are continued, None = `PAD_S`.
    """
    # readers of results, which filter nothing, do without numba
    from core.filtering_kernel import run_both_ways

    reach = min(x.shape[-1] - 1, round(PAD_S * rate_hz) if pad is None else pad)
    rows = np.ascontiguousarray(x, np.float64).reshape(-1, x.shape[-1])
    out = np.empty_like(rows)
    run_both_ways(rows, *_design(float(cutoff_hz), float(rate_hz)), reach, out)
    return out.reshape(x.shape)


def compile_low_pass() -> None:
    """Compile the filter or load it."""
    low_pass(np.zeros((1, 8)), 1.0, 100.0)
