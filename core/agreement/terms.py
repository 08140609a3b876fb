"""What one sensor says of any point of its segment: the terms of that point's acceleration, band-passed.

A point at r in the sensor's axes has the specific force f + K r with K = [ω̇]× + [ω]×[ω]×. Turned level by
R (tilt by the complementary filter, heading free) that is R f + R K r: linear in the unknown r.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numba
import numpy as np

from core.agreement.params import JointParams
from core.filtering import low_pass
from core.frames import GRAVITY, Bools, Floats
from core.fusion.attitude import AttitudeState, advance
from core.recording import SensorSignals
from core.rest import measure_quietness
from core.rotation import compiled, from_matrix

TERMS: Final = 4
"""Columns of a sensor's terms: three for the place, one for its own specific force."""


@dataclass(frozen=True, eq=False)
class SensorTerms:
    """One sensor's side of every joint.

    Parameters
    ----------
    M : (m, 3, 4) [R K | R f] in m/s² per m and m/s², x and y horizontal, z up. usable : (m,) no lost
        sample is near. rate_hz : of these samples.
    q : (n, 4) sensor to its level frame, at every sample of the take. level : (3, n) specific force there.
    rate : (n, 3) rad/s with the bias of the quietest moment taken off.
    """

    M: Floats
    usable: Bools
    rate_hz: float
    q: Floats
    level: Floats
    rate: Floats


NORMS: Final = (9.0, 10.6)
"""Median specific force of a sensor in SI units; beyond, gravity itself is taken."""

START_S: Final = 0.5
"""The vertical is learnt from this long on."""

NEAR_GAP_S: Final = 0.5
"""So far on either side a lost sample spoils what the band lets through: a quarter period of its slowest."""

STEEPEST: Final = 4.0
"""Rates are low-passed at so many times the band's upper edge before they are differentiated."""


def find_terms(signals: SensorSignals, rate_hz: float, params: JointParams) -> SensorTerms:
    """Tilt the sensor level and band-pass its terms."""
    gyr = signals.gyr - find_bias(signals, rate_hz)
    q = _tilt(signals, gyr, rate_hz, params)
    low, high = params.band_hz[1], params.band_hz[0]
    w = low_pass(np.ascontiguousarray(gyr.T), STEEPEST * low, rate_hz)
    rows = np.empty((3 * TERMS, len(gyr)))
    _write_terms(q, np.ascontiguousarray(signals.acc), w, np.gradient(w, 1.0 / rate_hz, axis=1), rows)
    thin = max(1, int(rate_hz / params.working_hz + 0.3))
    slow = low_pass(rows, low, rate_hz)[:, ::thin]
    slow = slow - low_pass(slow, high, rate_hz / thin)
    near = round(NEAR_GAP_S * rate_hz)
    lost = np.convolve(~signals.valid, np.ones(2 * near + 1), "same") > 0.5
    M = np.ascontiguousarray(slow.T).reshape(-1, 3, TERMS)
    return SensorTerms(M, ~lost[::thin], rate_hz / thin, q, rows[TERMS - 1 :: TERMS].copy(), gyr)


def cut_terms(terms: SensorTerms, start_s: float, end_s: float) -> SensorTerms:
    """The same of a part of the take; times begin anew."""
    thin = round((len(terms.q) - 1) / max(1, len(terms.M) - 1))
    first, last = (max(0, round(x * terms.rate_hz)) for x in (start_s, end_s))
    part, whole = slice(first, last), slice(first * thin, last * thin)
    return SensorTerms(
        terms.M[part],
        terms.usable[part],
        terms.rate_hz,
        terms.q[whole],
        terms.level[:, whole],
        terms.rate[whole],
    )


def find_bias(signals: SensorSignals, rate_hz: float) -> Floats:
    """Mean rate (3,) rad/s around the quietest moment where the sensor is at rest, else zero."""
    quiet = measure_quietness(signals, rate_hz)
    calmest = int(np.argmin(np.where(quiet.quiet, quiet.gyro, np.inf)))
    if not quiet.quiet[calmest]:
        return np.zeros(3)
    half = max(1, round(0.5 * rate_hz))
    return np.asarray(signals.gyr[max(0, calmest - half) : calmest + half].mean(axis=0))


def _tilt(signals: SensorSignals, gyr: Floats, rate_hz: float, params: JointParams) -> Floats:
    """Orientation (n, 4) from the sensor to a level frame of free heading."""
    valid = signals.valid
    norm = float(np.median(np.linalg.norm(signals.acc[valid], axis=1))) if valid.any() else GRAVITY
    first = np.flatnonzero(valid)[: max(1, round(START_S * rate_hz))]
    up = signals.acc[first].mean(axis=0) if len(first) else np.array([0.0, 0.0, 1.0])
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    across = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    across /= max(float(np.linalg.norm(across)), 1e-9)
    start = AttitudeState(from_matrix(np.stack((across, np.cross(up, across), up))), np.zeros(3), 0.0)
    rest_norm = norm if NORMS[0] < norm < NORMS[1] else GRAVITY
    return advance(start, gyr, signals.acc, valid, rate_hz, rest_norm, params.attitude)[0]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _write_terms(q, f, w, dw, out):  # type: ignore[no-untyped-def]
    """Write [R K | R f] of q (n, 4), f (n, 3), w and dw (3, n) into out (12, n)."""
    R = np.empty((3, 3))
    for n in range(q.shape[0]):
        compiled.to_matrix(q[n], R)
        x, y, z = w[0, n], w[1, n], w[2, n]
        a, b, c = dw[0, n], dw[1, n], dw[2, n]
        for i in range(3):
            r0, r1, r2 = R[i, 0], R[i, 1], R[i, 2]
            k = TERMS * i
            out[k, n] = r0 * -(y * y + z * z) + r1 * (x * y + c) + r2 * (x * z - b)
            out[k + 1, n] = r0 * (x * y - c) - r1 * (x * x + z * z) + r2 * (y * z + a)
            out[k + 2, n] = r0 * (x * z + b) + r1 * (y * z - a) - r2 * (x * x + y * y)
            out[k + 3, n] = r0 * f[n, 0] + r1 * f[n, 1] + r2 * f[n, 2]
