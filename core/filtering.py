"""Zero-phase low-pass of whole signals."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from core.frames import Floats

PAD_S: Final = 2.0
"""Both ends of a signal are continued by their point reflection over so long, or its length."""


AT_ONCE: Final = 1 << 19
"""Numbers that are filtered together: SciPy copies them five times."""


@lru_cache(maxsize=64)
def _design(cutoff_hz: float, rate_hz: float) -> Floats:
    """Second-order section (1, 6); a stream asks for the same ones again and again."""
    from scipy.signal import butter

    return np.asarray(butter(2, min(0.99, cutoff_hz / (0.5 * rate_hz)), output="sos"))


def low_pass(x: Floats, cutoff_hz: float, rate_hz: float, pad: int | None = None) -> Floats:
    """Butterworth of second order forwards and backwards along the last axis of x (..., n).

    Parameters
    ----------
    pad : samples by which the ends are continued, None = `PAD_S`.
    """
    if x.ndim > 1 and x.size > AT_ONCE:
        slow = np.empty(x.shape)
        for i in range(len(x)):
            slow[i] = low_pass(x[i], cutoff_hz, rate_hz, pad)
        return slow
    from scipy.signal import sosfiltfilt

    reach = round(PAD_S * rate_hz) if pad is None else pad
    return np.asarray(sosfiltfilt(_design(cutoff_hz, rate_hz), x, padlen=min(x.shape[-1] - 1, reach)))
