"""Packet counters and device clocks → ONE uniform axis and a validity mask per sensor.

Every sensor is laid on the axis of the take by its own times: samples that fall on it are copied bit for bit,
others are interpolated linearly. Holes of up to 0.1 s are interpolated and flagged, longer ones are invalid
and hold the last value (docs/science/timeline.md, "Rule").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.errors import Notice, SignalError
from core.frames import Bools, Floats, Segment
from core.recording import ImuStream, Recording, SensorSignals, UniformRecording


@dataclass(frozen=True)
class TimelineParams:
    """Limits of the common axis.

    Parameters
    ----------
    max_gap_s : longest missing stretch that is interpolated (docs/science/timeline.md, "Parameters").
    min_rate_hz : below, contacts cannot be found (docs/science/timeline.md, "Parameters").
    min_duration_s : shorter takes cannot hold 1 s of rest and two strides [our choice].
    min_share : a sensor that lasts less than this share of the median duration does not cut the take for the
        others; it is invalid where it has no samples [our choice].
    max_stretch : samples of the axis per recorded sample; beyond, the clock must have jumped [our choice].
    on_grid : largest distance from the axis, in samples, at which a sample counts as lying on it.
    """

    max_gap_s: float = 0.1
    min_rate_hz: float = 40.0
    min_duration_s: float = 5.0
    min_share: float = 0.9
    max_stretch: float = 20.0
    on_grid: float = 0.01


def synchronise(recording: Recording, params: TimelineParams | None = None) -> UniformRecording:
    """Lay all sensors that are worn on a segment on one uniform axis.

    The axis starts with the latest and ends with the earliest of the sensors that last, at the highest rate
    among them; time 0 is its first sample.

    Raises
    ------
    SignalError
        no_mapping, missing_gyro (no usable sensor), duplicate_stream, no_common_clock, sample_rate_too_low,
        no_overlap, too_short, clock_jump.
    """
    params = params or TimelineParams()
    worn = {
        s: recording.streams[d]
        for d, s in recording.segments.items()
        if s is not None and d in recording.streams
    }
    if not worn:
        raise SignalError(
            "no_mapping",
            "No sensor is assigned to a segment; say which sensor is worn where "
            f"(sensors found: {', '.join(recording.streams)}).",
        )
    _refuse_copies(worn)
    notices = list(recording.notices)
    notices += [n for s in worn.values() for n in s.notices]
    usable = {segment: s for segment, s in worn.items() if s.gyr is not None}
    if not usable:
        raise SignalError(
            "missing_gyro",
            f"None of the {len(worn)} sensors has a gyroscope signal, so no orientation can be computed; "
            "export the recording again with the rate of turn (Gyr_X, Gyr_Y, Gyr_Z).",
        )
    _check_clocks(usable)
    rate, rate_notices = _common_rate(usable, params)
    start, end, length_notices = _common_range(usable, params)
    n = int(np.floor((end - start) * rate + params.on_grid)) + 1
    most = max(len(s.t_s) for s in usable.values())
    if n > params.max_stretch * most:
        raise SignalError(
            "clock_jump",
            f"The sensors' clock spans {end - start:.0f} s, {n} samples at {rate:g} Hz, but at most "
            f"{most} were recorded: "
            "the counter or time column jumps. Export the recording again.",
        )
    axis = start + np.arange(n) / rate
    sensors = {segment: _on_axis(s, axis, rate, params) for segment, s in usable.items()}
    return UniformRecording(
        t_s=np.arange(n) / rate,
        rate_hz=rate,
        sensors=sensors,
        subject=recording.subject,
        protocol=recording.protocol,
        mounting=recording.mounting,
        notices=(*notices, *rate_notices, *length_notices),
        belt_speed_mps=recording.belt_speed_mps,
    )


def _refuse_copies(worn: dict[Segment, ImuStream]) -> None:
    """Two segments cannot have moved identically: one of the files is a copy under another id."""
    seen: dict[str, Segment] = {}
    for segment, s in worn.items():
        first = seen.setdefault(s.digest, segment)
        if first != segment:
            raise SignalError(
                "duplicate_stream",
                f"Sensors {worn[first].device_id} ({first}) and {s.device_id} ({segment}) hold identical "
                "samples: "
                "one is a copy under another id. Keep the one that was worn there, set the other to 'not "
                "used'.",
                sensor=s.device_id,
            )


def _check_clocks(usable: dict[Segment, ImuStream]) -> None:
    clocks = {s.clock for s in usable.values()}
    if len(clocks) > 1:
        listed = ", ".join(f"{s.device_id}: {s.clock}" for s in usable.values())
        raise SignalError(
            "no_common_clock",
            f"The sensors are timed in different ways ({listed}) and cannot be aligned; "
            "give all of them with a packet counter or with a time column.",
        )


def _common_rate(usable: dict[Segment, ImuStream], params: TimelineParams) -> tuple[float, list[Notice]]:
    """Highest rate among the sensors: nothing is thrown away and nothing can alias."""
    rates = {segment: s.rate_hz for segment, s in usable.items()}
    rate = max(rates.values())
    slowest = min(usable.values(), key=lambda s: s.rate_hz)
    if slowest.rate_hz < params.min_rate_hz:
        raise SignalError(
            "sample_rate_too_low",
            f"Sensor {slowest.device_id} was recorded at {slowest.rate_hz:g} Hz; at least "
            f"{params.min_rate_hz:g} Hz "
            "are needed to find foot contacts. Record again at 60 Hz or more.",
            sensor=slowest.device_id,
        )
    if rate - slowest.rate_hz <= 1e-3 * rate:
        return rate, []
    listed = ", ".join(f"{segment} {r:g} Hz" for segment, r in rates.items())
    return rate, [
        Notice(
            "rates_differ",
            f"Sensors run at different rates ({listed}); all were interpolated to {rate:g} Hz.",
        )
    ]


def _common_range(
    usable: dict[Segment, ImuStream], params: TimelineParams
) -> tuple[float, float, list[Notice]]:
    spans = {segment: (float(s.t_s[0]), float(s.t_s[-1])) for segment, s in usable.items()}
    median = float(np.median([b - a for a, b in spans.values()]))
    lasting = {k: v for k, v in spans.items() if v[1] - v[0] >= params.min_share * median} or spans
    start = max(a for a, _ in lasting.values())
    end = min(b for _, b in lasting.values())
    if end <= start:
        listed = ", ".join(f"{k} {a:.1f} to {b:.1f} s" for k, (a, b) in spans.items())
        raise SignalError(
            "no_overlap",
            f"The sensors were never recording at the same time ({listed}); "
            "the files seem to come from different takes.",
        )
    if end - start < params.min_duration_s:
        raise SignalError(
            "too_short",
            f"Only {end - start:.1f} s were recorded by all sensors together; at least "
            f"{params.min_duration_s:g} s "
            "are needed (1 s of quiet standing and two strides). Record a longer take.",
        )
    notices = [
        Notice(
            "unequal_lengths",
            f"Sensor {usable[k].device_id} on {k} recorded from {max(a - start, 0.0):.1f} to "
            f"{min(b, end) - start:.1f} s "
            f"of {end - start:.1f} s; {k} has no data for the rest.",
            k,
            max(min(b, end) - start, 0.0),
        )
        for k, (a, b) in spans.items()
        if k not in lasting
    ]
    first, last = min(a for a, _ in lasting.values()), max(b for _, b in lasting.values())
    if max(start - first, last - end) > 1.0:
        notices.append(
            Notice(
                "cropped",
                f"The sensors did not start and stop together; {start - first:.1f} s at the start and "
                f"{last - end:.1f} s "
                "at the end that only some of them recorded were left out.",
                severity="info",
            )
        )
    return start, end, notices


def _on_axis(s: ImuStream, axis: Floats, rate: float, params: TimelineParams) -> SensorSignals:
    """One sensor on the axis."""
    assert s.gyr is not None  # noqa: S101 - sensors without gyroscope were set aside
    good = complete(s.acc) & complete(s.gyr)
    if not good.any():
        raise SignalError(
            "bad_signal",
            f"Sensor {s.device_id} has no sample with both acceleration and angular rate; export it again.",
            sensor=s.device_id,
        )
    t = s.t_s[good]
    place = Place.find(t, axis, s.rate_hz, rate, params)
    return SensorSignals(
        device_id=s.device_id,
        acc=place.values(s.acc[good]),
        gyr=place.values(s.gyr[good]),
        mag=_magnetometer(s, axis, rate, params),
        valid=place.valid,
        interpolated=place.filled,
    )


def _magnetometer(s: ImuStream, axis: Floats, rate: float, params: TimelineParams) -> Floats | None:
    """The magnetometer has its own holes and never makes a sample invalid; None when mostly missing."""
    if s.mag is None:
        return None
    good = complete(s.mag)
    if np.count_nonzero(good) < 0.5 * len(good):
        return None
    return Place.find(s.t_s[good], axis, s.rate_hz, rate, params).values(s.mag[good])


@dataclass(frozen=True, eq=False)
class Place:
    """Where the axis lies between the good samples of a sensor.

    Parameters
    ----------
    before : (n,) index of the last sample at or before each axis point. share : (n,) way to the next, 0 to 1.
    """

    before: NDArray[np.intp]
    share: Floats
    valid: Bools
    filled: Bools

    @classmethod
    def find(cls, t: Floats, axis: Floats, own_rate: float, rate: float, params: TimelineParams) -> Place:
        """Find it for good-sample times t (m,), strictly increasing."""
        slack = params.on_grid / rate
        before = np.searchsorted(t, axis + slack, side="right") - 1
        outside = before < 0
        before = np.clip(before, 0, len(t) - 1)
        after = np.minimum(before + 1, len(t) - 1)
        hole = t[after] - t[before]
        share = np.where(hole > 0, (axis - t[before]) / np.where(hole > 0, hole, 1.0), 0.0)
        on_sample = (np.abs(axis - t[before]) <= slack) & ~outside
        share[on_sample] = 0.0
        past = (before == len(t) - 1) & ~on_sample
        step = 1.0 / own_rate
        missing = hole - step
        filled = ~on_sample & ~outside & ~past & (missing > 0.5 * step)
        too_long = filled & (missing > params.max_gap_s + 0.5 * step)
        share = np.where(too_long | outside | past, 0.0, share)
        valid = ~(too_long | outside | past)
        return cls(before, share, valid, filled & valid)

    def values(self, x: Floats) -> Floats:
        """Signal x (m, c) of the good samples on the axis, (n, c); invalid points hold the last."""
        base = x[self.before]
        following = x[np.minimum(self.before + 1, len(x) - 1)]
        return base + self.share[:, None] * (following - base)


def complete(x: Floats) -> Bools:
    """Rows (n,) of x (n, c) without a missing value."""
    return np.asarray(np.isfinite(x).all(axis=1), np.bool_)
