"""Streaming terms of the sensors, second by second; equal to those of a file except for filter edge effects.

The filters of core/agreement/terms.py are non-causal; the stream gives them a short look-ahead. Each second
of terms is therefore 1.3 s late, and within 2 % of the terms of the file.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from sagittal.core.agreement.params import JointParams
from sagittal.core.agreement.terms import (
    LevelMotion,
    find_bias,
    find_thinning,
    find_usable,
    low_pass_terms,
    start_tilt,
    take_mean_out,
)
from sagittal.core.frames import Bools, Floats
from sagittal.core.fusion.attitude import advance
from sagittal.core.signals.recording import SensorSignals

SETTLE_S: Final = 0.3
"""The filters of the upper edge of the band see so much on either side: they have forgotten it after."""

BEFORE, AFTER = 2, 1
"""Seconds that the filter of the lower edge sees before and after the one that is taken."""

MOTION_SECONDS: Final = 50
"""So much of how the sensors move is kept for the strides."""


class RawSecond(NamedTuple):
    """Samples of one second: acc, gyr (n, k, 3) m/s², rad/s; valid (n, k)."""

    acc: Floats
    gyr: Floats
    valid: Bools


@dataclass(frozen=True, eq=False)
class TermSecond:
    """Terms of one second with margins of the widest lag.

    Parameters
    ----------
    M : (k, m, 3, 4). usable : (k, m). start : of the second, samples since the first one pushed.
    power : (k,) mean square of the rates in it, rad²/s². moments : (k, 3, 3) mean products of the rates.
    """

    M: Floats
    usable: Bools
    start: int
    power: Floats
    moments: Floats


@dataclass(frozen=True, eq=False)
class _Motion:
    """A second of q (k, n, 4), level (k, 3, n), rate (k, n, 3), valid (k, n)."""

    q: Floats
    level: Floats
    rate: Floats
    valid: Bools


class LiveTerms:
    """Streaming terms of some sensors.

    Parameters
    ----------
    standing : the preceding second, with the sensors at rest.
    """

    def __init__(self, standing: RawSecond, rate_hz: float, params: JointParams) -> None:
        self._rate_hz, self._params = rate_hz, params
        self._thin = find_thinning(rate_hz, params)
        self._bias, self._tilt = _learn(standing, rate_hz)
        self._settle = self._thin * round(SETTLE_S * rate_hz / self._thin)
        self._raw: deque[tuple[Floats, RawSecond]] = deque(maxlen=2)
        self._slow: deque[Floats] = deque(maxlen=BEFORE + 1 + AFTER)
        self._motion: deque[_Motion] = deque(maxlen=MOTION_SECONDS)
        self._seconds = 0

    def push(self, new: RawSecond) -> TermSecond | None:
        """Push the next second; returns the terms of an earlier one, once enough samples follow it."""
        rate = new.gyr - self._bias
        q = np.empty((rate.shape[1], len(rate), 4))
        for i, (state, norm) in enumerate(self._tilt):
            q[i], end_state = advance(
                state, rate[:, i], new.acc[:, i], new.valid[:, i], self._rate_hz, norm, self._params.attitude
            )
            self._tilt[i] = end_state, norm
        self._raw.append((q, RawSecond(new.acc, rate, new.valid)))
        self._seconds += 1
        if len(self._raw) < 2:
            return None
        self._advance(len(rate))
        return self._cut(len(rate)) if len(self._slow) == BEFORE + 1 + AFTER else None

    def read_motion(self, sensor: int) -> tuple[LevelMotion, Bools]:
        """Recent motion of one sensor, and the validity of its samples."""
        parts = self._motion
        motion = LevelMotion(
            np.concatenate([x.q[sensor] for x in parts]),
            np.concatenate([x.level[sensor] for x in parts], axis=1),
            np.concatenate([x.rate[sensor] for x in parts]),
        )
        return motion, np.concatenate([x.valid[sensor] for x in parts])

    @property
    def motion_start(self) -> int:
        """First sample of `read_motion`, relative to the first one pushed."""
        return self._start_of(len(self._motion) - 1)

    def _start_of(self, ago: int) -> int:
        """First sample of the motion that many seconds before the last one."""
        n = len(self._raw[-1][1].acc)
        return (self._seconds - 1 - ago) * n - self._settle

    def _advance(self, n: int) -> None:
        """Compute the motion of the second that ends `_settle` samples before the last."""
        (q0, old), (q1, new) = self._raw
        m = self._settle
        part = slice(n - 2 * m, None)
        q = np.concatenate((q0, q1), axis=1)[:, part]
        acc, rate = (
            np.concatenate((a, b)).transpose(1, 0, 2)[:, part]
            for a, b in ((old.acc, new.acc), (old.gyr, new.gyr))
        )
        valid = np.concatenate((old.valid, new.valid)).T[:, part]
        slow, level = low_pass_terms(q, acc, rate, self._rate_hz, self._params, pad=0)
        inner, thinned = slice(m, m + n), slice(m // self._thin, (m + n) // self._thin)
        self._slow.append(slow[:, :, thinned])
        self._motion.append(_Motion(q[:, inner], level[:, :, inner], rate[:, inner], valid[:, inner]))

    def _cut(self, n: int) -> TermSecond:
        """Terms of the second that is followed by `AFTER` more."""
        slow = np.concatenate(self._slow, axis=2)
        widest = round(self._params.widest_s * self._rate_hz / self._thin)
        first = BEFORE * n // self._thin
        part = slice(first - widest, first + n // self._thin + widest)
        M = take_mean_out(slow, self._rate_hz / self._thin, self._params, pad=0)[:, part]
        validity = [self._motion[k].valid for k in range(-min(len(self._motion), BEFORE + 1 + AFTER), 0)]
        usable = find_usable(np.concatenate(validity, axis=1).T, self._rate_hz)[:, :: self._thin][:, part]
        rate = self._motion[-1 - AFTER].rate
        moments = rate.transpose(0, 2, 1) @ rate / n
        return TermSecond(
            np.ascontiguousarray(M),
            np.ascontiguousarray(usable),
            self._start_of(AFTER),
            np.asarray(np.trace(moments, axis1=1, axis2=2)),
            moments,
        )


def _learn(standing: RawSecond, rate_hz: float) -> tuple[Floats, list]:  # type: ignore[type-arg]
    """Biases (k, 3) and initial tilts of k sensors, from a second of rest."""
    bias, tilts = [], []
    for i in range(standing.acc.shape[1]):
        valid = standing.valid[:, i]
        signals = SensorSignals("", standing.acc[:, i], standing.gyr[:, i], None, valid, ~valid)
        bias.append(find_bias(signals, rate_hz))
        tilts.append(start_tilt(signals.acc, valid, rate_hz))
    return np.array(bias), tilts
