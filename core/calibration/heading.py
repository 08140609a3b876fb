"""The direction of walking in each sensor's own world frame, from its accelerometer and gyroscope alone.

Horizontal vectors are complex numbers x + iy. Every sensor has its own z-up world frame with arbitrary
heading; the direction of walking is what all sensors have in common (docs/science/calibration.md, "Direction
of walking").

Measures, all over the straight parts of a walk, each rotated back by the change of direction since the first:
- rest-to-rest velocity with linear drift removal: ≤ 2° on a short walk out and back; for a foot every stride
  is from rest to rest;
- principal axis of the horizontal acceleration below 4 Hz: legs ≤ 3.4°, any length of walk, without a sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Floats
from sagittal.core.rotation import rotate, wrap_angle
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.rest import Window

Complexes = NDArray[np.complex128]
Part = tuple[int, int]

STEP_BAND_HZ: Final = (0.8, 4.0)
"""Band in which a trunk's forward and vertical accelerations are compared: steps of 0.3 to 1.2 s."""

LONGEST_STRIDE_S: Final = 2.5
"""Flat moments of a foot further apart are no stride (our choice: the slowest of patients)."""


@dataclass(frozen=True)
class HeadingParams:
    """Estimation of walking directions.

    Parameters
    ----------
    cutoff_hz : low-pass of the acceleration before its principal axis
        (docs/science/calibration.md, "Parameters").
    longest_velocity_s : longest time between two rests over which velocity is integrated, s. If linear drift
    removal leaves 10 % of an accelerometer bias of 0.05 m/s², the direction of a 1 m/s walk is off by 7°
    after 25 s.
    start_s : part of the walk next to a rest used to average the velocity for a sign, s. leg_gap_s,
    trunk_gap_s : longest time between rest and straight part for this. Legs can also use the gait rule; a
    trunk has no other evidence, and with a bias of 0.05 m/s² the sign of 1 m/s is right for 8 s.
    speed : plausible walking speed, m/s.
    coherence : minimum agreement of the velocities of the parts, 0 to 1.
    reach_s : parts that start further from the rest are ignored because heading drifts.
    pendulum : minimum agreement to accept a pelvis sign (`pendulum_agreement`). In 24 real recordings of six
    people it is .60 to .86; simulated people, whose pelvis has no dynamics, reach .44 with either sign.
    """

    cutoff_hz: float = 4.0
    longest_velocity_s: float = 40.0
    start_s: float = 3.5
    leg_gap_s: float = 1.5
    trunk_gap_s: float = 5.0
    speed: tuple[float, float] = (0.15, 3.0)
    coherence: float = 0.8
    reach_s: float = 60.0
    pendulum: float = 0.5


@dataclass(frozen=True)
class WalkingDirection:
    """A direction of walking in a sensor's world frame.

    Parameters
    ----------
    angle : rad from x towards y. score : 0 to 1; for a velocity: agreement of the parts, |Σ v| / Σ |v|; for
    an axis: share of the larger principal component minus that of the smaller. speed_mps : of a velocity, 0
    for an axis.
    """

    angle: float
    score: float
    speed_mps: float = 0.0


def horizontal_acceleration(q: Floats, acc: Floats) -> Complexes:
    """Horizontal acceleration (n,), m/s², from orientations q (n, 4) and specific force acc (n, 3)."""
    f = rotate(q, acc)
    return np.asarray(f[:, 0] + 1j * f[:, 1])


def rest_to_rest_velocity(a: Complexes, rests_at_end: bool, rate_hz: float) -> Complexes:
    """Velocity (n,) in m/s since a rest; if it also ends in a rest, its linear drift is removed."""
    v = np.cumsum(a) / rate_hz
    u = np.linspace(0.0, 1.0, len(v)) if rests_at_end else np.zeros(len(v))
    return np.asarray(v - u * v[-1])


def velocity_direction(
    v: Complexes, offset: int, parts: list[Part], bearing: list[float], params: HeadingParams
) -> WalkingDirection | None:
    """Direction of the mean velocity over the parts, each rotated back by its bearing; None if implausible.

    For a walk out and back this is mean(out) − mean(back), in which a constant velocity error cancels.

    Parameters
    ----------
    v : (m,) velocity, its first sample at index `offset` of the axis.
    """
    means, weights = [], []
    for (start, end), turn in zip(parts, bearing, strict=True):
        piece = v[max(0, start - offset) : max(0, end - offset)]
        if len(piece):
            means.append(piece.mean() * np.exp(-1j * turn))
            weights.append(len(piece))
    if not means:
        return None
    m, w = np.array(means), np.array(weights)
    total, path = (m * w).sum() / w.sum(), (np.abs(m) * w).sum() / w.sum()
    coherence = float(np.abs(total) / path)
    if not params.speed[0] <= np.abs(total) <= params.speed[1] or coherence < params.coherence:
        return None
    return WalkingDirection(float(np.angle(total)), coherence, float(np.abs(total)))


def stride_direction(
    a: Complexes,
    flats: NDArray[np.int64],
    parts: list[Part],
    bearing: list[float],
    rate_hz: float,
    params: HeadingParams,
) -> WalkingDirection | None:
    """Direction of a foot's mean velocity between foot-flat moments; None if implausible.

    A flat foot is momentarily at rest, so every stride starts and ends with zero velocity.

    Parameters
    ----------
    flats : (m,) samples at which the foot is flat.
    """
    v = np.zeros(len(a), np.complex128)
    strides: list[Part] = []
    turns: list[float] = []
    for (start, end), turn in zip(parts, bearing, strict=True):
        for first, last in pairwise(flats[(flats >= start) & (flats < end)].tolist()):
            if last - first <= LONGEST_STRIDE_S * rate_hz:
                v[first:last] = rest_to_rest_velocity(a[first:last], True, rate_hz)
                strides.append((first, last))
                turns.append(turn)
    return velocity_direction(v, 0, strides, turns, params)


def start_direction(
    a: Complexes,
    still_window: Window,
    part: Part,
    turn: float,
    leads: bool,
    rate_hz: float,
    longest_gap_s: float,
    params: HeadingParams,
) -> WalkingDirection | None:
    """Direction from the velocity gained since a rest (or lost until it), accurate enough for a sign.

    Parameters
    ----------
    part : the straight part next to the rest, turned by `turn` rad since standing. leads : the rest precedes
    it. longest_gap_s : longest time between them for a reliable sign.

    Returns
    -------
    None if rest and part are further apart than that, or the speed is implausible.
    """
    edge = round(still_window[1] * rate_hz) if leads else round(still_window[0] * rate_hz)
    gap = (part[0] - edge) if leads else (edge - part[1])
    if gap > longest_gap_s * rate_hz:
        return None
    reach = max(0, gap) + round(params.start_s * rate_hz)
    if leads:
        first, used = edge, (max(part[0], edge), min(part[1], edge + reach))
        v = rest_to_rest_velocity(a[edge : edge + reach], False, rate_hz)
    else:
        first, used = max(0, edge - reach), (max(part[0], edge - reach), min(part[1], edge))
        v = -rest_to_rest_velocity(a[first:edge][::-1], False, rate_hz)[::-1]
    if used[1] - used[0] < 0.5 * rate_hz:
        return None
    return velocity_direction(v, first, [used], [turn], params)


def acceleration_axis(
    a: Complexes,
    parts: list[Part],
    bearing: list[float],
    rate_hz: float,
    params: HeadingParams,
    steps_s: list[float] | None = None,
) -> WalkingDirection:
    """Principal axis of the low-passed horizontal acceleration, angle mod π.

    Parameters
    ----------
    steps_s : step time in each part for a trunk sensor: a(t) + a(t + step) retains the forward component
    common to both steps, while lateral sway, which alternates with every step, cancels. None for the legs.
    """
    power, moment = 0.0, 0j
    for (start, end), turn, step_s in zip(parts, bearing, steps_s or [0.0] * len(parts), strict=True):
        shift = round(step_s * rate_hz)
        if steps_s and any(steps_s) and not shift:
            continue
        piece = np.stack((a[start:end].real, a[start:end].imag))
        smooth = low_pass(piece, params.cutoff_hz, rate_hz, pad=30)
        x = (smooth[0] + 1j * smooth[1]) * np.exp(-1j * turn)
        if 0 < shift < len(x) // 2:
            x = x[:-shift] + x[shift:]
        x = x - x.mean()
        # Σ x² is the second moment about the axis: its phase is twice the axis angle
        moment += (x**2).sum()
        power += float((np.abs(x) ** 2).sum())
    return WalkingDirection(0.5 * float(np.angle(moment)), float(np.abs(moment) / max(power, 1e-12)))


def step_time(up: Floats, rate_hz: float) -> float:
    """Step time in s from the vertical acceleration (n,) of the trunk over a straight part, 0 if
    undetermined.

    The first peak of the autocorrelation between 0.3 and 1.2 s, the range of walking, that is nearly as high
    as the highest one, which may be the stride.
    """
    low, high = round(0.3 * rate_hz), round(1.2 * rate_hz)
    x = up - up.mean()
    if len(x) < 2 * high:
        return 0.0
    r = np.array([x[: len(x) - k] @ x[k:] / (len(x) - k) for k in range(high + 2)])
    peaks = [k for k in range(low, high + 1) if r[k] >= r[k - 1] and r[k] > r[k + 1] and r[k] > 0]
    if not peaks:
        return 0.0
    best = max(r[k] for k in peaks)
    return next(k for k in peaks if r[k] >= 0.7 * best) / rate_hz


def pendulum_agreement(
    a: Complexes,
    up: Floats,
    angle: float,
    parts: list[Part],
    bearing: list[float],
    rate_hz: float,
    steps_s: list[float],
) -> float:
    """Agreement of a direction with the forward direction of a trunk in inverted-pendulum gait, −1 to 1; 0 =
    undetermined.

    A walking trunk is slowest where it is highest (Cavagna et al. 1977), so its forward acceleration follows
    the rate of change of its vertical acceleration: their correlation at step frequency, both averaged with
    themselves one step later.

    Parameters
    ----------
    a, up : (n,) horizontal acceleration in the sensor's world and vertical specific force, m/s².
    steps_s : step time in each part, 0 = undetermined.
    """
    covariance, own, rise = 0.0, 0.0, 0.0
    for (start, end), turn, step_s in zip(parts, bearing, steps_s, strict=True):
        shift = round(step_s * rate_hz)
        if not 0 < shift < (end - start) // 2:
            continue
        ahead = (a[start:end] * np.exp(-1j * (angle + turn))).real
        x, y = (_around_steps(v, rate_hz) for v in (ahead, up[start:end]))
        y = np.gradient(y)
        x, y = x[:-shift] + x[shift:], y[:-shift] + y[shift:]
        x, y = x - x.mean(), y - y.mean()
        covariance, own, rise = covariance + float(x @ y), own + float(x @ x), rise + float(y @ y)
    return covariance / float(np.sqrt(own * rise)) if own * rise > 0.0 else 0.0


def _around_steps(x: Floats, rate_hz: float) -> Floats:
    """The part (n,) of a signal in a band around step frequency."""
    low, high = STEP_BAND_HZ
    return np.asarray(low_pass(x, high, rate_hz) - low_pass(x, low, rate_hz))


def nearest_sign(axis: float, towards: float) -> float:
    """Of axis and axis + π the one nearer to a direction, rad in [−π, π)."""
    turned = axis if abs(wrap_angle(axis - towards)) <= pi / 2 else axis + pi
    return wrap_angle(turned)


def subtract_angles(a: float, b: float) -> float:
    """Angle a − b in rad, [−π, π)."""
    return wrap_angle(a - b)
