"""One foot's clock against the other's: both feet's contacts shake the lower back alike.

A contact reaches the lower back after the same time whichever foot lands. Where the mean shake around the
contacts of one foot comes later than around those of the other, their clocks differ by that. A limp changes
its shape and hardly its time, and unlike the double supports it leaves clean patients alone
(docs/science/consistency.md, "One late foot").
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.consistency.doubt import LATE_FOOT, Doubt
from sagittal.core.errors import Notice
from sagittal.core.events.result import GaitEvents
from sagittal.core.frames import FOOT, SIDES, Floats, Side
from sagittal.core.message import Message
from sagittal.core.rotation import find_lengths
from sagittal.core.signals.recording import SensorSignals

LEAST_S: Final = 0.018
"""Least difference that is reported. Clean recordings reach 0.013 s (subject 13 of ipol_walks, a simulated
drop foot)."""
SCATTER: Final = 2.0
"""Least ratio of a difference to its standard deviation."""
ALIKE: Final = 0.6
"""Least correlation of both shakes; a lower one says nothing about time."""
AROUND_S: Final = 0.3
FURTHEST_S: Final = 0.15
LEAST_CONTACTS: Final = 6
"""Contacts of each foot."""
PARTS: Final = 4
"""The standard deviation is that of as many means without one part of the contacts (jackknife)."""


@dataclass(frozen=True)
class ContactEcho:
    """Time by which the right foot seems late, s, its standard deviation, correlation of both shakes."""

    lag_s: float
    sd_s: float
    alike: float


def measure_echo(pelvis: SensorSignals, events: GaitEvents, rate_hz: float) -> ContactEcho | None:
    """Compare the shake of the lower back around the contacts of both feet; None with too few contacts.

    Parameters
    ----------
    pelvis : on the common axis that begins at 0 s, at rate_hz.
    """
    around = int(AROUND_S * rate_hz)
    shake = find_lengths(pelvis.acc)
    lost = np.concatenate(([0], np.cumsum(~pelvis.valid)))
    parts: dict[Side, Floats] = {}
    for side in SIDES:
        samples = np.round(np.array(events.times(side, "ic")) * rate_hz).astype(np.int64)
        samples = samples[(samples >= around) & (samples + around < len(shake))]
        samples = samples[lost[samples + around + 1] == lost[samples - around]]
        if len(samples) < LEAST_CONTACTS:
            return None
        parts[side] = shake[samples[:, None] + np.arange(-around, around + 1)]
    most = round(FURTHEST_S * rate_hz)
    # a contact that is stamped late sees its shake early
    lag, alike = _find_lag(np.median(parts["right"], axis=0), np.median(parts["left"], axis=0), most)
    without = []
    for k in range(PARTS):
        right, left = (np.median(np.delete(parts[s], np.s_[k::PARTS], 0), axis=0) for s in SIDES[::-1])
        without.append(_find_lag(right, left, most)[0])
    sd = float(np.std(without)) * float(np.sqrt(PARTS - 1))
    return ContactEcho(lag / rate_hz, sd / rate_hz, alike)


def judge_echo(pelvis: SensorSignals, events: GaitEvents, rate_hz: float) -> Doubt | None:
    """Doubt about a clock offset of one foot; None if the feet are synchronous or walked too little."""
    echo = measure_echo(pelvis, events, rate_hz)
    if echo is None or echo.alike < ALIKE or abs(echo.lag_s) < max(LEAST_S, SCATTER * echo.sd_s):
        return None
    late: Side = "right" if echo.lag_s > 0 else "left"
    return Doubt(
        Notice(
            LATE_FOOT,
            Message(
                "Contacts of the {side} foot shake the lower back {ms:.0f} ± {sd:.0f} ms before they "
                "are timed: "
                "the clock of that foot is late. Parameters that combine both feet are not reported. "
                "Synchronise the sensors and record again.",
                side=late,
                ms=1000 * abs(echo.lag_s),
                sd=2000 * echo.sd_s,
            ),
            FOOT[late],
        ),
        "between_feet",
    )


def _find_lag(x: Floats, y: Floats, most: int) -> tuple[float, float]:
    """Samples by which y (n,) is later than x (n,), by a parabola through the peak; correlation there."""
    x, y = ((z - z.mean()) / max(float(z.std()), 1e-9) for z in (x, y))
    n = len(x)
    lags: NDArray[np.int64] = np.arange(-most, most + 1)
    c = np.array(
        [float(np.mean(x[max(0, -k) : n - max(0, k)] * y[max(0, k) : n - max(0, -k)])) for k in lags]
    )
    i = int(np.argmax(c))
    if 0 < i < len(c) - 1:
        bent = c[i - 1] - 2.0 * c[i] + c[i + 1]
        return float(lags[i] + 0.5 * (c[i - 1] - c[i + 1]) / min(bent, -1e-12)), float(c[i])
    return float(lags[i]), float(c[i])
