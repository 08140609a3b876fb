"""Signals of a late sensor laid on the axis by the times they were measured at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.frames import Floats
from core.recording import SensorSignals
from core.timeline.grid import lay_signal
from core.timeline.params import TimelineParams


def take_lag_out(
    signals: SensorSignals, t_s: Floats, lag_s: Floats, rate_hz: float, params: TimelineParams
) -> SensorSignals:
    """Lay a sensor that is late by lag_s (n,) at its own samples where they belong.

    Samples are interpolated as those of any sensor whose times do not fall on the axis
    (docs/science/timeline.md, "Rule"); where the shift leaves none, the sensor is not valid.
    """
    ok, n = signals.valid, len(t_s)
    own = np.asarray(t_s - lag_s)[ok]
    if not len(own):
        return signals
    with_mag = signals.mag is not None
    x = np.concatenate(
        (signals.acc, signals.gyr) + ((signals.mag,) if signals.mag is not None else ()), axis=1
    )[ok]
    laid, valid, filled = lay_signal(own, x, float(t_s[0]), n, rate_hz, rate_hz, params)
    valid &= (t_s >= own[0]) & (t_s <= own[-1])
    nearest = np.clip(np.round((t_s + lag_s - t_s[0]) * rate_hz).astype(int), 0, n - 1)
    return replace(
        signals,
        acc=laid[0],
        gyr=laid[1],
        mag=laid[2] if with_mag else None,
        valid=valid,
        interpolated=(filled | signals.interpolated[nearest]) & valid,
    )
