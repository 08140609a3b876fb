"""Channels that do not measure: constant while the sensor moves, long at the end of their range, repeated.

Nothing in a dead channel is out of range, so whatever is made of it looks plausible. What gives it away is
exact equality: a moving sensor never measures the same value for a second, whatever its resolution, while one
at rest may. One rule for a file and a live take: a kernel over blocks of samples of the common axis. Live a
fault holds from the sample on at which it is known, in a file from where it began.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numba
import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import Notice
from sagittal.core.frames import GRAVITY, Bools, Floats, Segment
from sagittal.core.quality.signals import RANGES
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.signals.rest import find_runs

CHANNELS: Final = 6
"""Of a sensor: three axes of the accelerometer, three of the gyroscope."""

DEAD, CLIPPED, FROZEN, LOOPED = 1, 2, 3, 4
"""What is wrong with a sensor. The first two stay: such a sensor is out from then on. A sensor that repeats
its last sample, or its last packet, has lost samples and is there again with the next new one."""


Ints = NDArray[np.int64]


@dataclass(frozen=True)
class StuckParams:
    """Limits; ours, beside the largest value on good recordings (neura_walk, gaitmap_foot, 72 walks of
    ipol_walks, qmt_fullbody, mobgap_lowback, samples of DOT, Awinda and Opal, every simulated walk).

    Parameters
    ----------
    moving_acc, moving_gyr : mean deviation of a channel over `smooth_s` from which on the sensor moves, m/s²
        and rad/s.
    dead_s : repeated values of one channel while the sensor moves. change : repeats that one change takes
        off, so that a channel that flickers is found and a coarse one is not.
    clipped_s : time at the end of the range, beyond `clipped_share` of the time around it. A heel that
        strikes beyond the range stays there for some milliseconds, 3 % of a stride at most.
    frozen_s : a whole sensor repeats one sample that is none of rest (rest_acc, rest_gyr from gravity and
        zero), `fewest` times at least. Good recordings never repeat one, and rounded to 0.1 m/s² and 1°/s
        none for so long. The same of a sample of rest is known at its end, where the next one turns faster
        than jump_gyr: nobody goes off like that. resting_s : a whole accelerometer or gyroscope repeats any
        one while another sensor moves: a foot stands for long, a real one not for so long without a single
        new value.
    looped_s : a whole sensor repeats its last samples. packet_s : longest piece that is looked for.
    """

    moving_acc: float = 0.5
    moving_gyr: float = 0.2
    smooth_s: float = 0.3
    dead_s: float = 1.0
    change: float = 4.0
    clipped_s: float = 0.25
    clipped_share: float = 0.05
    acc_floor: float = 1.9 * GRAVITY
    gyr_floor: float = float(np.radians(245.0))
    frozen_s: float = 0.03
    fewest: int = 3
    jump_gyr: float = 1.0
    resting_s: float = 5.0
    rest_acc: float = 1.5
    rest_gyr: float = 0.3
    looped_s: float = 1.0
    packet_s: float = 0.5


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _rests(x, gravity, rest_acc, rest_gyr):  # type: ignore[no-untyped-def]
    """Whether a sample (6,) is one of a sensor at rest."""
    force = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    rate = np.sqrt(x[3] ** 2 + x[4] ** 2 + x[5] ** 2)
    return abs(force - gravity) < rest_acc and rate < rest_gyr


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _watch(  # type: ignore[no-untyped-def]
    acc, gyr, valid, limits, full, now, last, mean, dev, top, count, begun, clip, clip_begun,
    same, others, others_begun, ring, loop, place, kind, channels, bad, back,
):  # fmt: skip
    """Advance the state over a block; whether a sensor of it does not measure.

    Parameters
    ----------
    acc, gyr : (T, n, 3). valid : (T, n). limits : `_limits`. full : ends of usual ranges. now : (1,) index
        of the block's first sample. last, mean, dev, top : (n, 6). count, begun, clip, clip_begun : (n, 6)
        repeats, samples at the end of the range, and where either began. same : (n,) samples in a row equal
        to the one before. others, others_begun : (n, 2) the same of all of acc, of gyr, while another
        sensor moved, and where that began. ring : (n, P, 6) last samples, `place`
        (1,) the next to be written. loop : (n, P) samples in a row equal to the one p + 1 before.
    kind : (n,) what is wrong for good. channels : (n, 6) which.
    bad : (T, n) written, the fault. back : (T, n) written, samples before it for which it holds as well.
    """
    share, moving_acc, moving_gyr, dead, change, clipped, relief = limits[:7]
    acc_floor, gyr_floor, frozen, resting, rest_acc, rest_gyr, looped = limits[7:14]
    gravity, jump = limits[14], limits[15]
    T, n = valid.shape
    P = ring.shape[1]
    x = np.empty(6)
    equal = np.empty(6, np.bool_)
    moving = np.zeros(n, np.bool_)
    found = False
    for k in range(T):
        at = now[0] + k
        for i in range(n):
            moving[i] = False
            for c in range(6):
                if dev[i, c] > (moving_acc if c < 3 else moving_gyr):
                    moving[i] = True
        movers = 0
        for i in range(n):
            movers += moving[i] and valid[k, i]
        for i in range(n):
            bad[k, i], back[k, i] = kind[i], 0
            found = found or kind[i] != 0
            if not valid[k, i]:
                continue
            whole = True
            for c in range(6):
                x[c] = acc[k, i, c] if c < 3 else gyr[k, i, c - 3]
                equal[c] = x[c] == last[i, c]
                whole = whole and equal[c]
            # a whole sensor that repeats one sample
            before = same[i]
            same[i] = same[i] + 1 if whole else 0
            elsewhere = movers - moving[i] > 0
            for t in range(2):
                if equal[3 * t] and equal[3 * t + 1] and equal[3 * t + 2]:
                    others[i, t] += elsewhere
                else:
                    others[i, t] = 0
                    others_begun[i, t] = at
            rate = np.sqrt(x[3] ** 2 + x[4] ** 2 + x[5] ** 2)
            rests = _rests(x, gravity, rest_acc, rest_gyr)
            if kind[i] == 0 and ((same[i] >= frozen and not rests) or others[i].min() >= resting):
                bad[k, i] = 3
                back[k, i] = same[i]
            elif (
                kind[i] == 0
                and before >= frozen
                and not whole
                and rate > jump
                and _rests(last[i], gravity, rest_acc, rest_gyr)
            ):
                bad[k, i] = 3
                back[k, i] = before
            # a whole sensor that repeats its last samples
            j = place[0] - 1
            for p in range(1, P):
                j = j - 1 if j > 0 else j - 1 + P
                again = True
                for c in range(6):
                    if x[c] != ring[i, j, c]:
                        again = False
                        break
                loop[i, p] = loop[i, p] + 1 if again else 0
                long = loop[i, p] >= looped and loop[i, p] >= 2 * (p + 1)
                if long and movers > 0 and same[i] < p and bad[k, i] == 0:
                    bad[k, i] = 4
                    back[k, i] = loop[i, p]
            for c in range(6):
                ring[i, place[0], c] = x[c]
            for c in range(6):
                size = abs(x[c])
                # one channel that stays while the sensor moves
                if not equal[c]:
                    count[i, c] = max(0.0, count[i, c] - change)
                    if count[i, c] == 0.0:
                        begun[i, c] = at
                elif moving[i] and not whole:
                    count[i, c] += 1.0
                # one that stays at the end of its range
                top[i, c] = max(top[i, c], size)
                end = size >= 0.99 * top[i, c] and size >= (acc_floor if c < 3 else gyr_floor)
                if end and not equal[c]:
                    near = False
                    for f in range(len(full)):
                        near = near or abs(size / full[f] - 1.0) < 0.01
                    end = near and abs(last[i, c]) >= 0.99 * top[i, c]
                if end:
                    if clip[i, c] == 0.0:
                        clip_begun[i, c] = at - 1
                    clip[i, c] += 1.0
                else:
                    clip[i, c] = max(0.0, clip[i, c] - relief)
                if np.isnan(last[i, c]):
                    mean[i, c] = x[c]
                mean[i, c] += share * (x[c] - mean[i, c])
                dev[i, c] += share * (abs(x[c] - mean[i, c]) - dev[i, c])
                last[i, c] = x[c]
            found = found or bad[k, i] != 0
            if kind[i] != 0:
                continue
            first = at
            for c in range(6):
                channels[i, c] = count[i, c] >= 0.8 * dead
                if count[i, c] >= dead:
                    kind[i] = 1
                    first = min(first, begun[i, c])
            for t in range(2):
                if others[i, t] >= resting and not whole:
                    kind[i] = 1
                    channels[i, 3 * t : 3 * t + 3] = True
                    first = min(first, others_begun[i, t])
            if kind[i] == 0:
                for c in range(6):
                    channels[i, c] = clip[i, c] >= 0.8 * clipped
                    if clip[i, c] >= clipped:
                        kind[i] = 2
                        first = min(first, clip_begun[i, c])
            if kind[i] != 0:
                bad[k, i] = kind[i]
                back[k, i] = at - first
            found = found or bad[k, i] != 0
        place[0] = (place[0] + 1) % P
    now[0] += T
    return found


class StuckWatch:
    """The rule on n sensors, block by block; any division into blocks gives the same bits.

    Parameters
    ----------
    rate_hz : of the common axis.
    """

    def __init__(self, n: int, rate_hz: float, params: StuckParams | None = None) -> None:
        p = params or StuckParams()
        self._limits = np.array(
            [
                1.0 - np.exp(-1.0 / (p.smooth_s * rate_hz)), p.moving_acc, p.moving_gyr, p.dead_s * rate_hz,
                p.change, p.clipped_s * rate_hz, p.clipped_share, p.acc_floor, p.gyr_floor,
                max(p.frozen_s * rate_hz, p.fewest), p.resting_s * rate_hz, p.rest_acc, p.rest_gyr,
                p.looped_s * rate_hz, GRAVITY, p.jump_gyr,
            ]
        )  # fmt: skip
        each = (n, CHANNELS)
        self._full = np.array(RANGES)
        self._now = np.zeros(1, np.int64)
        self._last, self._mean, self._dev = np.full(each, np.nan), np.zeros(each), np.zeros(each)
        self._top, self._count, self._clip = np.zeros(each), np.zeros(each), np.zeros(each)
        self._begun, self._clip_begun = np.zeros(each, np.int64), np.zeros(each, np.int64)
        self._same = np.zeros(n, np.int64)
        self._others, self._others_begun = np.zeros((n, 2), np.int64), np.zeros((n, 2), np.int64)
        packet = max(2, round(p.packet_s * rate_hz)) + 1
        self._ring = np.full((n, packet, CHANNELS), np.nan)
        self._loop, self._place = np.zeros((n, packet), np.int64), np.zeros(1, np.int64)
        self._kind, self._channels = np.zeros(n, np.int64), np.zeros(each, np.bool_)

    def push(self, acc: Floats, gyr: Floats, valid: Bools) -> tuple[Ints, Ints] | None:
        """The fault (T, n) at each sample, 0 = none, and for how many samples before it holds as well (T, n).

        None where there is no fault.

        Parameters
        ----------
        acc, gyr : (T, n, 3) m/s², rad/s. valid : (T, n); other samples are passed over.
        """
        bad, back = np.empty(valid.shape, np.int64), np.empty(valid.shape, np.int64)
        found = _watch(
            np.ascontiguousarray(acc), np.ascontiguousarray(gyr), np.ascontiguousarray(valid), self._limits,
            self._full, self._now, self._last, self._mean, self._dev, self._top, self._count, self._begun,
            self._clip, self._clip_begun, self._same, self._others, self._others_begun, self._ring,
            self._loop, self._place, self._kind, self._channels, bad, back,
        )  # fmt: skip
        return (bad, back) if found else None

    def describe(self, segment: Segment, sensor: int, kind: int, first_s: float) -> Notice:
        """Say what is wrong with a sensor and since when."""
        code, words = TOLD[kind]
        which = channel_words(np.flatnonzero(self._channels[sensor]).tolist())
        return Notice(code, words.format(segment=segment, which=which, first=first_s), segment, first_s)


TOLD: Final[Mapping[int, tuple[str, str]]] = {
    DEAD: (
        "channel_stuck",
        (
            "The {which} of {segment} is stuck at one value from {first:.1f} s on. This sensor is left out "
            "from there; replace it."
        ),
    ),
    CLIPPED: (
        "channel_clipped",
        (
            "The {which} of {segment} stays at the end of its range from {first:.1f} s on. This sensor is "
            "left out from there; set a wider range."
        ),
    ),
    FROZEN: (
        "sensor_frozen",
        (
            "The sensor on {segment} sends one sample again and again from {first:.1f} s on. Such samples "
            "count as lost; check its battery and radio."
        ),
    ),
    LOOPED: (
        "samples_repeated",
        (
            "The sensor on {segment} sends the same samples again from {first:.1f} s on. Repeated samples "
            "count as lost; check its radio and software."
        ),
    ),
}
"""Fault → code and words of its notice."""

CODES: Final = frozenset(code for code, _ in TOLD.values())


def channel_words(channels: Sequence[int]) -> str:
    """Name channels 0 to 5 of a sensor.

    >>> channel_words([0, 3, 4, 5])
    'accelerometer (x) and gyroscope (x, y, z)'
    """
    parts = []
    for name, first in (("accelerometer", 0), ("gyroscope", 3)):
        axes = ["xyz"[c - first] for c in channels if first <= c < first + 3]
        parts += [f"{name} ({', '.join(axes)})"] if axes else []
    return " and ".join(parts)


def mark_stuck(recording: UniformRecording, params: StuckParams | None = None) -> UniformRecording:
    """The same recording, invalid wherever a sensor does not measure, with a notice for each such sensor.

    Returns
    -------
    the recording itself when all of them do. With `no_working_sensor` (an error) among its notices when no
    sensor measures for long enough (`drop_stuck_sensors`).
    """
    segments = tuple(recording.sensors)
    signals = [recording.sensors[s] for s in segments]
    if not signals:
        return recording
    watch = StuckWatch(len(segments), recording.rate_hz, params)
    found = [_look_at(watch, signals, slice(a, a + AT_ONCE)) for a in range(0, len(recording.t_s), AT_ONCE)]
    if all(x is None for x in found):
        return recording
    lengths = [min(AT_ONCE, len(recording.t_s) - a) for a in range(0, len(recording.t_s), AT_ONCE)]
    nothing = [np.zeros((n, len(signals)), np.int64) for n in lengths]
    bad, back = (
        np.concatenate([none if x is None else x[i] for x, none in zip(found, nothing, strict=True)])
        for i in (0, 1)
    )
    sensors, notices = dict(recording.sensors), list(recording.notices)
    for i in np.flatnonzero(bad.any(axis=0)).tolist():
        valid = signals[i].valid.copy()
        said: set[int] = set()
        for start, stop in find_runs(bad[:, i] > 0):
            # one fault may turn into another without a sample between
            for k in (start, *(np.flatnonzero(np.diff(bad[start:stop, i])) + start + 1).tolist()):
                first = k - int(back[k, i])
                valid[first:stop] = False
                if (kind := int(bad[k, i])) not in said:
                    said.add(kind)
                    notices.append(watch.describe(segments[i], i, kind, first / recording.rate_hz))
        sensors[segments[i]] = signals[i].change(valid=valid, interpolated=signals[i].interpolated & valid)
    marked = replace(recording, sensors=sensors, notices=tuple(notices))
    if not drop_stuck_sensors(marked).sensors:
        marked = replace(marked, notices=(*notices, Notice("no_working_sensor", NONE_LEFT, severity="error")))
    return marked


AT_ONCE: Final = 1 << 14
"""Samples that are laid side by side to be looked at: 5 MB of seven sensors."""


def _look_at(watch: StuckWatch, signals: Sequence[SensorSignals], part: slice) -> tuple[Ints, Ints] | None:
    acc, gyr = (np.stack([s.cut(name, part) for s in signals], axis=1) for name in ("acc", "gyr"))
    return watch.push(acc, gyr, np.stack([s.valid[part] for s in signals], axis=1))


NONE_LEFT: Final = (
    "No sensor measures for at least half of the take, so nothing can be said. Check the sensors named above "
    "and record again."
)


def drop_stuck_sensors(recording: UniformRecording) -> UniformRecording:
    """The recording without sensors that were found stuck and measure for less than `LEAST` of it, and
    without those of which no sample is left."""
    stuck = {n.sensor for n in recording.notices if n.code in CODES}
    kept = {
        s: x
        for s, x in recording.sensors.items()
        if (s not in stuck or x.valid.mean() >= LEAST) and x.valid.any()
    }
    return recording if len(kept) == len(recording.sensors) else replace(recording, sensors=kept)


LEAST: Final = 0.5
"""Share of the take, as `PoseParams.least_valid`: below it a sensor is taken for one that is not there."""


def compile_stuck_kernel() -> None:
    """Compile the kernel or load it."""
    one = np.zeros((1, 1, 3))
    StuckWatch(1, 100.0).push(one, one, np.ones((1, 1), np.bool_))
