"""Detection of rest: quiet windows anywhere in a recording, for all sensors together or for one.

A sample is quiet if the 1-s window around it has mean |ω − b| below 6 °/s and std |f| below 0.25 m/s²
(docs/science/calibration.md, "Rest"). b is the sensor's own offset, taken from its steadiest window instead
of the median of the recording: in a recording of mostly walking the median is a property of the gait, not of
the gyroscope. An offset above that limit, up to 20 °/s, is accepted if gravity shows that the sensor did not
rotate.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import radians
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.signals.recording import SensorSignals, UniformRecording

A = TypeVar("A", Floats, Bools)

Window = tuple[float, float]
"""Half-open time range [start, end) in seconds from recording start."""


@dataclass(frozen=True)
class QuietParams:
    """Criteria for quiet samples (docs/science/calibration.md, "Rest")."""

    window_s: float = 1.0
    gyro_limit: float = radians(6.0)
    acc_std_limit: float = 0.25
    shortest_s: float = 1.0


@dataclass(frozen=True)
class RestParams(QuietParams):
    """Criteria for rest of a person (docs/science/calibration.md, "Rest", "False rests").

    Parameters
    ----------
    drift, drift_rate : a rest with a larger and faster rotation of the vertical in a sensor, rad and rad/s,
        is a slow movement. bias : a mean rate that differs by more from that of a longer rest, rad/s, is not
        the gyroscope bias, and that of the longer rest is used. A limit of 6 °/s on the mean rate misses
        both: a lower back that swayed for 2 s at the start of a real recording had 2.9 °/s, and its heading
        was lost.
    """

    drift: float = radians(1.0)
    drift_rate: float = radians(1.0)
    bias: float = radians(1.0)


STANDING: Final = QuietParams(window_s=0.5, shortest_s=0.5)
"""A short standing within a walk, which says nothing of the gyroscope (our choice: the shortest stop,
core/events/bouts.py)."""


LARGEST_BIAS: Final = radians(20.0)
"""Zero-rate offsets of consumer MEMS gyroscopes are specified up to ±20 °/s; beyond it the sensor turns."""
SAME_BIAS: Final = radians(1.0)
"""Rates of two stretches that differ by less are the same offset; temperature moves it by less in a take."""


JUDGED: Final = radians(1.0)
"""Sway and noise turn gravity by less (`RestParams.drift`)."""


@dataclass(frozen=True, eq=False)
class Quietness:
    """Quietness of one sensor around each sample.

    Parameters
    ----------
    gyro : (n,) mean |ω − b| over the window in rad/s. acc : (n,) std |f| over the window in m/s².
    quiet : (n,) both below their limits and every sample of the window valid.
    """

    gyro: Floats
    acc: Floats
    quiet: Bools


def measure_quietness(signals: SensorSignals, rate_hz: float, params: QuietParams | None = None) -> Quietness:
    """Quietness of a sensor in the window around every sample; borders use the nearest window."""
    params = params or QuietParams()
    width = max(2, round(params.window_s * rate_hz))
    if len(signals.valid) < width:
        never = np.full(len(signals.valid), np.inf)
        return Quietness(never, never, np.zeros(len(signals.valid), bool))
    # readers of results do without numba
    from sagittal.core.signals.kernel import find_steadiest_rate, measure_norms, measure_windows

    n, zero = len(signals.valid), np.zeros(3)
    whole, offset, norm = np.empty(n - width + 1, np.bool_), np.empty(3), np.empty(n)
    rate = _lock(signals.gyr)
    find_steadiest_rate(rate, _lock(signals.valid), width, whole, offset)
    if np.linalg.norm(offset) > params.gyro_limit and not is_bias(offset, signals, rate_hz, params):
        offset = zero
    measure_norms(rate, offset, norm)
    del rate
    gyro, acc, unused = np.empty(n), np.empty(n), np.empty(n)
    measure_windows(norm, width, gyro, unused)
    measure_norms(_lock(signals.acc), zero, norm)
    norm -= norm.mean()
    measure_windows(norm, width, unused, acc)
    quiet = (gyro < params.gyro_limit) & (acc < params.acc_std_limit) & _centred(whole, n, width)
    return Quietness(gyro, acc, quiet)


def is_bias(offset: Floats, signals: SensorSignals, rate_hz: float, params: QuietParams) -> bool:
    """Whether a steady rate above `gyro_limit` is a gyroscope offset and not a rotation of the sensor.

    A rotation about a horizontal axis changes gravity in sensor axes; one about the vertical does not, but
    does not recur with the same rate after the sensor has moved.

    Parameters
    ----------
    offset : (3,) mean rate of the steadiest window, rad/s.
    """
    if np.linalg.norm(offset) > LARGEST_BIAS:
        return False
    width = max(2, round(params.window_s * rate_hz))
    mean = _average_windows(signals.gyr, width)
    spread = _average_windows((signals.gyr - offset) ** 2, width).sum(axis=1)
    steady = (np.linalg.norm(mean - offset, axis=1) < SAME_BIAS) & (spread < params.gyro_limit**2)
    steady &= _average_windows(signals.valid[:, None].astype(np.float64), width)[:, 0] > 1.0 - 0.5 / width
    stretches = find_runs(steady)
    if not stretches:
        return False
    first, last = max(stretches, key=lambda run: run[1] - run[0])
    acc = signals.acc[first : last + width - 1]
    up = acc.mean(axis=0) / np.linalg.norm(acc.mean(axis=0))
    turned, seconds = measure_turn(acc, rate_hz)
    expected = float(np.linalg.norm(offset - offset @ up * up)) * seconds
    if turned > max(expected / 3.0, JUDGED):
        return False
    return len(stretches) > 1 or abs(float(offset @ up)) < params.gyro_limit


def find_rest_windows(
    recording: UniformRecording,
    params: QuietParams | None = None,
    segments: Iterable[Segment] | None = None,
) -> tuple[Window, ...]:
    """Windows with all sensors (or those of `segments`) at rest together, in chronological order.

    The quarter window at each end of a run that may already include the onset of movement is excluded.
    """
    params = params or QuietParams()
    chosen = tuple(recording.sensors if segments is None else segments)
    if not chosen:
        return ()
    quiet = np.ones(len(recording.t_s), bool)
    for segment in chosen:
        quiet &= measure_quietness(recording.sensors[segment], recording.rate_hz, params).quiet
    return find_windows(quiet, recording.rate_hz, params)


def drop_false_rests(
    recording: UniformRecording, rests: tuple[Window, ...], params: RestParams | None = None
) -> tuple[Window, ...]:
    """The rests without rotation of any sensor's vertical: the others are slow movements."""
    params, rate = params or RestParams(), recording.rate_hz
    sensors = recording.sensors.values()
    return tuple(r for r in rests if not any(is_drifting(x, r, rate, params) for x in sensors))


def is_drifting(signals: SensorSignals, window: Window, rate_hz: float, params: RestParams) -> bool:
    """Whether the vertical rotates in a sensor between the ends of a window, each a quarter of a second to
    one second long.
    """
    turned = measure_turn(signals.cut("acc", index_window(window, rate_hz)), rate_hz)
    return turned[0] > params.drift and turned[0] > params.drift_rate * turned[1]


def measure_turn(acc: Floats, rate_hz: float) -> tuple[float, float]:
    """Angle in rad between the mean forces (n, 3) at the ends of a rest, and the seconds between."""
    edge = max(1, min(len(acc) // 4, round(rate_hz)))
    a, b = acc[:edge].mean(axis=0), acc[-edge:].mean(axis=0)
    turned = float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    return turned, (len(acc) - edge) / rate_hz


def find_windows(quiet: Bools, rate_hz: float, params: QuietParams | None = None) -> tuple[Window, ...]:
    """Convert a mask (n,) of quiet window centres to rest windows of at least `shortest_s`."""
    params = params or QuietParams()
    n = len(quiet)
    reach = round(0.25 * params.window_s * rate_hz)
    windows = []
    for start, end in find_runs(quiet):
        first, last = max(0, start - reach), min(n, end + reach)
        if last - first >= params.shortest_s * rate_hz - 1:
            windows.append((first / rate_hz, last / rate_hz))
    return tuple(windows)


def count_runs(mask: Bools, previous_counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Consecutive true samples (T, n), including the current one, for each sample of a mask (T, n).

    Parameters
    ----------
    previous_counts : (n,) count before the block, advanced in place.
    """
    if not len(mask):
        return np.zeros(mask.shape, np.int64)
    count = np.arange(1, len(mask) + 1)[:, None]
    since = np.maximum.accumulate(np.where(mask, 0, count), axis=0)
    counts = count - since + np.where(since == 0, previous_counts, 0)
    previous_counts[:] = counts[-1]
    return np.asarray(counts, np.int64)


def find_runs(mask: Bools) -> list[tuple[int, int]]:
    """Half-open index ranges of the True runs of a mask (n,)."""
    if not len(mask):
        return []
    edges = (np.flatnonzero(mask[1:] != mask[:-1]) + 1).tolist()
    edges = [*([0] if mask[0] else []), *edges, *([len(mask)] if mask[-1] else [])]
    return list(zip(edges[::2], edges[1::2], strict=True))


def index_window(window: Window, rate_hz: float) -> slice:
    """Index range of a time window on the uniform axis."""
    return slice(max(0, round(window[0] * rate_hz)), max(0, round(window[1] * rate_hz)))


def _average_windows(x: Floats, width: int) -> Floats:
    """Means (n − width + 1, k) of every window of x (n, k)."""
    total = np.concatenate((np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)))
    return np.asarray((total[width:] - total[:-width]) / width, np.float64)


def _lock(x: A) -> A:
    """The array in the form used by a kernel, which is compiled only once: contiguous, read-only."""
    locked = np.ascontiguousarray(x).view()
    locked.setflags(write=False)
    return locked


def _centred(x: Bools, n: int, width: int) -> Bools:
    """Assign full-window values to the window centres of an axis of n samples, constant at the borders."""
    index = np.clip(np.arange(n) - width // 2, 0, len(x) - 1)
    return x[index]


def compile_rest_kernels() -> None:
    """Compile the kernels of `measure_quietness` or load them from the cache, so that the first recording
    is not delayed.
    """
    valid = np.ones(2, np.bool_)
    measure_quietness(SensorSignals("", np.zeros((2, 3)), np.zeros((2, 3)), None, valid, ~valid), 1.0)
