"""The sensors of a file on one uniform axis.

Every sensor is resampled to the axis of the recording by its own times: samples that coincide with it are
copied bit for bit, others are interpolated linearly. Gaps of up to 0.1 s are interpolated and flagged, longer
ones are invalid and hold the last value (docs/science/timeline.md, "Rule").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sagittal.core.errors import Notice, SignalError
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.signals.held_samples import is_complete
from sagittal.core.signals.recording import ImuStream, Recording, SensorSignals, UniformRecording
from sagittal.core.timeline.grid import lay_signal
from sagittal.core.timeline.params import TimelineParams


def synchronise(recording: Recording, params: TimelineParams | None = None) -> UniformRecording:
    """Resample all sensors mapped to a segment onto one uniform axis.

    The axis starts with the latest and ends with the earliest of the full-length sensors, at the highest rate
    among them; time 0 is its first sample.

    Raises
    ------
    SignalError recording_too_long, no_mapping, missing_gyro (no usable sensor), duplicate_stream,
        no_common_clock, sample_rate_too_low, no_overlap, too_short, clock_jump.
    """
    params = params or TimelineParams()
    streams = _find_worn(recording)
    _refuse_copies(streams)
    notices = [*recording.notices, *_merge_alike([n for s in streams.values() for n in s.notices])]
    usable = _find_usable(streams)
    _check_clocks(usable)
    rate, rate_notices = _common_rate(usable, params)
    start, end, length_notices = _common_range(usable, params)
    n = int(np.floor((end - start) * rate + params.on_grid)) + 1
    most = max(len(s.t_s) for s in usable.values())
    if n > params.max_stretch * most:
        raise SignalError(
            "clock_jump",
            Message(
                "The sensors' clock spans {start:.0f} s, {value} samples at {rate:g} Hz, but at "
                "most {most} were recorded: the counter or time column jumps. Export the recording "
                "again.",
                start=end - start,
                value=n,
                rate=rate,
                most=most,
            ),
        )
    sensors = {segment: _lay_sensor(s, start, n, rate, params) for segment, s in usable.items()}
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


def _merge_alike(notices: list[Notice]) -> list[Notice]:
    """Merge notices of several sensors of one table that have the same words."""
    merged: dict[tuple[str, str], Notice] = {}
    for n in notices:
        key = n.code, n.message
        merged[key] = n if key not in merged else replace(n, sensor=None)
    return list(merged.values())


def _find_worn(recording: Recording) -> dict[Segment, ImuStream]:
    """The sensors mapped to a segment."""
    mapped = {
        s: recording.streams[d]
        for d, s in recording.segments.items()
        if s is not None and d in recording.streams
    }
    too_long = [d for d in recording.long if recording.segments.get(d) is not None]
    if too_long:  # nor are the others analysed as if it had not been worn
        raise SignalError(
            "recording_too_long",
            Message(
                "The recording of “{too_long}” is too long for the protocol '{protocol}'. Extract the walk, "
                "or choose daily life (activity) for a trunk sensor.",
                too_long="”, “".join(too_long),
                protocol=recording.protocol,
            ),
        )
    if not mapped:
        raise SignalError(
            "no_mapping",
            Message(
                "No sensor is assigned to a segment; assign the sensors (in the recording: {streams}).",
                streams=", ".join(recording.streams),
            ),
        )
    return mapped


def _find_usable(streams: Mapping[Segment, ImuStream]) -> dict[Segment, ImuStream]:
    """The sensors with a gyroscope."""
    usable = {segment: s for segment, s in streams.items() if s.held("gyr") is not None}
    if not usable:
        raise SignalError(
            "missing_gyro",
            Message(
                "None of the {worn} sensors has a gyroscope signal, so no orientation can be "
                "computed. Export the recording again with the rate of turn (Gyr_X, Gyr_Y, Gyr_Z).",
                worn=len(streams),
            ),
        )
    return usable


def _refuse_copies(streams: dict[Segment, ImuStream]) -> None:
    """Reject identical signals on two segments: one of the files is a copy under another id."""
    by_digest: dict[str, Segment] = {}
    for segment, s in streams.items():
        first = by_digest.setdefault(s.digest, segment)
        if first != segment:
            raise SignalError(
                "duplicate_stream",
                Message(
                    "Sensors {device_id} ({first}) and {device_id2} ({segment}) hold identical samples: "
                    "one is a copy under another id. Keep the one that was worn there, set the other to "
                    "'not used'.",
                    device_id=streams[first].device_id,
                    first=first,
                    device_id2=s.device_id,
                    segment=segment,
                ),
                sensor=s.device_id,
            )


def _check_clocks(usable: dict[Segment, ImuStream]) -> None:
    clocks = {s.clock for s in usable.values()}
    if len(clocks) > 1:
        listed = ", ".join(f"{s.device_id}: {s.clock}" for s in usable.values())
        raise SignalError(
            "no_common_clock",
            Message(
                "The sensors use different time bases ({listed}) and cannot be aligned; provide a packet "
                "counter or a time column for all of them.",
                listed=listed,
            ),
        )


def _common_rate(usable: dict[Segment, ImuStream], params: TimelineParams) -> tuple[float, list[Notice]]:
    """Highest rate among the sensors: no samples are discarded and no aliasing occurs."""
    rates = {segment: s.rate_hz for segment, s in usable.items()}
    rate = max(rates.values())
    slowest = min(usable.values(), key=lambda s: s.rate_hz)
    if slowest.rate_hz < params.min_rate_hz:
        raise SignalError(
            "sample_rate_too_low",
            Message(
                "Sensor {device_id} was recorded at {rate_hz:g} Hz; at least {min_rate_hz:g} Hz are "
                "needed to find foot contacts. Record again at 60 Hz or more.",
                device_id=slowest.device_id,
                rate_hz=slowest.rate_hz,
                min_rate_hz=params.min_rate_hz,
            ),
            sensor=slowest.device_id,
        )
    if rate - slowest.rate_hz <= 1e-3 * rate:
        return rate, []
    listed = ", ".join(f"{segment} {r:g} Hz" for segment, r in rates.items())
    return rate, [
        Notice(
            "rates_differ",
            Message(
                "Sensors run at different rates ({listed}); all were interpolated to {rate:g} Hz.",
                listed=listed,
                rate=rate,
            ),
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
            Message(
                "The sensors never recorded at the same time ({listed}); the files appear to be from "
                "different trials.",
                listed=listed,
            ),
        )
    if end - start < params.min_duration_s:
        raise SignalError(
            "too_short",
            Message(
                "All sensors together recorded only {start:.1f} s; at least {min_duration_s:g} s are needed "
                "(1 s of quiet standing and two strides). Record a longer trial.",
                start=end - start,
                min_duration_s=params.min_duration_s,
            ),
        )
    notices = [
        Notice(
            "unequal_lengths",
            Message(
                "Sensor {device_id} on {value} recorded from {max:.1f} to {min:.1f} s of {start:.1f} "
                "s; {value2} has no data for the rest.",
                device_id=usable[k].device_id,
                value=k,
                max=max(a - start, 0.0),
                min=min(b, end) - start,
                start=end - start,
                value2=k,
            ),
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
                Message(
                    "The sensors did not start and stop together. Excluded because only some of them were "
                    "recording: {first:.1f} s at the start, {end:.1f} s at the end.",
                    first=start - first,
                    end=last - end,
                ),
                severity="info",
            )
        )
    return start, end, notices


def _lay_sensor(
    s: ImuStream, start_s: float, samples: int, rate: float, params: TimelineParams
) -> SensorSignals:
    """One sensor resampled onto an axis of this many samples."""
    good = is_complete(s.held("acc")) & is_complete(s.held("gyr"))
    if not good.any():
        raise SignalError(
            "bad_signal",
            Message(
                "Sensor {device_id} has no sample with both acceleration and angular rate; export it again.",
                device_id=s.device_id,
            ),
            sensor=s.device_id,
        )
    mag = _lay_magnetometer(s, start_s, samples, rate, params)
    first = int(np.searchsorted(s.t_s, start_s - params.on_grid / rate))
    if _lies_on_axis(s.t_s, good, first, start_s, samples, rate, params):
        # what laying would copy bit for bit; rows one after the other, as sums over others round otherwise
        rows = slice(first, first + samples)
        acc, gyr = (np.ascontiguousarray(s.held(name)[rows]) for name in ("acc", "gyr"))
        valid = np.ones(samples, np.bool_)
        return SensorSignals(s.device_id, acc, gyr, mag, valid, ~valid)
    channels = np.concatenate((s.held("acc")[good], s.held("gyr")[good]), axis=1)
    (acc, gyr), valid, filled = lay_signal(s.t_s[good], channels, start_s, samples, s.rate_hz, rate, params)
    return SensorSignals(
        s.device_id,
        _hold_once(acc, s.held("acc")[first:]),
        _hold_once(gyr, s.held("gyr")[first:]),
        mag,
        valid,
        filled,
    )


def _hold_once(resampled: Floats, own: Floats) -> Floats:
    """The stream's own memory from the first point on, if every point is one of its samples.

    Not for non-contiguous rows, over which sums would round differently.
    """
    own = own[: len(resampled)]
    return own if own.flags.c_contiguous and np.array_equal(resampled, own) else resampled


def _lies_on_axis(
    t_s: Floats, good: Bools, first: int, start_s: float, samples: int, rate: float, params: TimelineParams
) -> bool:
    """Whether every point of the axis coincides with one good sample, starting with row `first`.

    Expressed as in `lay_points`, so that rounding gives the same decision.
    """
    past, slack = first + samples, params.on_grid / rate
    if past > len(t_s) or not good[first:past].all():
        return False
    axis, own = start_s + np.arange(samples) / rate, t_s[first:past]
    is_single = past == len(t_s) or t_s[past] > axis[-1] + slack
    return bool(is_single and np.all((own >= axis - slack) & (own <= axis + slack)))


def _lay_magnetometer(
    s: ImuStream, start_s: float, samples: int, rate: float, params: TimelineParams
) -> Floats | None:
    """The magnetometer has its own gaps and never makes a sample invalid; None if mostly missing."""
    mag = s.held("mag")
    if mag is None:
        return None
    good = is_complete(mag)
    if np.count_nonzero(good) < 0.5 * len(good):
        return None
    first = int(np.searchsorted(s.t_s, start_s - params.on_grid / rate))
    if _lies_on_axis(s.t_s, good, first, start_s, samples, rate, params):
        return np.ascontiguousarray(mag[first : first + samples])
    values, _, _ = lay_signal(s.t_s[good], mag[good], start_s, samples, s.rate_hz, rate, params)
    return _hold_once(np.asarray(values[0]), mag[first:])
