"""Whether a gyroscope and its accelerometer have the same axes and signs.

Between a rest and the walking beside it a sensor tilts. Its gyroscope must carry gravity, as measured at
rest, to the mean specific force of some strides: over strides the body's own acceleration averages to
nothing. So all 48 ways to name and sign the axes of the gyroscope can be tried, and its two units; how the
sensor is mounted never enters.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from math import degrees, radians
from typing import Final

import numpy as np

from core.agreement.terms import find_bias
from core.frames import Bools, Floats
from core.fusion.attitude import AttitudeParams, AttitudeState, advance
from core.recording import SensorSignals
from core.rest import find_runs, measure_quietness
from core.rotation import rotate
from core.setup.params import SetupParams

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
    """How well a gyroscope goes with its accelerometer.

    Parameters
    ----------
    windows : averages it rests on. stated : RMS misfit of the rates as stated, m/s².
    misfits : (50,) of all `CHOICES`, None where no other fits that much better.
    """

    windows: int
    stated: float
    misfits: Floats | None = None


def fit_axes(signals: SensorSignals, rate_hz: float, params: SetupParams) -> AxesFit | None:
    """Compare the stated axes of a gyroscope, where they do not fit all others; None = nothing is said."""
    quiet = measure_quietness(signals, rate_hz)
    windows = _list_windows(signals, quiet.quiet, rate_hz, params)
    if len(windows) < params.least_windows:
        return None
    gyr = signals.gyr - find_bias(signals, rate_hz, quiet)
    stated = _measure(signals.acc, gyr, windows, rate_hz)
    if stated <= params.misfit_mps2:
        return AxesFit(len(windows), stated)
    limit = stated / params.misfit_ratio
    if all(_measure(signals.acc, gyr, windows, rate_hz, C, limit) >= limit for C in CHOICES[1:]):
        return AxesFit(len(windows), stated)
    others = [_measure(signals.acc, gyr, windows, rate_hz, C) for C in CHOICES[1:]]
    return AxesFit(len(windows), stated, np.array([stated, *others]))


def refuses_choice(signals: SensorSignals, rate_hz: float, choice: Floats, params: SetupParams) -> bool:
    """Whether a sensor speaks against one of `CHOICES` that others of its export need."""
    quiet = measure_quietness(signals, rate_hz)
    windows = _list_windows(signals, quiet.quiet, rate_hz, params)
    if len(windows) < params.least_windows:
        return False
    gyr = signals.gyr - find_bias(signals, rate_hz, quiet)
    stated = _measure(signals.acc, gyr, windows, rate_hz)
    chosen = _measure(signals.acc, gyr, windows, rate_hz, choice)
    return chosen > params.misfit_mps2 and chosen > params.distinct * stated


@dataclass(frozen=True)
class _Window:
    """A rest and the walking beside it.

    Parameters
    ----------
    order : samples from the last one at rest into the walking, which may lie before it. still : of the rest.
    part : samples of `order` that are averaged.
    """

    order: slice
    still: slice
    part: slice


def _list_windows(signals: SensorSignals, quiet: Bools, rate_hz: float, params: SetupParams) -> list[_Window]:
    """Averages of walking that can be carried back to a rest without a lost sample."""
    length, rest = round(params.sample_s * rate_hz), round(REST_S * rate_hz)
    found = []
    for a, b in (r for r in find_runs(quiet) if r[1] - r[0] >= rest):
        for begin_s in params.begins_s:
            first = round(begin_s * rate_hz)
            reach, part = first + length, slice(first, first + length)
            if b + reach <= len(quiet):
                found.append(_Window(slice(b, b + reach), slice(b - rest, b), part))
            if a - reach >= 0:
                end = a - reach - 1
                found.append(_Window(slice(a - 1, end if end >= 0 else None, -1), slice(a, a + rest), part))
    return [w for w in found if signals.valid[w.order].all() and _moves(signals, w, params)]


def _moves(signals: SensorSignals, window: _Window, params: SetupParams) -> bool:
    """A gyroscope in the wrong unit may seem not to turn: a force that shakes counts too."""
    rate = np.sqrt((signals.gyr[window.order][window.part] ** 2).sum(axis=1).mean())
    shaking = np.linalg.norm(signals.acc[window.order][window.part], axis=1).std()
    return bool(rate > params.least_rate or shaking > SHAKING)


def _measure(
    acc: Floats,
    gyr: Floats,
    windows: list[_Window],
    rate_hz: float,
    choice: Floats = CHOICES[0],
    limit: float = np.inf,
) -> float:
    """RMS difference of a rest and the mean force carried back to it, m/s²; inf where above a limit."""
    total = 0.0
    for window in windows:
        step = -1.0 if window.order.step else 1.0
        force, rate = np.ascontiguousarray(acc[window.order]), step * (gyr[window.order] @ choice.T)
        level = AttitudeState(np.array([1.0, 0.0, 0.0, 0.0]), rate[0])
        q, _ = advance(level, rate, force, np.ones(len(force), np.bool_), rate_hz, 1.0, RIGID)
        carried = rotate(q[window.part], force[window.part])
        taper = np.hanning(len(carried) + 2)[1:-1]
        off = taper @ carried / taper.sum() - acc[window.still].mean(axis=0)
        total += float(off @ off)
        if total > limit**2 * len(windows):
            return np.inf
    return float(np.sqrt(total / len(windows)))
