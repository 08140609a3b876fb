"""Basic properties of one sensor's signals that do not require a rest window of the whole recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.rotation import find_lengths, find_squares
from sagittal.core.signals.held_samples import is_complete
from sagittal.core.signals.recording import ImuStream
from sagittal.core.signals.rest import find_runs

STILL: Final = 0.03
"""A second is still when acc varies less than this share of its mean (0.25 m/s²:
docs/science/quality.md, "Stillness of one sensor")."""
TURNING: Final = 0.0625
"""Variance of the rate of a turning body, of its mean square: a quarter of the rate [our choice]."""
SMOOTH: Final = 0.3
"""Largest roughness of a movement (1 = noise); walking trunks have .1 and less [our choice]."""
PLATEAU: Final = 3
"""Neighbouring samples at the largest value that make a plateau: noise does not repeat it [our choice]."""
RANGES: Final = (
    *(g * GRAVITY for g in (2, 4, 8, 16)),
    *(float(np.radians(d)) for d in (250, 500, 1000, 2000)),
)
"""Full scales that wearables are set to, m/s² and rad/s."""
CROWD: Final = 5
"""Samples within 1 % of a largest value that is itself within 1 % of a full scale: clipped, then calibrated,
so that the plateau is no longer exact (gaitmap_foot: 6 samples at 155.9 to 157.2 m/s²) [our choice]."""


@dataclass(frozen=True)
class Facts:
    """Signal properties of a sensor.

    Parameters
    ----------
    still : the quietest second is quiet enough for standing (in any unit).
    still_norm : mean |acc| in the quietest second, m/s² if the unit is right.
    still_gyro : minimum mean |ω| of all seconds with still acc: the person may turn on the spot in the
        quietest one.
    still_slice : samples of that second.
    median_norm, acc_std : median and standard deviation of |acc| over the recording.
    gyro_top : 99.9th percentile of |ω|, rad/s, None without gyroscope.
    """

    still: bool
    still_norm: float
    still_gyro: float | None
    still_slice: slice
    median_norm: float
    acc_std: float
    gyro_top: float | None


_known: Final = WeakKeyDictionary[ImuStream, Facts]()


def measure_stream(stream: ImuStream) -> Facts:
    """Measure a sensor as read; results are cached per stream."""
    if stream not in _known:
        _known[stream] = measure_signal(stream.acc, stream.gyr, stream.rate_hz)
    return _known[stream]


def measure_signal(acc: Floats, gyr: Floats | None, rate_hz: float) -> Facts:
    """Measure a sensor; rows with a missing value are ignored.

    Parameters
    ----------
    acc : (n, 3). gyr : (n, 3) or None. At least one complete row.
    """
    good = np.flatnonzero(is_complete(acc))
    a = acc[good]
    norm = find_lengths(a)
    width = int(min(len(a), max(2, round(rate_hz))))
    # axis by axis: of a day each array is half a gigabyte
    mean, spread, middle = np.empty((3, len(a) - width + 1)), np.zeros(len(a) - width + 1), a.mean(axis=0)
    for axis in range(3):
        row = a[:, axis].copy()
        mean[axis] = _moving_mean(row, width)
        row -= middle[axis]
        spread += _moving_mean(row**2, width) - _moving_mean(row, width) ** 2
    del a, row
    spread = np.sqrt(np.maximum(spread, 0.0))
    k = int(np.argmin(spread))
    window = slice(k, k + width)
    still_norm = float(norm[window].mean())
    calm = np.union1d([k], np.flatnonzero(spread < STILL * np.sqrt((mean**2).sum(axis=0))))
    still = bool(spread[k] < STILL * np.linalg.norm(mean[:, k]))
    del mean, spread
    speed = None if gyr is None else find_lengths(gyr)
    if gyr is not None:
        calm = _without_turns(gyr[good], calm, width)
    finite = None if speed is None else speed[np.isfinite(speed)]
    return Facts(
        still=still,
        still_norm=still_norm,
        still_gyro=None if speed is None else _least(speed[good], calm, width),
        still_slice=slice(int(good[window][0]), int(good[window][-1]) + 1),
        median_norm=float(np.median(norm)),
        acc_std=float(norm.std()),
        gyro_top=None if finite is None or not len(finite) else float(np.percentile(finite, 99.9)),
    )


def _without_turns(gyr: Floats, starts: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """The windows without rotation of the sensor: a slowly rotating trunk has a steady force.

    A bias is constant and noise changes from sample to sample (mean square of differences, von Neumann 1941,
    over twice the variance: 1); the turning rate of a body changes smoothly (0.1 and less).
    """
    total = np.concatenate((np.zeros((1, 3)), np.cumsum(gyr, axis=0)))
    square = np.concatenate(([0.0], np.cumsum(find_squares(gyr))))
    jump = np.concatenate(([0.0, 0.0], np.cumsum(find_squares(np.diff(gyr, axis=0)))))
    ends = starts + width
    mean = (total[ends] - total[starts]) / width
    level = find_squares(mean)
    variance = (square[ends] - square[starts]) / width - level
    rough = (jump[ends] - jump[starts + 1]) / max(1, width - 1)
    smooth = (variance > TURNING * level) & (rough < SMOOTH * 2.0 * variance)
    return starts[~smooth] if np.isfinite(square[-1]) else starts


def _least(speed: Floats, starts: NDArray[np.int64], width: int) -> float | None:
    """Minimum mean speed of the windows that begin at `starts`; missing samples are ignored."""
    is_finite = np.isfinite(speed)
    total = np.concatenate(([0.0], np.cumsum(np.where(is_finite, speed, 0.0))))
    count = np.concatenate(([0], np.cumsum(is_finite)))
    n = count[starts + width] - count[starts]
    if not n.any():
        return None
    return float(((total[starts + width] - total[starts])[n > 0] / n[n > 0]).min())


def saturation(x: Floats, floor: float) -> tuple[float, float | None]:
    """Fraction of samples on a plateau at the largest value of an axis, and that value.

    Parameters
    ----------
    x : (n, 3). floor : an axis with a smaller maximum cannot be at its range limit.

    Returns
    -------
    Fraction (0 to 1) of samples with any axis clipped, largest clipped value or None.
    """
    clipped = np.zeros(len(x), np.bool_)
    value: float | None = None
    for axis in np.nan_to_num(x, nan=0.0, posinf=0.0, neginf=0.0).T:
        for signed in (axis, -axis):
            top = float(signed.max())
            if top < floor:
                continue
            at_top = signed >= top * (1 - 1e-6)
            crowd = signed >= 0.99 * top
            if any(abs(top / full - 1) < 0.01 for full in RANGES) and np.count_nonzero(crowd) >= CROWD:
                clipped |= crowd
                value = max(top, value or 0.0)
            for start, end in find_runs(at_top):
                if end - start >= PLATEAU:
                    clipped[start:end] = True
                    value = max(top, value or 0.0)
    return float(clipped.mean()), value


def magnetic_share(mag: Floats, still: slice, limit: float) -> float | None:
    """Fraction of samples of mag (n, 3) whose |m| differs from its norm at rest by more than `limit`
    (fraction).

    None without a magnetometer reading at rest. Source: docs/science/quality.md, "Magnetic field".
    """
    norm = find_lengths(mag)
    rest_norms = norm[still]
    rest_norms = rest_norms[np.isfinite(rest_norms)]
    finite = norm[np.isfinite(norm)]
    if not len(rest_norms) or not len(finite) or np.median(rest_norms) <= 0:
        return None
    return float(np.mean(np.abs(finite / np.median(rest_norms) - 1.0) > limit))


def _moving_mean(x: Floats, width: int) -> Floats:
    """Means (n − width + 1,) of every full window of x (n,)."""
    centre = np.cumsum(x)[-1] / len(x)
    total = np.zeros(len(x) + 1)
    np.cumsum(x - centre, out=total[1:])
    mean = total[width:] - total[:-width]
    mean /= width
    mean += centre
    return np.asarray(mean)
