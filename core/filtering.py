"""Zero-phase low-pass of whole signals."""

from __future__ import annotations

from typing import Final

import numpy as np

from core.frames import Floats

PAD_S: Final = 2.0
"""Both ends of a signal are continued by their point reflection over so long, or its length."""


def low_pass(x: Floats, cutoff_hz: float, rate_hz: float, pad: int | None = None) -> Floats:
    """Butterworth of second order forwards and backwards along the last axis of x (..., n).

    Parameters
    ----------
    pad : samples by which the ends are continued, None = `PAD_S`.
    """
    from scipy.signal import butter, sosfiltfilt

    sos = butter(2, min(0.99, cutoff_hz / (0.5 * rate_hz)), output="sos")
    reach = round(PAD_S * rate_hz) if pad is None else pad
    return np.asarray(sosfiltfilt(sos, x, padlen=min(x.shape[-1] - 1, reach)))
