"""Terms of the acceleration of any point of a segment from one sensor, band-passed.

A point at r in the sensor's axes has the specific force f + K r with K = [ω̇]× + [ω]×[ω]×. Levelled by R
(tilt by the complementary filter, heading free) that is R f + R K r: linear in the unknown r.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Protocol

import numba
import numpy as np

from sagittal.core.agreement.params import JointBandParams, JointParams
from sagittal.core.frames import GRAVITY, Bools, Floats
from sagittal.core.fusion.attitude import AttitudeParams, AttitudeState, advance
from sagittal.core.rotation import compiled, find_lengths, from_matrix
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.recording import SensorSignals
from sagittal.core.signals.rest import Quietness, measure_quietness

TERMS: Final = 4
"""Columns of a sensor's terms: three for the place, one for its own specific force."""


class SensorMotion(Protocol):
    """Motion of one sensor: from stored arrays or computed on demand; see `LevelMotion`."""

    @property
    def q(self) -> Floats:
        """(n, 4)."""

    @property
    def level(self) -> Floats:
        """(3, n)."""

    @property
    def rate(self) -> Floats:
        """(n, 3)."""


@dataclass(frozen=True, eq=False)
class LevelMotion:
    """Motion of one sensor, without calibration.

    Parameters
    ----------
    q : (n, 4) sensor to its level frame, whose heading is free. level : (3, n) specific force there, m/s².
    rate : (n, 3) rad/s, corrected for the bias at rest.
    """

    q: Floats
    level: Floats
    rate: Floats


@dataclass(frozen=True, eq=False)
class TiltedSensor:
    """`LevelMotion` of a whole recording, computed on each access: storing it takes 206 MB for one hour of
    seven sensors.

    Parameters
    ----------
    bias : (3,) rad/s, its rate at rest. start, rest_norm : of the tilt, from `start_tilt`.
    """

    signals: SensorSignals
    bias: Floats
    start: AttitudeState
    rest_norm: float
    rate_hz: float
    params: AttitudeParams

    @property
    def q(self) -> Floats:
        """(n, 4)."""
        return self._tilt(len(self.signals.valid))

    @property
    def level(self) -> Floats:
        """(3, n)."""
        return _find_level(self.q, self.signals.acc)

    @property
    def rate(self) -> Floats:
        """(n, 3)."""
        return self.signals.gyr - self.bias

    def cut(self, part: slice) -> LevelMotion:
        """Part of the samples; later samples are not computed."""
        q = self._tilt(part.stop)[part]
        return LevelMotion(
            q, _find_level(q, self.signals.cut("acc", part)), self.signals.cut("gyr", part) - self.bias
        )

    def _tilt(self, stop: int) -> Floats:
        until, valid = slice(stop), self.signals.valid[:stop]
        gyr, acc = self.signals.cut("gyr", until) - self.bias, self.signals.cut("acc", until)
        return advance(self.start, gyr, acc, valid, self.rate_hz, self.rest_norm, self.params)[0]


@dataclass(frozen=True, eq=False)
class SensorTerms:
    """One sensor's side of every joint, and its motion at every sample of the recording.

    Parameters
    ----------
    M : (m, 3, 4) [R K | R f] in m/s² per m and m/s², x and y horizontal, z up; of the first samples only,
        once the joints of the recording have been compared (`keep_first`). usable : (m,) no lost sample
        nearby.
    rate_hz : of these samples.
    """

    motion: TiltedSensor
    M: Floats
    usable: Bools
    rate_hz: float

    @property
    def is_whole(self) -> bool:
        """Whether the terms cover the whole recording."""
        return len(self.M) == len(self.usable)

    def keep_first(self, until_s: float) -> SensorTerms:
        """A copy with only the first terms: those of one hour of seven sensors take 123 MB."""
        count = min(len(self.M), max(0, int(until_s * self.rate_hz) + 2)) if until_s < np.inf else len(self.M)
        return self if count == len(self.M) else replace(self, M=self.M[:count].copy())


@dataclass(frozen=True, eq=False)
class TermsPart:
    """`SensorTerms` of a part of a recording; `motion` covers the same samples."""

    motion: LevelMotion
    M: Floats
    usable: Bools
    rate_hz: float


NORMS: Final = (9.0, 10.6)
"""Median specific force of a sensor in SI units; beyond, gravity itself is taken."""

START_S: Final = 0.5
"""The vertical is learnt from this long on."""

NEAR_GAP_S: Final = 0.5
"""So far on either side a lost sample spoils what the band lets through: a quarter period of its slowest."""

STEEPEST: Final = 4.0
"""Rates are low-passed at so many times the band's upper edge before they are differentiated."""


def find_terms(signals: SensorSignals, rate_hz: float, params: JointParams) -> SensorTerms:
    """Level a sensor and band-pass its terms."""
    bias = find_bias(signals, rate_hz)
    acc, gyr = signals.acc, signals.gyr - bias
    state, rest_norm = start_tilt(acc, signals.valid, rate_hz)
    q = advance(state, gyr, acc, signals.valid, rate_hz, rest_norm, params.attitude)[0]
    slow, _ = low_pass_terms(q[None], acc[None], gyr[None], rate_hz, params)
    del acc, gyr, q
    thin = find_thinning(rate_hz, params)
    M = take_mean_out(slow, rate_hz / thin, params)[0]
    usable = find_usable(signals.valid[:, None], rate_hz)[0]
    motion = TiltedSensor(signals, bias, state, rest_norm, rate_hz, params.attitude)
    return SensorTerms(motion, M, usable[::thin], rate_hz / thin)


def find_thinning(rate_hz: float, params: JointBandParams) -> int:
    """Decimation factor of the terms."""
    return max(1, int(rate_hz / params.working_hz + 0.3))


def low_pass_terms(
    q: Floats, acc: Floats, gyr: Floats, rate_hz: float, params: JointBandParams, pad: int | None = None
) -> tuple[Floats, Floats]:
    """Terms (k, 12, m) of k sensors below the band's upper edge, decimated, and their level force (k, 3, n).

    Parameters
    ----------
    q : (k, n, 4) sensors to level. acc, gyr : (k, n, 3) m/s², rad/s without bias. pad : as `low_pass`.
    """
    edge = params.band_hz[1]
    w = low_pass(np.ascontiguousarray(gyr.transpose(0, 2, 1)), STEEPEST * edge, rate_hz, pad)
    rows = np.empty((len(q), 3 * TERMS, q.shape[1]))
    _write_terms(q, np.ascontiguousarray(acc), w, np.gradient(w, 1.0 / rate_hz, axis=2), rows)
    level = rows[:, TERMS - 1 :: TERMS].copy()
    thin = find_thinning(rate_hz, params)
    slow = np.empty((*rows.shape[:2], -(-rows.shape[2] // thin)))
    for i in range(rows.shape[1]):  # one after the other: all that is thinned away is not held at once
        slow[:, i] = low_pass(rows[:, i], edge, rate_hz, pad)[:, ::thin]
    return slow, level


def take_mean_out(slow: Floats, rate_hz: float, params: JointBandParams, pad: int | None = None) -> Floats:
    """Terms (k, m, 3, 4) within the band, from those below its upper edge (k, 12, m) at the decimated
    rate.
    """
    slow = slow - low_pass(slow, params.band_hz[0], rate_hz, pad)
    return np.ascontiguousarray(slow.transpose(0, 2, 1)).reshape(len(slow), -1, 3, TERMS)


def find_usable(valid: Bools, rate_hz: float) -> Bools:
    """Samples (k, n) without lost samples nearby, from valid (n, k)."""
    near = round(NEAR_GAP_S * rate_hz)
    around = np.ones(2 * near + 1)
    # of a part shorter than that "same" would give too many
    lost = [np.convolve(~x, around)[near : near + len(x)] for x in valid.T]
    return np.asarray(np.array(lost) <= 0.5)


def cut_terms(terms: SensorTerms, start_s: float, end_s: float) -> TermsPart:
    """Terms of a part of the recording; times restart at zero."""
    thin = round(terms.motion.rate_hz / terms.rate_hz)
    first, last = (max(0, round(x * terms.rate_hz)) for x in (start_s, end_s))
    part, whole = slice(first, last), slice(first * thin, last * thin)
    return TermsPart(terms.motion.cut(whole), terms.M[part], terms.usable[part], terms.rate_hz)


def _find_level(q: Floats, acc: Floats) -> Floats:
    """Specific force (3, n) in the level frame of q (n, 4), from acc (n, 3)."""
    out = np.empty((3, len(q)))
    _write_level(q, acc, out)
    return out


def find_bias(signals: SensorSignals, rate_hz: float, quiet: Quietness | None = None) -> Floats:
    """Mean rate (3,) rad/s around the quietest moment of a sensor at rest, zero if it never rests.

    Parameters
    ----------
    quiet : quietness of the sensor, None = computed here.
    """
    quiet = quiet or measure_quietness(signals, rate_hz)
    calmest = int(np.argmin(np.where(quiet.quiet, quiet.gyro, np.inf)))
    if not quiet.quiet[calmest]:
        return np.zeros(3)
    half = max(1, round(0.5 * rate_hz))
    return np.asarray(signals.cut("gyr", slice(max(0, calmest - half), calmest + half)).mean(axis=0))


def start_tilt(acc: Floats, valid: Bools, rate_hz: float) -> tuple[AttitudeState, float]:
    """Tilt of a sensor from its first `START_S`, heading free: initial state of the filter, and the norm
    at rest.
    """
    norm = float(np.median(find_lengths(acc[valid]))) if valid.any() else GRAVITY
    first = np.flatnonzero(valid)[: max(1, round(START_S * rate_hz))]
    up = acc[first].mean(axis=0) if len(first) else np.array([0.0, 0.0, 1.0])
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    lateral = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    lateral /= max(float(np.linalg.norm(lateral)), 1e-9)
    start = AttitudeState(from_matrix(np.stack((lateral, np.cross(up, lateral), up))), np.zeros(3), 0.0)
    return start, norm if NORMS[0] < norm < NORMS[1] else GRAVITY


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _write_level(q, f, out):  # type: ignore[no-untyped-def]
    """Write R f of q (n, 4) and f (n, 3) into out (3, n)."""
    R = np.empty((3, 3))
    for n in range(q.shape[0]):
        compiled.to_matrix(q[n], R)
        for i in range(3):
            out[i, n] = R[i, 0] * f[n, 0] + R[i, 1] * f[n, 1] + R[i, 2] * f[n, 2]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _write_terms(q, f, w, dw, out):  # type: ignore[no-untyped-def]
    """Write [R K | R f] of q (k, n, 4), f (k, n, 3), w and dw (k, 3, n) into out (k, 12, n)."""
    R = np.empty((3, 3))
    for s in range(q.shape[0]):
        for n in range(q.shape[1]):
            compiled.to_matrix(q[s, n], R)
            x, y, z = w[s, 0, n], w[s, 1, n], w[s, 2, n]
            a, b, c = dw[s, 0, n], dw[s, 1, n], dw[s, 2, n]
            for i in range(3):
                r0, r1, r2 = R[i, 0], R[i, 1], R[i, 2]
                k = TERMS * i
                out[s, k, n] = r0 * -(y * y + z * z) + r1 * (x * y + c) + r2 * (x * z - b)
                out[s, k + 1, n] = r0 * (x * y - c) - r1 * (x * x + z * z) + r2 * (y * z + a)
                out[s, k + 2, n] = r0 * (x * z + b) + r1 * (y * z - a) - r2 * (x * x + y * y)
                out[s, k + 3, n] = r0 * f[s, n, 0] + r1 * f[s, n, 1] + r2 * f[s, n, 2]
