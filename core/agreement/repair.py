"""Correction of the signals of late sensors by a time shift, and of slipped sensors by a rotation."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from sagittal.core.agreement.slips import SensorSlip
from sagittal.core.frames import Floats
from sagittal.core.rotation import exp, rotate
from sagittal.core.signals.recording import SensorSignals
from sagittal.core.signals.rest import Window
from sagittal.core.timeline.grid import lay_signal
from sagittal.core.timeline.params import TimelineParams


def take_lag_out(
    signals: SensorSignals, t_s: Floats, lag_s: Floats, rate_hz: float, params: TimelineParams
) -> SensorSignals:
    """Shift the samples of a sensor that is late by lag_s (n,) to their correct times.

    Samples are interpolated like those of any sensor whose times do not coincide with the axis
    (docs/science/timeline.md, "Rule"); samples without data after the shift are invalid.
    """
    ok, n = signals.valid, len(t_s)
    own = np.asarray(t_s - lag_s)[ok]
    if not len(own):
        return signals
    with_mag = signals.mag is not None
    x = np.concatenate(
        (signals.acc, signals.gyr) + ((signals.mag,) if signals.mag is not None else ()), axis=1
    )[ok]
    resampled, valid, filled = lay_signal(own, x, float(t_s[0]), n, rate_hz, rate_hz, params)
    valid &= (t_s >= own[0]) & (t_s <= own[-1])
    nearest = np.clip(np.round((t_s + lag_s - t_s[0]) * rate_hz).astype(int), 0, n - 1)
    return replace(
        signals,
        acc=resampled[0],
        gyr=resampled[1],
        mag=resampled[2] if with_mag else None,
        valid=valid,
        interpolated=(filled | signals.interpolated[nearest]) & valid,
    )


SLIPPING_S: Final = 0.3
"""A slip takes about so long; its turn is spread over this time."""


def turn_back(signals: SensorSignals, t_s: Floats, slip: SensorSlip) -> SensorSignals:
    """Rotate the signals of a sensor back after a slip, and remove the slip itself from its rate.

    The gyroscope measured that rotation; left in, the integrated orientation would be wrong by the slip.
    """
    turn = slip.turn_rad * np.array(slip.axis)
    slipped = t_s >= slip.at_s
    slipping = slipped & (t_s < slip.at_s + SLIPPING_S)
    back = exp(-turn)

    def turned(x: Floats) -> Floats:
        return np.where(slipped[:, None], rotate(back, x), x)

    # a turn of the sensor by r shows −r in its rate
    lasting_s = np.count_nonzero(slipping) * float(t_s[1] - t_s[0])
    gyr = turned(signals.gyr) + slipping[:, None] * turn / max(lasting_s, 1e-9)
    mag = None if signals.mag is None else turned(signals.mag)
    return replace(signals, acc=turned(signals.acc), gyr=gyr, mag=mag)


def leave_out(signals: SensorSignals, t_s: Floats, doubtful: Window) -> SensorSignals:
    """Mark a sensor invalid while its alignment is uncertain."""
    valid = signals.valid & ~((t_s >= doubtful[0]) & (t_s <= doubtful[1]))
    return signals.change(valid=valid, interpolated=signals.interpolated & valid)
