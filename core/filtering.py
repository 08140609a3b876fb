"""Zero-phase low-pass of whole signals."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from core.frames import Floats

PAD_S: Final = 2.0
"""Both ends of a signal are continued by their point reflection over so long, or its length."""


@lru_cache(maxsize=64)
def _design(cutoff_hz: float, rate_hz: float) -> tuple[Floats, Floats]:
    """Second-order section (6,) and its state under a constant 1 (2,); a stream asks for the same ones again
    and again."""
    from scipy.signal import butter, sosfilt_zi

    sections = butter(2, min(0.99, cutoff_hz / (0.5 * rate_hz)), output="sos")
    return np.asarray(sections[0]), np.asarray(sosfilt_zi(sections)[0])


def low_pass(x: Floats, cutoff_hz: float, rate_hz: float, pad: int | None = None) -> Floats:
    """Butterworth of second order forwards and backwards along the last axis of x (..., n), n ≥ 1.

    Parameters
    ----------
    pad : samples by which the ends are continued, None = `PAD_S`.
    """
    from core.filtering_kernel import filter_both_ways

    n = x.shape[-1]
    reach = min(n - 1, round(PAD_S * rate_hz) if pad is None else pad)
    rows = np.ascontiguousarray(x.reshape(-1, n), np.float64)
    found = np.empty(rows.shape)
    filter_both_ways(rows, *_design(cutoff_hz, rate_hz), reach, np.empty(n + 2 * reach), found)
    return found.reshape(x.shape)
