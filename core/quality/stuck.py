"""Channels that do not measure: constant while the sensor moves, long at the range limit, repeated.

No value of a dead channel is out of range, so results based on it look plausible. It is identified by exact
equality: a moving sensor never measures the same value for a second, whatever its resolution, while one at
rest may. One rule for files and live recordings: a kernel over blocks of samples of the common axis. Live a
fault is effective from its detection, in a file from its beginning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.frames import GRAVITY, Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.quality.signals import RANGES
from sagittal.core.quality.stuck_kernel import (
    CHANNELS,
    CLIPPED,
    DEAD,
    FROZEN,
    LOOPED,
    Ints,
    StuckRule,
    StuckState,
    stuck_kernel,
)
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.signals.rest import find_runs


@dataclass(frozen=True)
class StuckParams:
    """Limits; our choice, with the largest value on intact recordings (neura_walk, gaitmap_foot, 72 walks of
    ipol_walks, qmt_fullbody, mobgap_lowback, samples of DOT, Awinda and Opal, every simulated walk).

    Parameters
    ----------
    moving_acc, moving_gyr : mean deviation of a channel over `smooth_s` above which the sensor moves, m/s²
        and rad/s.
    dead_s : duration of repeated values of one channel while the sensor moves. change : number of repeats
        subtracted by one change, so that a flickering channel is detected and a coarse one is not.
    clipped_s : time at the range limit, in excess of `clipped_share` of the surrounding time. A heel strike
        that exceeds the range lasts some milliseconds, 3 % of a stride at most.
    frozen_s : a whole sensor repeats one sample that differs from rest (by rest_acc, rest_gyr from gravity
        and zero), at least `fewest` times. Intact recordings never repeat one, and rounded to 0.1 m/s² and
        1°/s none for this long. For a sample of rest it is detected at the end, if the next one rotates
        faster than jump_gyr: no movement starts like that. resting_s : a whole accelerometer or gyroscope
        repeats any sample while another sensor moves: a real foot may rest for long, but not this long
        without a single new value.
    looped_s : a whole sensor repeats its last samples. packet_s : longest repeated piece searched for.
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


class StuckWatch:
    """The rule on n sensors, block by block; results are bit-identical for any division into blocks.

    Parameters
    ----------
    rate_hz : of the common axis.
    """

    def __init__(self, n: int, rate_hz: float, params: StuckParams | None = None) -> None:
        p = params or StuckParams()
        self._rule = StuckRule(
            1.0 - float(np.exp(-1.0 / (p.smooth_s * rate_hz))), p.moving_acc, p.moving_gyr,
            p.dead_s * rate_hz, p.change, p.clipped_s * rate_hz, p.clipped_share, p.acc_floor, p.gyr_floor,
            max(p.frozen_s * rate_hz, float(p.fewest)), p.resting_s * rate_hz, p.rest_acc, p.rest_gyr,
            p.looped_s * rate_hz, GRAVITY, p.jump_gyr,
        )  # fmt: skip
        self._full = np.array(RANGES)
        self._state = _new_state(n, max(2, round(p.packet_s * rate_hz)) + 1)

    def push(self, acc: Floats, gyr: Floats, valid: Bools) -> tuple[Ints, Ints] | None:
        """The fault (T, n) at each sample, 0 = none, and the number of preceding samples also affected (T,
        n).

        None without any fault.

        Parameters
        ----------
        acc, gyr : (T, n, 3) m/s², rad/s. valid : (T, n); invalid samples are skipped.
        """
        bad, back = np.empty(valid.shape, np.int64), np.empty(valid.shape, np.int64)
        any_fault = stuck_kernel(
            np.ascontiguousarray(acc), np.ascontiguousarray(gyr), np.ascontiguousarray(valid),
            tuple(self._rule), self._full, tuple(self._state), bad, back,
        )  # fmt: skip
        return (bad, back) if any_fault else None

    def describe(self, segment: Segment, sensor: int, kind: int, first_s: float) -> Notice:
        """Notice with the fault of a sensor and its start."""
        code, words = TOLD[kind]
        which = channel_words(np.flatnonzero(self._state.channels[sensor]).tolist())
        return Notice(code, Message(words, segment=segment, which=which, first=first_s), segment, first_s)


def _new_state(n: int, packet: int) -> StuckState:
    """The initial state of n sensors; packet : number of samples stored of each."""
    each = (n, CHANNELS)
    return StuckState(
        now=np.zeros(1, np.int64),
        last=np.full(each, np.nan),
        mean=np.zeros(each),
        dev=np.zeros(each),
        top=np.zeros(each),
        stays=np.zeros(each),
        begun=np.zeros(each, np.int64),
        clip=np.zeros(each),
        clip_begun=np.zeros(each, np.int64),
        same=np.zeros(n, np.int64),
        others=np.zeros((n, 2), np.int64),
        others_begun=np.zeros((n, 2), np.int64),
        ring=np.full((n, packet, CHANNELS), np.nan),
        loop=np.zeros((n, packet), np.int64),
        place=np.zeros(1, np.int64),
        kind=np.zeros(n, np.int64),
        channels=np.zeros(each, np.bool_),
    )


TOLD: Final[Mapping[int, tuple[str, str]]] = {
    DEAD: (
        "channel_stuck",
        (
            "The {which} of {segment} is stuck at one value from {first:.1f} s on. This sensor is "
            "excluded from then on; replace it."
        ),
    ),
    CLIPPED: (
        "channel_clipped",
        (
            "The {which} of {segment} is saturated from {first:.1f} s on. This sensor is excluded from "
            "then on; set a wider range."
        ),
    ),
    FROZEN: (
        "sensor_frozen",
        (
            "The sensor on {segment} repeats one sample from {first:.1f} s on. Such samples count as "
            "lost; check its battery and radio link."
        ),
    ),
    LOOPED: (
        "samples_repeated",
        (
            "The sensor on {segment} repeats earlier samples from {first:.1f} s on. Repeated samples "
            "count as lost; check its radio link and software."
        ),
    ),
}
"""Fault → code and words of its notice."""

CODES: Final = frozenset(code for code, _ in TOLD.values())


def channel_words(channels: Sequence[int]) -> str:
    """List channels 0 to 5 of a sensor.

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
    The recording itself if all of them do. With `no_working_sensor` (an error) among its notices if no sensor
    measures for long enough (`drop_stuck_sensors`).
    """
    segments = tuple(recording.sensors)
    signals = [recording.sensors[s] for s in segments]
    if not signals:
        return recording
    watch = StuckWatch(len(segments), recording.rate_hz, params)
    blocks = [_look_at(watch, signals, slice(a, a + AT_ONCE)) for a in range(0, len(recording.t_s), AT_ONCE)]
    if all(x is None for x in blocks):
        return recording
    lengths = [min(AT_ONCE, len(recording.t_s) - a) for a in range(0, len(recording.t_s), AT_ONCE)]
    nothing = [np.zeros((n, len(signals)), np.int64) for n in lengths]
    bad, back = (
        np.concatenate([none if x is None else x[i] for x, none in zip(blocks, nothing, strict=True)])
        for i in (0, 1)
    )
    sensors, notices = dict(recording.sensors), list(recording.notices)
    for i in np.flatnonzero(bad.any(axis=0)).tolist():
        valid = signals[i].valid.copy()
        reported: set[int] = set()
        for start, stop in find_runs(bad[:, i] > 0):
            # one fault may turn into another without a sample between
            for k in (start, *(np.flatnonzero(np.diff(bad[start:stop, i])) + start + 1).tolist()):
                first = k - int(back[k, i])
                valid[first:stop] = False
                if (kind := int(bad[k, i])) not in reported:
                    reported.add(kind)
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
    "No sensor has data for at least half of the trial, so it cannot be analysed. Check the sensors "
    "named above and record again."
)


def drop_stuck_sensors(recording: UniformRecording) -> UniformRecording:
    """The recording without sensors found stuck that measure for less than `LEAST` of it, and without
    those that have no sample left.
    """
    stuck = {n.sensor for n in recording.notices if n.code in CODES}
    working = {
        s: x
        for s, x in recording.sensors.items()
        if (s not in stuck or x.valid.mean() >= LEAST) and x.valid.any()
    }
    return recording if len(working) == len(recording.sensors) else replace(recording, sensors=working)


LEAST: Final = 0.5
"""Share of the take, as `PoseParams.least_valid`: below it a sensor is taken for one that is not there."""


def compile_stuck_kernel() -> None:
    """Compile the kernel or load it from the cache."""
    one = np.zeros((1, 1, 3))
    StuckWatch(1, 100.0).push(one, one, np.ones((1, 1), np.bool_))
