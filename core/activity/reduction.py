"""Samples → ten frames per second: low-passed gravity, vertical acceleration, stillness, steps and turns.

The recording is resampled to a uniform axis (core/timeline/grid.py) and processed in slabs of fixed length,
each with a margin on both sides, so that memory use is bounded and results do not depend on the block
boundaries. Equations: docs/science/activity.md, "Reduction".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, floor
from typing import Final, TypeVar

import numba
import numpy as np

from sagittal.core.activity.frames import FRAME_HZ, PER_MINUTE, Frames, Singles, Slab
from sagittal.core.activity.params import ActivityParams
from sagittal.core.errors import SignalError
from sagittal.core.events.lumbar import StepTimeParams, find_moving, find_step_times, split_about_vertical
from sagittal.core.events.turns import Turn, find_turns
from sagittal.core.frames import GRAVITY, Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.signals.recording import SensorSignals, Subject, UniformRecording
from sagittal.core.signals.rest import find_runs
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock, find_complete_rows
from sagittal.core.timeline.grid import lay_signal
from sagittal.core.timeline.params import TimelineParams

Samples = TypeVar("Samples", Floats, Bools)

PASS_HZ: Final = 0.25
RIPPLE_DB: Final = 0.01
STOP_DB: Final = 100.0
"""Edge of the pass band and ripples of the thesis' elliptic filter (7.2.3); −3 dB lies at 0.825 Hz."""

KEEP_S: Final = 2.0
"""With a gyroscope: time in which up goes back to where the specific force points, s [our choice]."""

GATE: Final = 2.0
"""It is drawn there the less the more |acc| differs from gravity, not at all from so much, m/s² [our
choice]."""

QUIET: Final = 0.1
"""Rates below this tell the gyroscope's bias, rad/s [our choice]."""

STEP_RATE: Final = 50
"""Steps are looked for at this rate where the recording's is a multiple of it."""

JOIN_S: Final = 10.0
"""Movement with shorter pauses is looked through for steps as one."""

PIECE_S: Final = 30
"""So much is laid on the axis at once."""

EDGE_S: Final = 5.0
"""Samples before and after movement that go with it, so that filters have settled."""

LONGEST_S: Final = 60 * 86400.0
"""A longer recording is a clock that jumped."""


def working_rate(rate_hz: float) -> int:
    """Rate of the uniform axis: the next one with a whole number of samples per frame."""
    return FRAME_HZ * max(2, ceil(rate_hz / FRAME_HZ - 0.01))


def reduce_stream(stream: LongStream, segment: Segment, params: ActivityParams) -> Iterator[Slab]:
    """Reduce a recording slab by slab.

    Raises
    ------
    SignalError : `bad_signal` without any complete sample, `clock_jump`.
    """
    rate = working_rate(stream.rate_hz)
    margin, size = params.margin_s * rate, params.slab_s * rate
    points = _PointStore(size + 2 * margin + PIECE_S * rate)
    start = 0
    for piece in _lay_pieces(stream, rate):
        points.append(piece)
        while points.end >= start + size + margin:
            yield _reduce(points.view(start + size + margin), start, start + size, rate, segment, params)
            start += size
            points.drop_before(start - margin)
    if points.end > start:
        yield _reduce(points.view(points.end), start, points.end, rate, segment, params)


@dataclass(frozen=True, eq=False)
class _Window:
    """Consecutive points of the axis starting at `first`."""

    first: int
    acc: Floats
    gyr: Floats
    valid: Bools


class _PointStore:
    """Preallocated arrays for the points of a slab and its margins."""

    def __init__(self, room: int) -> None:
        self._points = _Window(0, np.empty((room, 3)), np.empty((room, 3)), np.empty(room, np.bool_))
        self._first = self._count = 0

    @property
    def end(self) -> int:
        return self._first + self._count

    def append(self, more: _Window) -> None:
        part = slice(self._count, self._count + len(more.valid))
        stored = self._points
        stored.acc[part], stored.gyr[part], stored.valid[part] = more.acc, more.gyr, more.valid
        self._count = part.stop

    def view(self, end: int) -> _Window:
        part, stored = slice(0, end - self._first), self._points
        return _Window(self._first, stored.acc[part], stored.gyr[part], stored.valid[part])

    def drop_before(self, first: int) -> None:
        cut, stored = max(0, first - self._first), self._points
        left = self._count - cut
        stored.acc[:left] = stored.acc[cut : self._count]
        stored.gyr[:left] = stored.gyr[cut : self._count]
        stored.valid[:left] = stored.valid[cut : self._count]
        self._first, self._count = self._first + cut, left


def _lay_pieces(stream: LongStream, rate: int) -> Iterator[_Window]:
    """Pieces of the axis of `PIECE_S` each; the last ends with the recording.

    The points of a piece depend on the last sample before it, those in it, and the first one after it.
    """
    pending: list[SampleBlock] = []
    first, last_s, has_data = 0, -np.inf, False
    size = PIECE_S * rate
    end = size
    for raw in stream.open_blocks():
        block = _in_order(find_complete_rows(raw), last_s)
        if not len(block.t_s):
            continue
        if float(block.t_s[-1]) > LONGEST_S:
            raise SignalError(
                "clock_jump",
                Message(
                    "The clock of “{source}” runs over {t_s:.0f} days; at most {LONGEST_S:.0f} are "
                    "read. Export the recording again.",
                    source=stream.source,
                    t_s=block.t_s[-1] / 86400,
                    LONGEST_S=LONGEST_S / 86400,
                ),
                sensor=stream.device_id,
            )
        has_data, last_s = True, float(block.t_s[-1])
        pending.append(block)
        while last_s > (end + 1) / rate:
            rows = _join(pending)
            yield _lay(rows, first, end, rate, stream)
            # the last sample at or before the next point stays
            cut = max(0, int(np.searchsorted(rows.t_s, end / rate, "right")) - 1)
            pending = [_take(rows, slice(cut, None))]
            first, end = end, end + size
    if not has_data:
        raise SignalError(
            "bad_signal",
            Message("“{source}” has no complete sample; export it again.", source=stream.source),
            sensor=stream.device_id,
        )
    until = floor(last_s * rate + 0.01) + 1
    if until > first:
        yield _lay(_join(pending), first, until, rate, stream)


def _lay(rows: SampleBlock, first: int, end: int, rate: int, stream: LongStream) -> _Window:
    """Points first to end of the axis."""
    upto = int(np.searchsorted(rows.t_s, (end + 1) / rate, "right")) + 1
    channels = rows.acc[:upto]
    if rows.gyr is not None:
        channels = np.concatenate((channels, rows.gyr[:upto]), axis=1)
    resampled, valid, _ = lay_signal(
        rows.t_s[:upto], channels, first / rate, end - first, stream.rate_hz, float(rate), TimelineParams()
    )
    return _Window(
        first, resampled[0], resampled[1] if len(resampled) > 1 else np.zeros_like(resampled[0]), valid
    )


def _in_order(block: SampleBlock, after_s: float) -> SampleBlock:
    """Rows with a time later than all previous ones."""
    if not len(block.t_s):
        return block
    latest_s = np.maximum.accumulate(np.concatenate(([after_s], block.t_s[:-1])))
    rising = block.t_s > latest_s
    return block if rising.all() else _take(block, rising)


def _take(block: SampleBlock, rows: slice | Bools) -> SampleBlock:
    return SampleBlock(block.t_s[rows], block.acc[rows], None if block.gyr is None else block.gyr[rows])


def _join(blocks: Sequence[SampleBlock]) -> SampleBlock:
    if len(blocks) == 1:
        return blocks[0]
    gyr = [b.gyr for b in blocks if b.gyr is not None]
    return SampleBlock(
        np.concatenate([b.t_s for b in blocks]),
        np.concatenate([b.acc for b in blocks]),
        np.concatenate(gyr) if len(gyr) == len(blocks) else None,
    )


@lru_cache(maxsize=16)
def _design_gravity_filter(rate_hz: int) -> Floats:
    """Second-order section (1, 6) of the low-pass filter of the thesis."""
    from scipy.signal import ellip

    return np.asarray(ellip(2, RIPPLE_DB, STOP_DB, PASS_HZ / (0.5 * rate_hz), output="sos"))


def _reduce(
    window: _Window, start: int, end: int, rate: int, segment: Segment, params: ActivityParams
) -> Slab:
    """Reduce one slab: points start to end of a window that includes margins."""
    core = slice(start - window.first, end - window.first)
    if not window.valid[core].any():
        return Slab(_empty_frames(start // (rate // FRAME_HZ), (end - start) // (rate // FRAME_HZ)), (), ())
    frames, moving = _make_frames(window, core, rate, params)
    steps, turns = _find_steps_and_turns(window, moving, rate, segment, params)
    a, b = start / rate, end / rate
    return Slab(frames, tuple(t for t in steps if a <= t < b), tuple(t for t in turns if a <= t.start_s < b))


def _make_frames(window: _Window, core: slice, rate: int, params: ActivityParams) -> tuple[Frames, Bools]:
    """Frames of the points `core` of a window, and a movement mask (n,) of all its points."""
    from scipy.ndimage import uniform_filter1d
    from scipy.signal import sosfiltfilt

    per = rate // FRAME_HZ
    reach = min(len(window.acc) - 1, params.margin_s * rate)
    gravity = np.asarray(sosfiltfilt(_design_gravity_filter(rate), window.acc, axis=0, padlen=reach))
    size = np.maximum(np.sqrt(np.einsum("ni,ni->n", gravity, gravity)), 1e-9)
    along = np.einsum("ni,ni->n", window.acc, gravity) / size
    moving = find_moving(along - size, window.valid, rate, params.steps)
    if window.gyr.any():
        gravity = size[:, None] * follow_up(window.acc, window.gyr, gravity / size[:, None], rate)
    up = np.einsum("ni,ni->n", window.acc, gravity) / size
    norm = np.sqrt(np.einsum("ni,ni->n", window.acc, window.acc))
    deviation = norm - uniform_filter1d(norm, rate, mode="nearest")

    def mean(x: Floats) -> Singles:
        return np.asarray(_cut(x[core], per).mean(axis=1), np.float32)

    sd, wobble = _measure_minutes(window.acc[core], window.valid[core], rate)
    whole = np.asarray(_cut(window.valid[core], per).all(axis=1))
    first = (window.first + core.start) // per
    return Frames(first, whole, mean(gravity), mean(up), mean(deviation**2), sd, wobble), moving


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _add_up(acc, gyr, bias, start, dt, keep_s, gate, way, up):  # type: ignore[no-untyped-def]
    """Integrate the up direction in sensor axes from the rates, corrected towards the specific force, into
    `up` (n, 3).

    way : 1 forwards from the first sample, −1 backwards from the last one.
    """
    x, y, z = start[0], start[1], start[2]
    for i in range(len(acc)):
        k = i if way > 0 else len(acc) - 1 - i
        wx, wy, wz = way * (gyr[k, 0] - bias[0]), way * (gyr[k, 1] - bias[1]), way * (gyr[k, 2] - bias[2])
        # the world turns the other way in the sensor's axes
        x, y, z = (
            x - dt * (wy * z - wz * y),
            y - dt * (wz * x - wx * z),
            z - dt * (wx * y - wy * x),
        )
        ax, ay, az = acc[k, 0], acc[k, 1], acc[k, 2]
        size = np.sqrt(ax * ax + ay * ay + az * az)
        off = abs(size - GRAVITY) / gate
        if size > 0.0 and off < 1.0:
            gain = (1.0 - off) * dt / keep_s
            x, y, z = x + gain * (ax / size - x), y + gain * (ay / size - y), z + gain * (az / size - z)
        length = np.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
        up[k, 0] += x
        up[k, 1] += y
        up[k, 2] += z


def follow_up(acc: Floats, gyr: Floats, coarse: Floats, rate_hz: float) -> Floats:
    """Up direction (n, 3) in axes of a sensor with gyroscope: mean of a forward and a backward pass.

    Parameters
    ----------
    coarse : (n, 3) estimate without gyroscope, used for initialisation. The gyroscope bias is its mean during
    stillness.
    """
    quiet = np.linalg.norm(gyr, axis=1) < QUIET
    bias = gyr[quiet].mean(axis=0) if quiet.any() else np.zeros(3)
    up = np.zeros(acc.shape)
    for way, start in ((1, coarse[0]), (-1, coarse[-1])):
        _add_up(acc, gyr, bias, start.copy(), 1.0 / rate_hz, KEEP_S, GATE, way, up)
    up /= np.maximum(np.linalg.norm(up, axis=1), 1e-9)[:, None]
    return up


def _empty_frames(first: int, count: int) -> Frames:
    """Frames without measurements."""
    minutes = np.full((ceil(count / PER_MINUTE), 3), np.nan, np.float32)
    nothing = np.zeros(count, np.float32)
    gravity = np.zeros((count, 3), np.float32)
    return Frames(first, np.zeros(count, np.bool_), gravity, nothing, nothing, minutes, minutes)


def _cut(x: Samples, per: int) -> Samples:
    """Whole frames (f, per, …) of samples (n, …); an incomplete last frame is dropped."""
    count = len(x) // per
    return x[: count * per].reshape(count, per, *x.shape[1:])


def _measure_minutes(acc: Floats, valid: Bools, rate: int) -> tuple[Singles, Singles]:
    """Standard deviation (m, 3) of samples and of their 1-s means for every minute begun."""
    minute = 60 * rate
    sd, wobble = [], []
    for i in range(0, len(acc), minute):
        part, is_valid = acc[i : i + minute], valid[i : i + minute]
        if np.count_nonzero(is_valid) < 0.5 * minute:
            sd.append(np.full(3, np.nan))
            wobble.append(np.full(3, np.nan))
            continue
        sd.append(part[is_valid].std(axis=0))
        wobble.append(_cut(part, rate).mean(axis=1).std(axis=0))
    return np.array(sd, np.float32).reshape(-1, 3), np.array(wobble, np.float32).reshape(-1, 3)


def _find_steps_and_turns(
    window: _Window, moving: Bools, rate: int, segment: Segment, params: ActivityParams
) -> tuple[list[float], list[Turn]]:
    """Steps in every moving stretch of a window, and the turns during walking."""
    signals = SensorSignals("", window.acc, window.gyr, None, window.valid, ~window.valid)
    steps: list[float] = []
    turns: list[Turn] = []
    for a, b in _stretches(moving, rate, params.steps):
        part = slice(max(0, a - round(EDGE_S * rate)), min(len(moving), b + round(EDGE_S * rate)))
        offset = (window.first + part.start) / rate
        thin = rate // STEP_RATE if rate % STEP_RATE == 0 else 1
        acc_only = _take_alone(_cut_out(signals, part), rate, thin, segment)
        step_times = find_step_times(acc_only, segment, params.steps)
        centre = offset + 0.5 * (thin - 1) / rate
        steps += [t + centre for t in step_times]
        if step_times and window.gyr.any():
            whole = _cut_out(signals, part)
            _, yaw_rate = split_about_vertical(whole, rate, params.steps)
            turns += [
                Turn(t.start_s + offset, t.end_s + offset, t.angle_rad, t.peak_rad_s)
                for t in find_turns(yaw_rate, whole.valid, rate, params.turns)
            ]
    return steps, turns


def _stretches(moving: Bools, rate: int, params: StepTimeParams) -> list[tuple[int, int]]:
    """Runs of movement long enough for a bout of steps, with short pauses bridged."""
    joined: list[tuple[int, int]] = []
    for a, b in find_runs(moving):
        if joined and a - joined[-1][1] < JOIN_S * rate:
            joined[-1] = (joined[-1][0], b)
        else:
            joined.append((a, b))
    shortest = params.step_s[0] * (params.bouts.min_strides + 1) * rate
    return [(a, b) for a, b in joined if b - a >= shortest]


def _cut_out(signals: SensorSignals, part: slice) -> SensorSignals:
    valid = signals.valid[part].copy()
    return SensorSignals("", signals.acc[part].copy(), signals.gyr[part].copy(), None, valid, ~valid)


def _take_alone(signals: SensorSignals, rate: int, thin: int, segment: Segment) -> UniformRecording:
    """A stretch with its accelerometer only, so that steps are the same with and without a gyroscope.

    Parameters
    ----------
    thin : number of samples averaged into one.
    """
    acc = np.asarray(_cut(signals.acc, thin).mean(axis=1))
    valid = np.asarray(_cut(signals.valid, thin).all(axis=1), np.bool_)
    acc_only = SensorSignals("", acc, np.zeros_like(acc), None, valid, ~valid)
    t_s = np.arange(len(acc), dtype=np.float64) * (thin / rate)
    return UniformRecording(
        np.asarray(t_s, np.float64), rate / thin, {segment: acc_only}, Subject(), "activity", {}
    )
