"""What live estimators are made of: sensors through bridge, stillness and ErKF, and the paths of the feet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numba
import numpy as np

from core.body.erkf.gaps import Bridge
from core.body.erkf.params import ErkfParams
from core.body.model import BodyModel
from core.body.tree import person_tree
from core.calibration.result import SegmentCalibration
from core.errors import Notice
from core.estimators import LiveMethod
from core.frames import FOOT, GRAVITY, R_NEUTRAL, SIDES, Bools, Floats, Segment
from core.online.erkf import LiveErkf, Signals
from core.online.still import Stillness
from core.rotation import from_matrix, multiply


@dataclass(frozen=True, eq=False)
class Raw:
    """A block as measured: acc, gyr (T, n, 3), valid (T, n) of the chain's sensors.

    Parameters
    ----------
    turned : segment → (T, 4) to W by its sensor alone (`Attitudes`), of `Estimator.attitudes` and the feet.
    """

    acc: Floats
    gyr: Floats
    valid: Bools
    turned: Mapping[Segment, Floats]


@dataclass(frozen=True, eq=False)
class Paths:
    """A block of the feet: p (T, F, 3), q (T, F, 4), still, valid (T, F), as `FootTracks`."""

    p: Floats
    q: Floats
    still: Bools
    valid: Bools


@dataclass(frozen=True, eq=False)
class Placed:
    """A block of the body.

    Parameters
    ----------
    q, p : (T, S, 4), (T, S, 3) of the estimator's segments, p NaN where it gives no place. known : (T, S) the
        orientation means something. whole : (T,) the figure does.
    paths : of the feet that carry a sensor.
    """

    q: Floats
    p: Floats
    known: Bools
    whole: Bools
    paths: Paths


class Estimator(Protocol):
    """What turns signals into a body.

    segments : of `Placed`. attitudes : segments whose orientation by their sensor alone it wants.
    linked, source : as in `FootTracks`. broken : it gave up.
    """

    method: LiveMethod
    segments: tuple[Segment, ...]
    attitudes: tuple[Segment, ...]
    linked: bool
    source: str

    @property
    def broken(self) -> bool:
        """A filter gave up."""

    def push(self, raw: Raw) -> Placed:
        """The next samples; the first block is the whole standing window."""

    def told(self) -> list[Notice]:
        """What is new to be said of itself."""


def worn_feet(segments: Iterable[Segment]) -> tuple[Segment, ...]:
    """Feet among these segments, left first."""
    worn = set(segments)
    return tuple(FOOT[s] for s in SIDES if FOOT[s] in worn)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _segments(states, mount, place, q, p):  # type: ignore[no-untyped-def]
    """Orientation (T, n, 4) and origin (T, n, 3) of segments from sensor states (T, n, 16)."""
    for k in range(states.shape[0]):
        for i in range(states.shape[1]):
            a, b, c, d = states[k, i, 6], states[k, i, 7], states[k, i, 8], states[k, i, 9]
            m = mount[i]
            # q ⊗ mount*
            w = a * m[0] + b * m[1] + c * m[2] + d * m[3]
            x = -a * m[1] + b * m[0] - c * m[3] + d * m[2]
            y = -a * m[2] + b * m[3] + c * m[0] - d * m[1]
            z = -a * m[3] - b * m[2] + c * m[1] + d * m[0]
            q[k, i, 0], q[k, i, 1], q[k, i, 2], q[k, i, 3] = w, x, y, z
            u, v, s = place[i]
            p[k, i, 0] = states[k, i, 0] - (1 - 2 * (y * y + z * z)) * u
            p[k, i, 0] -= 2 * (x * y - w * z) * v + 2 * (x * z + w * y) * s
            p[k, i, 1] = states[k, i, 1] - 2 * (x * y + w * z) * u
            p[k, i, 1] -= (1 - 2 * (x * x + z * z)) * v + 2 * (y * z - w * x) * s
            p[k, i, 2] = states[k, i, 2] - 2 * (x * z - w * y) * u
            p[k, i, 2] -= 2 * (y * z + w * x) * v + (1 - 2 * (x * x + y * y)) * s


@dataclass(frozen=True, eq=False)
class Tracked:
    """Signals as filtered; q (T, n, 4), p (T, n, 3) origins of segments; (T, joints) their ends apart, m."""

    signals: Signals
    q: Floats
    p: Floats
    residual: Floats


class Filtered:
    """Some sensors through bridge, stillness and ErKF; the first block is the whole standing window.

    Parameters
    ----------
    segments : of these sensors, all calibrated. column : segment → index among the chain's sensors.
    """

    def __init__(
        self,
        segments: Sequence[Segment],
        column: Mapping[Segment, int],
        mounted: Mapping[Segment, SegmentCalibration],
        body: BodyModel,
        rate_hz: float,
        params: ErkfParams,
    ) -> None:
        mounts = {s: mounted[s].R_segment_sensor for s in segments}
        self.tree = person_tree(body, mounts, segments)
        self._columns = np.array([column[s] for s in segments], np.int64)
        excess = [(mounted[s].rest_norm - GRAVITY) * mounts[s][1] for s in segments]
        bias = [mounted[s].gyro_bias for s in segments]
        self._bridge = Bridge(self.tree, np.array(excess), np.array(bias), rate_hz)
        self._still = Stillness(len(segments), rate_hz)
        self._rate_hz, self._params = rate_hz, params
        # by convention all segments face ahead while standing (core/fusion/mahony.py)
        self._start = multiply(from_matrix(R_NEUTRAL), self.tree.q_mount)
        self._filter: LiveErkf | None = None

    @property
    def broken(self) -> bool:
        """The filter gave up."""
        return self._filter is not None and self._filter.broken

    def push(self, raw: Raw) -> Tracked:
        """The next samples."""
        # `take` lays its result out in order; an index would not, and another layout is another kernel
        k, valid = self._columns, raw.valid.take(self._columns, axis=1)
        acc, gyr = self._bridge.push(raw.acc.take(k, axis=1), raw.gyr.take(k, axis=1), valid)
        signals = Signals(acc, gyr, valid, self._still.push(acc, gyr, valid))
        if self._filter is None:
            self._filter = LiveErkf(self.tree, self._params, self._rate_hz, signals, self._start)
        states, residual = self._filter.push(signals)
        q, p = np.empty((*valid.shape, 4)), np.empty((*valid.shape, 3))
        _segments(states, self.tree.q_mount, self.tree.place, q, p)
        return Tracked(signals, q, p, residual)


class FootPaths:
    """Paths of feet, each by its own sensor: what distances are measured on where no chain links them."""

    def __init__(self, filtered: Filtered) -> None:
        self._filtered = filtered

    @property
    def broken(self) -> bool:
        """The filter gave up."""
        return self._filtered.broken

    def push(self, raw: Raw) -> Paths:
        """The next samples."""
        x = self._filtered.push(raw)
        valid = x.signals.valid & np.isfinite(x.p[:, :, 0])
        return Paths(x.p, x.q, np.ascontiguousarray(x.signals.still[:, :, 0]), valid)
