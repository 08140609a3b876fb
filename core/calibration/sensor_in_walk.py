"""Gyroscope bias, attitude and mean posture of a sensor from walking, without quiet standing.

Two constraints hold in every walk. Between two foot-flat moments the velocity begins and ends at zero, so the
mean specific force in a fixed frame is gravity; for other segments that is true on average over several
strides straight ahead. And in straight walking the heading is the same at both ends. A gyroscope bias
violates both; it is estimated as the value that satisfies them (docs/science/calibration.md, "Without
standing").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import FOOT, Bools, Floats, Segment
from sagittal.core.fusion.attitude import AttitudeParams, AttitudeState, advance, estimate_orientation
from sagittal.core.rotation import conjugate, find_squares, multiply, rotate, wrap_angle
from sagittal.core.signals.peaks import find_peaks
from sagittal.core.signals.recording import SensorSignals
from sagittal.core.signals.rest import find_runs

Indices = NDArray[np.int64]
Span = tuple[int, int]

UP = np.array([0.0, 0.0, 1.0])

PROBE = 1e-4
"""Change of the bias in rad/s over which the derivative is taken; the map is all but linear."""


@dataclass(frozen=True)
class WalkRungParams:
    """Calibration of sensors from walking alone (docs/science/calibration.md, "Without standing").

    Parameters
    ----------
    least_s : shortest walk used: about three strides (our choice).
    flat_apart_s : minimum time between two foot-flat moments. flat_mean_s : averaging time of the rate to
    detect them.
    flat_times, flat_rate : a foot-flat moment has a rate below the lower quartile times `flat_times` plus
    `flat_rate` (rad/s): foot-flat moments in ipol_walks have 4 to 30 °/s, the quietest moment of a swing 60
    and more.
    window_s : length of the Hann window for averaging specific force without foot-flat moments: strides of up
    to 1.5 s and all of their harmonics are attenuated by 30 dB or more.
    foot_sd, body_sd : deviation of the mean specific force from gravity between two foot-flat moments and in
    such a window, m/s² (measured on ipol_walks, neura_walk and qmt_fullbody: .03 to .6 and .4 to .9).
    bias_sd : of a gyroscope never observed at rest, rad/s (the sensors of those data sets have 0.1 to 2 °/s).
    heading_sd : of the heading at the ends of a straight part, rad (our choice: that of a step).
    """

    least_s: float = 4.0
    flat_apart_s: float = 0.6
    flat_mean_s: float = 0.1
    flat_times: float = 2.0
    flat_rate: float = radians(5.0)
    window_s: float = 3.0
    foot_sd: float = 0.2
    body_sd: float = 0.6
    bias_sd: float = radians(1.0)
    heading_sd: float = radians(4.0)


@dataclass(frozen=True, eq=False)
class SensorInWalk:
    """One sensor during walking.

    Parameters
    ----------
    q : (n, 4) sensor to its own z-up world frame. gyro_bias : (3,) rad/s. norm : mean |f|, m/s².
    flats : (m,) foot-flat samples; empty for other segments.
    """

    q: Floats
    gyro_bias: Floats
    norm: float
    flats: Indices


def find_flat_moments(gyr: Floats, walked: Bools, rate_hz: float, params: WalkRungParams) -> Indices:
    """Samples (m,) of foot-flat: minima of the foot's rate, at least one per stance.

    Parameters
    ----------
    gyr : (n, 3) rad/s. walked : (n,) walking with the sensor available.
    """
    from scipy.ndimage import uniform_filter1d

    width = max(2, round(params.flat_mean_s * rate_hz))
    # a running sum over zeros may round to less than zero
    rate = np.sqrt(np.maximum(uniform_filter1d(find_squares(gyr), width, mode="nearest"), 0.0))
    lows = find_peaks(-np.where(walked, rate, rate.max()), distance=params.flat_apart_s * rate_hz)
    lows = lows[walked[lows]]
    if not len(lows):
        return lows
    limit = params.flat_times * np.quantile(rate[lows], 0.25) + params.flat_rate
    return np.asarray(lows[rate[lows] < limit])


def follow_sensor(
    segment: Segment,
    signals: SensorSignals,
    walks: Sequence[Span],
    straight: Bools,
    rate_hz: float,
    attitude: AttitudeParams,
    params: WalkRungParams,
) -> SensorInWalk | None:
    """Bias and attitude of a sensor from the walk alone.

    Parameters
    ----------
    walks : index ranges of walking. straight : (n,) walking without turning, as far as known.

    Returns
    -------
    None if the sensor is available in no walk of at least `least_s`.
    """
    walked = np.zeros(len(signals.acc), np.bool_)
    for a, b in walks:
        walked[a:b] = True
    walked &= signals.valid
    runs = [r for r in find_runs(walked) if r[1] - r[0] >= params.least_s * rate_hz]
    if not runs:
        return None
    foot = segment in FOOT.values()
    flats = find_flat_moments(signals.gyr, walked, rate_hz, params) if foot else np.zeros(0, np.int64)
    bias = np.zeros(3)
    # the second pass has the turn of the sensor about the vertical right, the third changes nothing
    for _ in range(2):
        stretches = [_Stretch.integrate(signals, bias, r, flats, straight, rate_hz, params) for r in runs]
        bias = bias + _bias_step(stretches, signals, bias, straight, flats, rate_hz, params)
    stretches = [_Stretch.integrate(signals, bias, r, flats, straight, rate_hz, params) for r in runs]
    longest = max(stretches, key=lambda x: len(x.q))
    middle = longest.first + len(longest.q) // 2
    force = longest.forces.mean(axis=0)
    q_at = multiply(_level(force), longest.q[middle - longest.first])
    norm = float(np.linalg.norm(force))
    q = estimate_orientation(
        q_at, middle, signals.gyr - bias, signals.acc, signals.valid, rate_hz, norm, attitude
    )
    return SensorInWalk(q, bias, norm, flats)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """One uninterrupted walk of a sensor, integrated from its rates alone.

    Parameters
    ----------
    first : its first sample. q : (m, 4) sensor to the frame of its first sample. forces : (k, 3) mean
    specific force in that frame over spans in which it should equal gravity. inverse_sd : 1 / (m/s²) of each.
    """

    first: int
    q: Floats
    forces: Floats
    inverse_sd: float

    @classmethod
    def integrate(
        cls,
        signals: SensorSignals,
        bias: Floats,
        run: Span,
        flats: Indices,
        straight: Bools,
        rate_hz: float,
        params: WalkRungParams,
    ) -> _Stretch:
        a, b = run
        gyr = signals.gyr[a:b] - bias
        start = AttitudeState(np.array([1.0, 0.0, 0.0, 0.0]), gyr[0])
        free = AttitudeParams(kp=0.0)
        q, _ = advance(start, gyr, signals.acc[a:b], np.ones(b - a, np.bool_), rate_hz, 1.0, free)
        force = rotate(q, signals.acc[a:b])
        own = flats[(flats >= a) & (flats < b)] - a
        if len(own) >= 3:
            total = np.concatenate((np.zeros((1, 3)), np.cumsum(force, axis=0)))
            means = np.diff(total[own], axis=0) / np.diff(own)[:, None]
            return cls(a, q, means, 1.0 / params.foot_sd)
        width = min(round(params.window_s * rate_hz), b - a)
        taper = np.hanning(width + 2)[1:-1]
        taper /= taper.sum()
        starts = np.arange(0, b - a - width + 1, max(1, width // 2))
        clear = [i for i in starts if straight[a + i : a + i + width].all()]
        means = np.array([taper @ force[i : i + width] for i in (clear or starts)])
        return cls(a, q, means, 1.0 / params.body_sd)


def _bias_step(
    stretches: Sequence[_Stretch],
    signals: SensorSignals,
    bias: Floats,
    straight: Bools,
    flats: Indices,
    rate_hz: float,
    params: WalkRungParams,
) -> Floats:
    """Bias correction (3,) that aligns the mean forces within each stretch, and its heading.

    Least squares with the prior `bias_sd`, so that a short, uninformative walk changes little. Gravity
    carries no information about rotation around the vertical: there the bias is the mean turning rate
    straight ahead.
    """
    up = np.mean([rotate(conjugate(x.q), _direction(x)).mean(axis=0) for x in stretches], axis=0)
    up /= np.linalg.norm(up)
    horizontal = np.linalg.svd(up[None])[2][1:]
    rows, targets = [np.eye(2) / params.bias_sd], [-(horizontal @ bias) / params.bias_sd]
    for x in stretches:
        run = (x.first, x.first + len(x.q))
        change = []
        for axis in horizontal:
            moved = _Stretch.integrate(signals, bias + PROBE * axis, run, flats, straight, rate_hz, params)
            change.append((moved.forces - x.forces) / PROBE)
        J = np.stack(change, axis=-1)
        rows.append((J - J.mean(axis=0)) * x.inverse_sd)
        targets.append(-(x.forces - x.forces.mean(axis=0)).reshape(-1) * x.inverse_sd)
    A = np.concatenate([r.reshape(-1, 2) for r in rows])
    step = np.linalg.lstsq(A, np.concatenate(targets), rcond=None)[0] @ horizontal
    turned, time = _heading_drift(stretches, straight, rate_hz)
    weight = time**2 / params.heading_sd**2
    drift = float((weight * turned / np.maximum(time, 1e-9)).sum() / (weight.sum() + params.bias_sd**-2))
    # who walks round and round turns as a gyroscope with a bias would: no such bias is believed
    if abs(drift) > 2.0 * params.bias_sd:
        drift = 0.0
    return np.asarray(step + drift * up)


def _heading_drift(stretches: Sequence[_Stretch], straight: Bools, rate_hz: float) -> tuple[Floats, Floats]:
    """Heading change (k,) in rad between first and last third of each straight part, and the time between."""
    turned, time = [], []
    for x in stretches:
        # the turn since the first sample as the room sees it: its twist is the same for any mounting
        level = _level(_direction(x))
        turn = multiply(multiply(level, x.q), conjugate(level))
        heading = np.exp(2j * np.arctan2(turn[:, 3], turn[:, 0]))
        for a, b in find_runs(straight[x.first : x.first + len(x.q)]):
            edge = (b - a) // 3
            if edge < 0.5 * rate_hz:
                continue
            first, last = heading[a : a + edge].mean(), heading[b - edge : b].mean()
            turned.append(wrap_angle(float(np.angle(last * np.conj(first)))))
            time.append((b - a - edge) / rate_hz)
    return np.array(turned, np.float64), np.array(time, np.float64)


def _direction(stretch: _Stretch) -> Floats:
    force = stretch.forces.mean(axis=0)
    return np.asarray(force / np.linalg.norm(force))


def _level(force: Floats) -> Floats:
    """The shortest rotation (4,) that aligns a force (3,) with the vertical."""
    z = force / np.linalg.norm(force)
    axis = np.cross(z, UP)
    w = 1.0 + float(z @ UP)
    if w < 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0])
    q = np.array([w, *axis])
    return np.asarray(q / np.linalg.norm(q))
