"""Zero-phase low-pass of whole signals by one second-order section.

A section is b₀ b₁ b₂ 1 a₁ a₂ of (b₀ + b₁z⁻¹ + b₂z⁻²) / (1 + a₁z⁻¹ + a₂z⁻²). Both designs are written out, and
the filter is compiled here, because `scipy.signal` costs every process two seconds and 50 MB.
"""

from __future__ import annotations

from cmath import sqrt as complex_sqrt
from functools import lru_cache
from math import pi, sqrt, tan
from typing import Final

import numba
import numpy as np

from core.frames import Floats

PAD_S: Final = 2.0
"""Both ends of a signal are continued by their point reflection over so long, or its length."""


@lru_cache(maxsize=64)
def design_butterworth(cutoff_hz: float, rate_hz: float) -> Floats:
    """Section (6,) of a Butterworth low-pass of second order; at most 0.99 of half the rate."""
    return _make_digital((1.0, 0.0), (1.0, sqrt(2.0), 1.0), min(0.99, cutoff_hz / (0.5 * rate_hz)))


@lru_cache(maxsize=16)
def design_elliptic(ripple_db: float, stop_db: float, pass_hz: float, rate_hz: float) -> Floats:
    """Section (6,) of an elliptic low-pass of second order.

    The elliptic function of second order is R(x) = ((1 + t)x² − 1) / (1 − (1 − t)x²), its least value in the
    stop band (1 + t) / (1 − t); the two ripples decide it.

    Parameters
    ----------
    ripple_db : up to pass_hz. stop_db : least attenuation in the stop band.
    """
    ripple = sqrt(10.0 ** (ripple_db / 10.0) - 1.0)
    least = sqrt(10.0 ** (stop_db / 10.0) - 1.0) / ripple
    t = (least - 1.0) / (least + 1.0)
    # 1 + ripple² R² = 0 at s² = −x²
    pole = complex_sqrt(-(1.0 + 1j / ripple) / (1.0 + t + 1j * (1.0 - t) / ripple))
    size, middle = abs(pole) ** 2, 2.0 * abs(pole.real)
    top = 1.0 / sqrt(1.0 + ripple**2)
    return _make_digital((top, top * (1.0 - t)), (1.0, middle / size, 1.0 / size), pass_hz / (0.5 * rate_hz))


def _make_digital(above: tuple[float, float], below: tuple[float, float, float], edge: float) -> Floats:
    """Bilinear transform of (p₀ + p₁s²) / (q₀ + q₁s + q₂s²).

    Parameters
    ----------
    above, below : p and q. edge : frequency that lies at s = i, as a share of half the rate.
    """
    s = 1.0 / tan(0.5 * pi * edge)
    p0, p1 = above[0], above[1] * s * s
    q0, q1, q2 = below[0], below[1] * s, below[2] * s * s
    total = q0 + q1 + q2
    return np.array((p0 + p1, 2.0 * (p0 - p1), p0 + p1, total, 2.0 * (q0 - q2), q0 - q1 + q2)) / total


def low_pass(x: Floats, cutoff_hz: float, rate_hz: float, pad: int | None = None) -> Floats:
    """Butterworth of second order forwards and backwards along the last axis of x (..., n).

    Parameters
    ----------
    pad : samples by which the ends are continued, None = `PAD_S`.
    """
    reach = round(PAD_S * rate_hz) if pad is None else pad
    return filter_both_ways(design_butterworth(cutoff_hz, rate_hz), x, reach)


def filter_both_ways(section: Floats, x: Floats, pad: int) -> Floats:
    """A section (6,) forwards and backwards along the last axis of x (..., n), which has no lag.

    Parameters
    ----------
    pad : samples by which both ends are continued by their point reflection; n − 1 at most.
    """
    n = x.shape[-1]
    reach = min(n - 1, pad)
    out = np.empty(x.shape)
    rest = _find_steady(section)
    for row in np.ndindex(x.shape[:-1]):
        own = x[row]
        long = np.empty(n + 2 * reach)
        long[:reach] = 2.0 * own[0] - own[reach:0:-1]
        long[reach : reach + n] = own
        long[reach + n :] = 2.0 * own[-1] - own[-2 : -reach - 2 : -1]
        _run_both_ways(section, rest, long)
        out[row] = long[reach : reach + n]
    return out


def _find_steady(section: Floats) -> Floats:
    """State (2,) of a section that has had an input of 1 for ever."""
    b0, b1, b2, _, a1, a2 = section
    level = (b0 + b1 + b2) / (1.0 + a1 + a2)
    return np.array((level - b0, b2 - a2 * level))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _run_both_ways(section, rest, x):  # type: ignore[no-untyped-def]
    """Filter x (n,) in place, from its first to its last sample and back."""
    b0, b1, b2, a1, a2 = section[0], section[1], section[2], section[4], section[5]
    for way in range(2):
        first = x[0] if way == 0 else x[-1]
        older, old = rest[1] * first, rest[0] * first
        for i in range(len(x)):
            k = i if way == 0 else len(x) - 1 - i
            value = x[k]
            y = b0 * value + old
            old = b1 * value - a1 * y + older
            older = b2 * value - a2 * y
            x[k] = y
