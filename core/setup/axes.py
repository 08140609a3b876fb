"""Consistency of axes and signs between a gyroscope and its accelerometer.

A sensor tilts between a rest and the adjacent walking. Rotated by the gyroscope, gravity measured at rest
must match the mean specific force over some strides, because the body's own acceleration averages to zero
over strides. All 48 permutations and signs of the gyroscope axes, and two units, can thus be tested
independently of the sensor-to-segment alignment.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from math import degrees, radians
from typing import Final

import numpy as np

from sagittal.core.agreement.terms import find_bias
from sagittal.core.frames import Bools, Floats
from sagittal.core.fusion.attitude import AttitudeParams, AttitudeState, advance
from sagittal.core.rotation import rotate
from sagittal.core.setup.params import SetupParams
from sagittal.core.signals.recording import SensorSignals
from sagittal.core.signals.rest import find_runs, measure_quietness

CHOICES: Final[Floats] = np.array(
    [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    + [factor * np.eye(3) for factor in (radians(1.0), degrees(1.0))]
)
"""What rates may have to be multiplied by (50, 3, 3): the 48 signed permutations, as they are first, and the
factors between the two units."""

REVERSED: Final = 7
"""The one of them that turns all three signs round."""

RIGID: Final = AttitudeParams(kp=0.0)
"""Gravity is carried by the gyroscope alone."""

REST_S: Final = 0.5
"""At rest gravity is the mean of so long beside the walking."""

SHAKING: Final = 1.0
"""Standard deviation of |f| that only a moving body shows, m/s² (core/quality/suspicion.py)."""


@dataclass(frozen=True, eq=False)
class AxesFit:
    """How well a gyroscope matches its accelerometer.

    Parameters
    ----------
    windows : number of averaging windows. stated : RMS misfit of the rates as declared, m/s².
    misfits : (50,) of all `CHOICES`, None if no alternative fits clearly better.
    """

    windows: int
    stated: float
    misfits: Floats | None = None


def fit_axes(signals: SensorSignals, rate_hz: float, params: SetupParams) -> AxesFit | None:
    """Compare the declared gyroscope axes with all alternatives if they fit poorly; None with too little
    data.
    """
    quiet = measure_quietness(signals, rate_hz)
    windows = _list_windows(signals, quiet.quiet, rate_hz, params)
    if len(windows) < params.least_windows:
        return None
    walks = _list_walks(signals, windows, find_bias(signals, rate_hz, quiet))
    stated = _measure(walks, rate_hz)
    if stated <= params.misfit_mps2:
        return AxesFit(len(windows), stated)
    limit = stated / params.misfit_ratio
    if all(_measure(walks, rate_hz, C, limit) >= limit for C in CHOICES[1:]):
        return AxesFit(len(windows), stated)
    alternatives = [_measure(walks, rate_hz, C) for C in CHOICES[1:]]
    return AxesFit(len(windows), stated, np.array([stated, *alternatives]))


def refuses_choice(signals: SensorSignals, rate_hz: float, choice: Floats, params: SetupParams) -> bool:
    """Whether a sensor's data rule out one of `CHOICES` required by other sensors of the same export."""
    quiet = measure_quietness(signals, rate_hz)
    windows = _list_windows(signals, quiet.quiet, rate_hz, params)
    if len(windows) < params.least_windows:
        return False
    walks = _list_walks(signals, windows, find_bias(signals, rate_hz, quiet))
    stated, chosen = _measure(walks, rate_hz), _measure(walks, rate_hz, choice)
    return chosen > params.misfit_mps2 and chosen > params.distinct * stated


@dataclass(frozen=True)
class _Window:
    """A rest and the adjacent walking.

    Parameters
    ----------
    order : samples from the rest into the walking, possibly backwards in time. still : samples of the rest.
    part : averaged samples of `order`.
    """

    order: slice
    still: slice
    part: slice


def _list_windows(signals: SensorSignals, quiet: Bools, rate_hz: float, params: SetupParams) -> list[_Window]:
    """Averaging windows in walking that are connected to a rest without lost samples."""
    length, rest_samples = round(params.sample_s * rate_hz), round(REST_S * rate_hz)
    windows = []
    for a, b in (r for r in find_runs(quiet) if r[1] - r[0] >= rest_samples):
        for begin_s in params.begins_s:
            first = round(begin_s * rate_hz)
            reach, part = first + length, slice(first, first + length)
            if b + reach <= len(quiet):
                windows.append(_Window(slice(b, b + reach), slice(b - rest_samples, b), part))
            if a - reach >= 0:
                end = a - reach - 1
                windows.append(
                    _Window(slice(a - 1, end if end >= 0 else None, -1), slice(a, a + rest_samples), part)
                )
    return [w for w in windows if signals.valid[w.order].all() and _moves(signals, w, params)]


def _moves(signals: SensorSignals, window: _Window, params: SetupParams) -> bool:
    """Whether a sensor moves; varying force counts too, since a gyroscope in the wrong unit may appear
    still.
    """
    gyr, acc = (signals.cut(name, window.order)[window.part] for name in ("gyr", "acc"))
    rate, shaking = np.sqrt((gyr**2).sum(axis=1).mean()), np.linalg.norm(acc, axis=1).std()
    return bool(rate > params.least_rate or shaking > SHAKING)


@dataclass(frozen=True, eq=False)
class _Walk:
    """Data of a sensor from a rest into the adjacent walking, forwards or backwards in time.

    Parameters
    ----------
    rate : (n, 3) rad/s, without bias. force : (n, 3) m/s². part : averaged samples. weights : of these.
    level : (3,) mean force at rest, m/s².
    """

    rate: Floats
    force: Floats
    part: slice
    weights: Floats
    level: Floats


def _list_walks(signals: SensorSignals, windows: list[_Window], bias: Floats) -> list[_Walk]:
    walks = []
    for window in windows:
        step = -1.0 if window.order.step else 1.0
        rate = step * (signals.cut("gyr", window.order) - bias)
        force = np.ascontiguousarray(signals.cut("acc", window.order))
        weights = np.hanning(window.part.stop - window.part.start + 2)[1:-1]
        level = signals.cut("acc", window.still).mean(axis=0)
        walks.append(_Walk(rate, force, window.part, weights, level))
    return walks


def _measure(walks: list[_Walk], rate_hz: float, choice: Floats = CHOICES[0], limit: float = np.inf) -> float:
    """RMS difference between gravity at rest and the mean force rotated back to it, m/s²; inf above a
    limit.
    """
    total = 0.0
    for walk in walks:
        rate, force, part = walk.rate @ choice.T, walk.force, walk.part
        level = AttitudeState(np.array([1.0, 0.0, 0.0, 0.0]), rate[0])
        q, _ = advance(level, rate, force, np.ones(len(force), np.bool_), rate_hz, 1.0, RIGID)
        carried = rotate(q[part], force[part])
        off = walk.weights @ carried / walk.weights.sum() - walk.level
        total += float(off @ off)
        if total > limit**2 * len(walks):
            return np.inf
    return float(np.sqrt(total / len(walks)))
