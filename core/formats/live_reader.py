"""The log of a live recording → Recording: all acknowledged data, with notices on irregularities."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from sagittal.core.errors import FormatError, InputError, Notice
from sagittal.core.formats.draft import grade_loss, signal_digest
from sagittal.core.formats.live_clock import LiveClock, Micros, sample_times_us
from sagittal.core.formats.live_log import (
    FILE_MARK,
    Finish,
    Hello,
    LogRecord,
    SampleBatch,
    SensorInfo,
    StreamInfo,
    check_fits,
    decode_batch,
    parse_finish,
    parse_hello,
    read_batch_header,
    scan,
    view_samples,
)
from sagittal.core.frames import Floats
from sagittal.core.plurals import plural
from sagittal.core.signals.recording import ImuStream, Recording

_MOST_OUT_OF_ORDER: Final = 0.01
"""Share of samples that may run backwards before the stream is not to be trusted [our choice]."""


def looks_like(data: bytes) -> bool:
    """Whether the data begin with the mark of a live log."""
    return data.startswith(FILE_MARK)


@dataclass
class _Taken:
    """Content of the records."""

    hello: Hello
    batches: list[SampleBatch] = field(default_factory=list)
    digest: str = ""
    finish: Finish | None = None
    notices: list[Notice] = field(default_factory=list)


def read_live_log(data: bytes, source: str) -> Recording:
    """Read a live recording from its log.

    Parameters
    ----------
    data : the file, possibly truncated. source : its name.

    Returns
    -------
    Recording with one stream per sensor on the common clock, segments from the hello. `t_s` is 0 at the first
    sample of the first batch.

    Raises
    ------
    FormatError bad_live_log (damaged before the first sample), empty (no sample).
    """
    records, length = scan(data)
    log = _taken(records, source)
    if length < len(data):
        log.notices.append(
            Notice(
                "live_log_torn",
                f"The end of {source} ({len(data) - length} B) is incomplete or damaged and was left out; "
                f"batches before it that are whole: {len(log.batches)}.",
            )
        )
    if not log.batches:
        raise FormatError("empty", f"{source} holds a live take without a sample.")
    _compare_finish(log, source)
    streams, stream_notices = _streams(log, source)
    return Recording(
        streams=streams,
        segments={x.id: x.segment for x in log.hello.sensors if x.id in streams},
        notices=(*log.notices, *stream_notices),
    )


def find_start_us(records: Iterable[LogRecord]) -> int | None:
    """The sender's clock at time 0 of the recording, its first sample; None for a log without a batch.

    As bounded by `LiveClock`; the transmission delay itself, some 10 ms, remains.
    """
    clock: LiveClock | None = None
    rates: dict[int, float] = {}
    first: SampleBatch | None = None
    for one in records:
        if one.kind == "H":
            hello = parse_hello(one.body)
            clock, rates = LiveClock(hello), {s.stream: s.rate_hz for s in hello.streams}
        elif one.kind == "B" and clock is not None:
            batch = decode_batch(one.body)
            first = first or batch
            t = sample_times_us(batch, rates[batch.stream])
            clock.push(batch.stream, int(t[0]), int(t[-1]), batch.sent_us)
            if clock.sender_offset_us(first.stream) is not None:
                break
    if clock is None or first is None:
        return None
    return first.t0_us + (clock.sender_offset_us(first.stream, final=False) or 0)


def _taken(records: Sequence[LogRecord], source: str) -> _Taken:
    """Decode the records up to the first one out of sequence."""
    if not records or records[0].kind != "H":
        raise FormatError(
            "bad_live_log", f"{source} is damaged at its beginning; there is no hello to read it by."
        )
    try:
        log = _Taken(parse_hello(records[0].body))
    except InputError as e:
        raise FormatError("bad_live_log", f"{source}: {e.message}") from e
    digest, number = hashlib.sha256(), 0
    try:
        for r in records[1:]:
            number += 1
            if r.kind == "F":
                log.finish = parse_finish(r.body)
                continue
            header = read_batch_header(r.body)
            check_fits(header, log.hello)
            if r.kind == "H" or header.seq != len(log.batches):
                raise InputError("batch_shape", f"batch {header.seq} follows {len(log.batches) - 1}")
            digest.update(view_samples(r.body, header))
            log.batches.append(decode_batch(r.body, header))
    except InputError as e:
        message = f"Record {number} of {source} does not belong there ({e.message}); the rest was left out."
        log.notices.append(Notice("live_log_torn", message))
    log.digest = digest.hexdigest()
    return log


def _compare_finish(log: _Taken, source: str) -> None:
    if log.finish is None:
        message = (
            f"{source} ends without a finish: the sender never said that this is all. "
            f"Batches received: {len(log.batches)}."
        )
        log.notices.append(Notice("live_unfinished", message))
    elif log.finish.count != len(log.batches):
        message = f"Number of batches by the sender: {log.finish.count}, in {source}: {len(log.batches)}."
        log.notices.append(Notice("live_count_mismatch", message))
    elif log.finish.sha256 != log.digest:
        message = (
            f"The samples in {source} are not those the sender hashed (sha256 {log.digest[:12]}…, sent "
            f"{log.finish.sha256[:12]}…). Every batch passed its own checksum; look at the sender."
        )
        log.notices.append(Notice("live_hash_mismatch", message))


def _streams(log: _Taken, source: str) -> tuple[dict[str, ImuStream], list[Notice]]:
    """Streams by sensor, in the order of the hello, and notices about them."""
    clock = LiveClock(log.hello)
    by_number: dict[int, list[SampleBatch]] = {}
    times: dict[int, list[Micros]] = {}
    rate = {s.stream: s.rate_hz for s in log.hello.streams}
    for batch in log.batches:
        t = sample_times_us(batch, rate[batch.stream])
        clock.push(batch.stream, int(t[0]), int(t[-1]), batch.sent_us)
        by_number.setdefault(batch.stream, []).append(batch)
        times.setdefault(batch.stream, []).append(t)
    first = log.batches[0]
    origin = first.t0_us + (clock.offset_us(first.stream, final=False) or 0)
    streams: dict[str, ImuStream] = {}
    notices: list[Notice] = []
    for info in log.hello.streams:
        if info.stream not in times:
            notices.append(_missing(info.sensors))
            continue
        offset = clock.offset_us(info.stream, final=False) or 0
        t_us, samples, odd = _in_order(np.concatenate(times[info.stream]), by_number[info.stream], info)
        t_s = np.asarray((t_us + (offset - origin)) * 1e-6, np.float64)
        notices += odd
        for i, sensor in enumerate(info.sensors):
            stream = _stream(info, sensor, t_s, samples[:, i], source)
            if stream is None:
                notices.append(_missing((sensor,)))
            else:
                streams[sensor.id] = stream
    if not clock.single:
        own = ", ".join(x.id for s in log.hello.streams if s.clock == "own" for x in s.sensors)
        message = (
            f"{own}: each has a clock of its own, aligned by when its batches were sent in the first second. "
            "Times between sensors are uncertain by how much the radio delays vary, some 10 ms."
        )
        notices.append(Notice("clocks_aligned", message, severity="info"))
    return streams, notices


def _missing(sensors: Sequence[SensorInfo]) -> Notice:
    names = ", ".join(x.id for x in sensors)
    message = f"No sample of {names} was received; results that need it are left out."
    return Notice("sensor_missing", message, sensors[0].id)


def _in_order(
    t_us: Micros, batches: Sequence[SampleBatch], info: StreamInfo
) -> tuple[Micros, Floats, list[Notice]]:
    """Samples (n, k, 9) with a time later than all previous ones; the others are dropped and counted."""
    samples: Floats = np.concatenate([b.samples for b in batches]).astype(np.float64)
    ahead = np.maximum.accumulate(t_us)
    rising = np.concatenate(([True], t_us[1:] > ahead[:-1]))
    lost = int(np.count_nonzero(~rising))
    if not lost:
        return t_us, samples, []
    severity = grade_loss(lost, len(t_us)) if lost <= _MOST_OUT_OF_ORDER * len(t_us) else "error"
    message = (
        f"{lost} of {len(t_us)} samples of stream {info.stream} "
        f"{plural(lost, 'repeats or runs', 'repeat or run')} backwards in time and "
        f"{plural(lost, 'was', 'were')} left out; the sensor's clock jumped."
    )
    notice = Notice("out_of_order", message, info.sensors[0].id, severity=severity)
    return t_us[rising], samples[rising], [notice]


def _stream(info: StreamInfo, sensor: SensorInfo, t_s: Floats, x: Floats, source: str) -> ImuStream | None:
    """One sensor, None without a sample; infinite values are missing and counted."""
    infinite = int(np.count_nonzero(np.isinf(x).any(axis=1)))
    x[np.isinf(x)] = np.nan
    missing = int(np.count_nonzero(np.isnan(x[:, :6]).any(axis=1))) - infinite
    acc, gyr, mag = (np.ascontiguousarray(x[:, k : k + 3]) for k in (0, 3, 6))
    has_gyr, has_mag = (bool(np.isfinite(a).all(axis=1).any()) for a in (gyr, mag))
    if not np.isfinite(x[:, : 6 if has_gyr else 3]).all(axis=1).any():
        return None
    notices = []
    if infinite:
        message = plural(
            infinite,
            f"{infinite} sample of {sensor.id} was sent as infinite and counts as lost.",
            f"{infinite} samples of {sensor.id} were sent as infinite and count as lost.",
        )
        notices.append(Notice("not_finite", message, sensor.id))
    if has_gyr and missing > 0:
        were = plural(missing, "was", "were")
        message = f"{missing} of {len(x)} samples of {sensor.id} {were} sent as not measured."
        notices.append(Notice("samples_missing", message, sensor.id, severity="info"))
    if not has_gyr:
        message = f"{sensor.id} sent no angular rate; it cannot be used for orientations."
        notices.append(Notice("missing_gyro", message, sensor.id))
    shown_gyr, shown_mag = gyr if has_gyr else None, mag if has_mag else None
    return ImuStream(
        device_id=sensor.id,
        source=source,
        t_s=t_s.copy(),
        acc=acc,
        gyr=shown_gyr,
        mag=shown_mag,
        quat=None,
        rate_hz=info.rate_hz,
        clock="device",
        digest=signal_digest(acc, shown_gyr, shown_mag),
        notices=tuple(notices),
    )
