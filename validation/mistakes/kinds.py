"""Kinds of mistakes: what is done to a clean recording.

A mistake is made in the recording as read (rates, packets) or in the samples on the common axis (one sensor,
from one moment on).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.agreement.strides import find_main_axis
from sagittal.core.frames import GRAVITY, Floats, Segment
from sagittal.core.rotation import exp, rotate
from sagittal.core.signals.recording import ImuStream, Recording, SensorSignals, UniformRecording
from tests.helpers.perturbations import delay_sensor, slip_sensor

ALL: Final = "all"
"""In place of a sensor: every sensor of the recording."""


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Parameters
    ----------
    kind : key of `ON_AXIS` or `IN_FILES`. size : in the kind's unit. sensor : segment, or "all".
    moment : share of the walk before it, 0 to 1; ignored by kinds that last from the first sample.
    """

    kind: str
    size: float
    sensor: str
    moment: float

    @property
    def seed(self) -> int:
        """For random parts of the mistake."""
        return zlib.crc32(f"{self.kind} {self.size} {self.sensor} {self.moment}".encode())


def list_segments(recording: Recording | UniformRecording, sensor: str) -> list[Segment]:
    """The segments a mistake concerns."""
    worn = (
        [s for s in recording.segments.values() if s is not None]
        if isinstance(recording, Recording)
        else list(recording.sensors)
    )
    return worn if sensor == ALL else [s for s in worn if s == sensor]


def find_moment(recording: UniformRecording, share: float) -> float:
    """Time, s, before which this share of all movement lies."""
    speed = sum(np.linalg.norm(x.gyr, axis=1) for x in recording.sensors.values())
    moved = np.cumsum(speed > 0.3 * np.percentile(speed, 95))
    return float(np.searchsorted(moved, share * moved[-1])) / recording.rate_hz


def find_axes(signals: SensorSignals) -> dict[str, Floats]:
    """Unit axes (3,) of a sensor: vertical, across (of most rotation, level) and ahead."""
    up = np.median(signals.acc[signals.valid], axis=0)
    up /= np.linalg.norm(up)
    across = find_main_axis(signals.gyr[signals.valid])
    if abs(float(across @ up)) > 0.7:  # a pelvis turns most about the vertical
        level = signals.acc[signals.valid] - np.outer(signals.acc[signals.valid] @ up, up)
        across = np.cross(up, np.linalg.eigh(np.cov(level.T))[1][:, -1])
    across -= float(across @ up) * up
    across /= np.linalg.norm(across)
    return {"vertical": up, "across": across, "ahead": np.cross(across, up)}


def _slip(axis: str) -> Callable[[UniformRecording, Mistake], UniformRecording]:
    def make(recording: UniformRecording, m: Mistake) -> UniformRecording:
        at_s = find_moment(recording, m.moment)
        for s in list_segments(recording, m.sensor):
            about = find_axes(recording.sensors[s])[axis]
            recording = slip_sensor(recording, s, np.radians(m.size), at_s, about)
        return recording

    return make


def _creep(recording: UniformRecording, m: Mistake) -> UniformRecording:
    """A sensor that slides evenly over the whole recording."""
    for s in list_segments(recording, m.sensor):
        x, t = recording.sensors[s], recording.t_s
        about = find_axes(x)["across"]
        angle = np.radians(m.size) * (t - t[0]) / (t[-1] - t[0])
        q = exp(angle[:, None] * about)
        rate = rotate(q, x.gyr) - np.gradient(angle, t)[:, None] * about
        recording = _put(recording, s, replace(x, acc=rotate(q, x.acc), gyr=rate, mag=None))
    return recording


def _put(recording: UniformRecording, segment: Segment, x: SensorSignals) -> UniformRecording:
    return replace(recording, sensors={**recording.sensors, segment: x})


def _lag(recording: UniformRecording, m: Mistake) -> UniformRecording:
    for s in list_segments(recording, m.sensor):
        recording = delay_sensor(recording, s, m.size / 1000.0)
    return recording


def _leg_lag(recording: UniformRecording, m: Mistake) -> UniformRecording:
    for s in recording.sensors:
        if s.endswith(m.sensor[-2:]):
            recording = delay_sensor(recording, s, m.size / 1000.0)
    return recording


def _scale_gyr(recording: UniformRecording, m: Mistake) -> UniformRecording:
    for s in list_segments(recording, m.sensor):
        x = recording.sensors[s]
        recording = _put(recording, s, replace(x, gyr=x.gyr * (1.0 + m.size / 100.0)))
    return recording


def _bias_step(recording: UniformRecording, m: Mistake) -> UniformRecording:
    at_s = find_moment(recording, m.moment)
    for s in list_segments(recording, m.sensor):
        x = recording.sensors[s]
        about = find_axes(x)["across"]
        step = (recording.t_s >= at_s)[:, None] * np.radians(m.size) * about
        recording = _put(recording, s, replace(x, gyr=x.gyr + step))
    return recording


def _dead(recording: UniformRecording, m: Mistake) -> UniformRecording:
    """A gyroscope that reads zero from a moment on."""
    after = recording.t_s >= find_moment(recording, m.moment)
    for s in list_segments(recording, m.sensor):
        x = recording.sensors[s]
        recording = _put(recording, s, replace(x, gyr=np.where(after[:, None], 0.0, x.gyr)))
    return recording


def _frozen(recording: UniformRecording, m: Mistake) -> UniformRecording:
    """All channels hold their last value for `size` seconds."""
    a = int(find_moment(recording, m.moment) * recording.rate_hz)
    part = slice(a, a + int(m.size * recording.rate_hz))
    for s in list_segments(recording, m.sensor):
        x = recording.sensors[s]
        acc, gyr = x.acc.copy(), x.gyr.copy()
        acc[part], gyr[part] = acc[a], gyr[a]
        recording = _put(recording, s, replace(x, acc=acc, gyr=gyr))
    return recording


def _spikes(recording: UniformRecording, m: Mistake) -> UniformRecording:
    """`size` percent of the samples jump to the end of the range."""
    rng = np.random.default_rng(m.seed)
    for s in list_segments(recording, m.sensor):
        x = recording.sensors[s]
        at = rng.random(len(recording.t_s)) < m.size / 100.0
        sign = rng.choice((-1.0, 1.0), (len(at), 3))
        acc = np.where(at[:, None], sign * 16.0 * GRAVITY, x.acc)
        gyr = np.where(at[:, None], sign * np.radians(2000.0), x.gyr)
        recording = _put(recording, s, replace(x, acc=acc, gyr=gyr))
    return recording


def _noise(recording: UniformRecording, m: Mistake) -> UniformRecording:
    """White noise of `size` °/s and a tenth of that in m/s²."""
    rng = np.random.default_rng(m.seed)
    for s in list_segments(recording, m.sensor):
        x = recording.sensors[s]
        gyr = x.gyr + rng.normal(0.0, np.radians(m.size), x.gyr.shape)
        acc = x.acc + rng.normal(0.0, 0.1 * m.size, x.acc.shape)
        recording = _put(recording, s, replace(x, acc=acc, gyr=gyr))
    return recording


def _backwards(recording: UniformRecording, m: Mistake) -> UniformRecording:
    """The same walk with time reversed: walking backwards."""
    sensors = {
        s: replace(
            x,
            acc=x.acc[::-1].copy(),
            gyr=-x.gyr[::-1],
            mag=None,
            valid=x.valid[::-1].copy(),
            interpolated=x.interpolated[::-1].copy(),
        )
        for s, x in recording.sensors.items()
    }
    return replace(recording, sensors=sensors)


def _shaken(recording: UniformRecording, m: Mistake) -> UniformRecording:
    """All sensors shaken together in a hand at about `size` Hz, with rests before and after."""
    rng = np.random.default_rng(m.seed)
    t, rate_hz = recording.t_s, recording.rate_hz
    n = len(t)
    on = np.clip(np.minimum(t - t[0] - 4.0, t[-1] - 4.0 - t), 0.0, 1.0)[:, None]
    phase = 2 * np.pi * np.cumsum(m.size * (1.0 + 0.08 * _smooth(rng.normal(size=n), rate_hz))) / rate_hz
    axes = rng.normal(size=(2, 3))
    angle = 0.5 * np.sin(phase)[:, None] * axes[0] + 0.2 * np.sin(2 * phase + 1.0)[:, None] * axes[1]
    turn = angle * on
    place = on * (0.12 * np.sin(phase + 0.4)[:, None] * rng.normal(size=3))
    force = np.gradient(np.gradient(place, t, axis=0), t, axis=0) + np.array([0.0, 0.0, GRAVITY])
    q = exp(turn)
    acc = rotate(q * np.array([1.0, -1.0, -1.0, -1.0]), force)
    gyr = np.gradient(turn, t, axis=0)
    sensors = {}
    for s, x in recording.sensors.items():
        way = exp(rng.normal(size=3))
        noisy = [rotate(way, y) + rng.normal(0, z, y.shape) for y, z in ((acc, 0.02), (gyr, 0.002))]
        sensors[s] = replace(x, acc=noisy[0], gyr=noisy[1], mag=None)
    return replace(recording, sensors=sensors)


def _smooth(x: Floats, rate_hz: float) -> Floats:
    n = max(1, int(rate_hz))
    smooth = np.convolve(x, np.ones(n) / n, "same")
    return np.asarray(smooth / smooth.std())


ON_AXIS: Final[dict[str, Callable[[UniformRecording, Mistake], UniformRecording]]] = {
    "slip, sagittal": _slip("across"),
    "slip, frontal": _slip("ahead"),
    "slip, twist": _slip("vertical"),
    "creep": _creep,
    "one sensor late": _lag,
    "one leg late": _leg_lag,
    "gyroscope scale": _scale_gyr,
    "bias step": _bias_step,
    "gyroscope dead": _dead,
    "sensor frozen": _frozen,
    "spikes": _spikes,
    "noise": _noise,
    "walked backwards": _backwards,
    "shaken in a hand": _shaken,
}


def _rate(recording: Recording, m: Mistake) -> Recording:
    """Declared rate is `size` % of the true one: time runs 100 / size as fast."""
    return _change(
        recording, m, lambda x: replace(x, t_s=x.t_s * 100.0 / m.size, rate_hz=x.rate_hz * m.size / 100.0)
    )


def _packets(recording: Recording, m: Mistake) -> Recording:
    """Rows are missing and nothing counts them."""

    def lose(x: ImuStream) -> ImuStream:
        kept = np.random.default_rng(m.seed).random(len(x.t_s)) >= m.size / 100.0
        n = int(kept.sum())
        return replace(
            x, t_s=x.t_s[0] + np.arange(n) / x.rate_hz, acc=x.acc[kept],
            gyr=None if x.gyr is None else x.gyr[kept], mag=None, quat=None, clock="index",
        )  # fmt: skip

    return _change(recording, m, lose)


def _change(recording: Recording, m: Mistake, change: Callable[[ImuStream], ImuStream]) -> Recording:
    wanted = set(list_segments(recording, m.sensor))
    streams = {d: change(x) if recording.segments[d] in wanted else x for d, x in recording.streams.items()}
    return replace(recording, streams=streams)


IN_FILES: Final[dict[str, Callable[[Recording, Mistake], Recording]]] = {
    "declared rate": _rate,
    "packets lost": _packets,
}

SIZES: Final[dict[str, tuple[float, ...]]] = {
    "slip, sagittal": (10, 15, 25, 45),
    "slip, frontal": (10, 15, 25),
    "slip, twist": (25, 40),
    "creep": (8, 15),
    "one sensor late": (20, 40, 60, 100),
    "one leg late": (60,),
    "gyroscope scale": (5,),
    "bias step": (2, 5),
    "gyroscope dead": (0,),
    "sensor frozen": (3,),
    "spikes": (0.2, 1),
    "noise": (5, 20),
    "walked backwards": (0,),
    "shaken in a hand": (0.9, 1.8),
    "declared rate": (95, 97, 103, 105),
    "packets lost": (1, 3),
}
"""Kind → sizes: °, ms, %, °/s, s or Hz."""

WHOLE_SET: Final = ("walked backwards", "shaken in a hand", "declared rate")
"""Kinds that concern all sensors alike."""
NO_MOMENT: Final = (
    "creep", "one sensor late", "one leg late", "gyroscope scale", "spikes", "noise", "packets lost",
    *WHOLE_SET,
)  # fmt: skip
MOMENTS: Final = (0.3, 0.5, 0.7)


def list_mistakes(worn: tuple[Segment, ...]) -> list[Mistake]:
    """Every mistake that can be made with these sensors."""
    found = []
    for kind, sizes in SIZES.items():
        sensors: tuple[str, ...] = worn
        if kind in WHOLE_SET:
            sensors = (ALL,)
        elif kind == "gyroscope scale":
            sensors = (*worn, ALL)
        elif kind == "one leg late":
            sensors = tuple(s for s in worn if s.startswith("foot") and len(worn) > 3)
        elif kind in ("one sensor late", "packets lost") and len(worn) == 1:
            sensors = () if kind == "one sensor late" else worn
        moments = (0.0,) if kind in NO_MOMENT else MOMENTS
        found += [Mistake(kind, size, s, at) for size in sizes for s in sensors for at in moments]
    return found
