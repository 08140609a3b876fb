"""Intermediate form between a file and a stream: SI units, common time origin not yet known.

A packet counter gives the time of a sample only relative to the counters of the other sensors of the
recording (they wrap at 16 bit and may start on both sides of the wrap), so times are assigned for all files
together.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import FormatError, Notice, Severity
from sagittal.core.frames import Floats, Segment
from sagittal.core.plurals import plural
from sagittal.core.signals.held_samples import cut_blocks, is_complete
from sagittal.core.signals.recording import ImuStream

WRAP_16: Final = 1 << 16
WRAP_32: Final = 1 << 32
ASSUMED_RATE_HZ: Final = 100.0
"""Shown, never used for results: the notice `rate_unknown` is an error."""
MOST_OUT_OF_ORDER: Final = 0.01
"""Share of rows that may run backwards before we say that the file holds two takes [our choice]."""
FEW_ROWS: Final = 0.01
"""Share of rows that a file may lose for information only: whether what is missing changes a number is judged
on the time axis, which reports gaps and filled samples (core/quality/assessment.py) [our choice]."""


_SUMMED: Final = 16
_WEIGHTS: Final = np.array([pow(0x9E3779B97F4A7C15, i, 1 << 64) for i in range(_SUMMED)], np.uint64)
"""Odd, so that no bit of a word is lost; without them words in another order have the same sum."""


@dataclass(frozen=True, eq=False)
class Draft:
    """One sensor of one file.

    Parameters
    ----------
    clock : kind of `ticks` (n,): "counter" packet counter as written, "device" seconds, "index" row number.
    acc, gyr, mag : (n, 3), quat : (n, 4); SI units, NaN where missing; None without such columns.
    rate_hz : None = not in the file. wrap : tick at which the clock wraps; None = never for a device clock,
        at 16 bit for a counter, or at 32 if it has larger values.
    segment : placement given in the file; None = not given.
    """

    device_id: str
    source: str
    clock: str
    ticks: Floats
    acc: Floats
    gyr: Floats | None
    mag: Floats | None
    quat: Floats | None
    rate_hz: float | None
    notices: tuple[Notice, ...] = ()
    wrap: float | None = None
    segment: Segment | None = None


def make_draft(
    device: str,
    source: str,
    clock: str,
    ticks: Floats,
    *,
    acc: Floats,
    gyr: Floats | None = None,
    mag: Floats | None = None,
    quat: Floats | None = None,
    rate_hz: float | None = None,
    notices: Sequence[Notice] = (),
    wrap: float | None = None,
    segment: Segment | None = None,
) -> Draft:
    """Draft of one sensor; a signal without any number is absent, and a missing gyroscope gives a notice.

    Raises
    ------
    FormatError `missing_acc`.
    """
    if not has_whole_row(acc):
        raise FormatError(
            "missing_acc",
            f"{source}: the acceleration of {device} holds no numbers; export it again with acceleration.",
            sensor=device,
        )
    told = [replace(n, sensor=device) for n in notices]
    gyr, mag, quat = (x if x is not None and np.isfinite(x).any() else None for x in (gyr, mag, quat))
    if gyr is None:
        told.append(
            Notice(
                "missing_gyro",
                f"{source}: sensor {device} has no gyroscope signal, so no walk can be computed from it. "
                "Record or export it with the gyroscope on.",
                device,
            )
        )
    return Draft(device, source, clock, ticks, acc, gyr, mag, quat, rate_hz, tuple(told), wrap, segment)


def finish(drafts: Sequence[Draft]) -> dict[str, ImuStream]:
    """Convert all drafts of a recording to one time origin per clock.

    Raises
    ------
    FormatError duplicate_device (two different files of one sensor), counter_restart, empty.
    """
    drafts = _without_second_copies([_with_rate(d, drafts) for d in drafts])
    streams: dict[str, ImuStream] = {}
    for clock in sorted({d.clock for d in drafts}):
        group = [_in_order(d) for d in drafts if d.clock == clock]
        if clock == "counter":
            group = _shared_counter(group)
        elif any(d.wrap for d in group):
            group = _near(group, float(group[0].ticks[0]))
        origin = min(float(d.ticks[0]) for d in group)
        for d in group:
            scale = 1.0 if clock == "device" else 1.0 / _rate(d)
            streams[d.device_id] = _stream(d, (d.ticks - origin) * scale)
    return {d.device_id: streams[d.device_id] for d in drafts}


def _rate(d: Draft) -> float:
    return d.rate_hz or ASSUMED_RATE_HZ


def _with_rate(d: Draft, all_of_take: Sequence[Draft]) -> Draft:
    """Add a rate missing in a file: from its clock, else from the other sensors of the recording, else a
    notice.
    """
    if d.rate_hz is not None:
        return d
    ticks = d.ticks[np.isfinite(d.ticks)]
    if d.clock == "device" and len(ticks) > 1:
        step = float(np.median(np.diff(ticks)))
        if step > 0 and np.isfinite(1.0 / step):
            return replace(d, rate_hz=1.0 / step)
    known = {o.rate_hz for o in all_of_take if o.clock == d.clock and o.rate_hz is not None}
    if len(known) == 1:
        rate = known.pop()
        note = Notice(
            "rate_from_others",
            f"{d.source} names no sampling rate; {rate:g} Hz was taken from the other sensors.",
            d.device_id,
            severity="info",
        )
        return replace(d, rate_hz=rate, notices=(*d.notices, note))
    note = Notice(
        "rate_unknown",
        f"{d.source} names no sampling rate ({ASSUMED_RATE_HZ:g} Hz is only assumed for display); "
        'give it in the manifest: {"sources": [{"file": "*.txt", "rate_hz": 100}]}.',
        d.device_id,
        severity="error",
    )
    return replace(d, notices=(*d.notices, note))


def _without_second_copies(drafts: Sequence[Draft]) -> list[Draft]:
    """Drop a file given twice; reject two different recordings of one sensor."""
    kept: dict[str, Draft] = {}
    for d in drafts:
        other = kept.get(d.device_id)
        if other is None:
            kept[d.device_id] = d
        elif digest(other) == digest(d) and np.array_equal(other.ticks, d.ticks):
            note = Notice(
                "file_given_twice",
                f"{d.source} repeats {other.source} and was left out.",
                d.device_id,
                severity="info",
            )
            kept[d.device_id] = replace(other, notices=(*other.notices, note))
        else:
            raise FormatError(
                "duplicate_device",
                f"{other.source} and {d.source} both come from sensor {d.device_id} but differ; "
                "upload one take at a time (each sensor once).",
                sensor=d.device_id,
            )
    return list(kept.values())


def _in_order(d: Draft) -> Draft:
    """Unwrap the counter and drop rows that repeat or run backwards."""
    good = np.isfinite(d.ticks)
    lost = int(np.count_nonzero(~good))
    ticks = d.ticks[good]
    if d.clock == "counter" or d.wrap is not None:
        ticks = _unwrapped(ticks, _wrap(d, ticks))
    if not len(ticks):
        raise FormatError("empty", f"{d.source} has no row with a valid counter or time.", sensor=d.device_id)
    highest = np.maximum.accumulate(ticks)
    rising = np.concatenate(([True], ticks[1:] > highest[:-1]))
    back = int(np.count_nonzero(~rising))
    if back > max(5, MOST_OUT_OF_ORDER * len(ticks)):
        t = float(np.argmin(rising)) / _rate(d)
        raise FormatError(
            "counter_restart",
            f"{d.source}: the packet counter or time runs backwards in {back} of {len(ticks)} rows, "
            f"first at row {int(np.argmin(rising)) + 1}. If the file holds two takes, export them apart.",
            sensor=d.device_id,
            t_s=t,
        )
    keep = np.flatnonzero(good)[rising]
    if not has_whole_row(d.acc[keep]):
        raise FormatError(
            "empty",
            f"{d.source} has no row with both a valid counter and a complete acceleration; export it again.",
            sensor=d.device_id,
        )
    notices = d.notices
    if back or lost:
        notices = (
            *notices,
            Notice(
                "out_of_order",
                f"{d.source}: {back + lost} {plural(back + lost, 'row', 'rows')} with a repeated, reversed "
                f"or missing counter {plural(back + lost, 'was', 'were')} left out.",
                d.device_id,
                severity=grade_loss(back + lost, len(d.ticks)),
            ),
        )
    if len(keep) == len(d.ticks):
        return replace(d, ticks=ticks, notices=notices)
    return replace(
        d,
        ticks=ticks[rising],
        acc=d.acc[keep],
        gyr=None if d.gyr is None else d.gyr[keep],
        mag=None if d.mag is None else d.mag[keep],
        quat=None if d.quat is None else d.quat[keep],
        notices=notices,
    )


def grade_loss(lost: int, rows: int) -> Severity:
    """Severity of lost rows in a file: information up to `FEW_ROWS`, a warning above."""
    return "info" if lost <= FEW_ROWS * rows else "warning"


def _wrap(d: Draft, ticks: Floats) -> float:
    """Range of the counter: as declared, else 16 bit as in Xsens exports, unless it has larger values."""
    if d.wrap is not None:
        return d.wrap
    return WRAP_16 if not len(ticks) or ticks.max() < WRAP_16 else WRAP_32


def _unwrapped(ticks: Floats, wrap: float) -> Floats:
    """Unwrapped counter: steps modulo its range, taken to the nearer side."""
    step = np.mod(np.diff(ticks) + wrap / 2, wrap) - wrap / 2
    return np.concatenate((ticks[:1], ticks[:1] + np.cumsum(step)))


def _shared_counter(group: Sequence[Draft]) -> list[Draft]:
    """Shift by whole wraps so that all sensors start within half a wrap of each other.

    A sensor with a rate different from the majority counts different packets; its time is not comparable,
    which is an error.
    """
    rate = Counter(_rate(d) for d in group).most_common(1)[0][0]
    start = float(group[0].ticks[0])
    wrap = max(_wrap(d, d.ticks[:1]) for d in group)
    out = []
    for d in group:
        if abs(_rate(d) - rate) > 1e-6 * rate:
            note = Notice(
                "rates_differ",
                f"{d.source} runs at {_rate(d):g} Hz, the others at {rate:g} Hz; their packet counters "
                "cannot be compared. Export all sensors of the take at one rate.",
                d.device_id,
                severity="error",
            )
            out.append(replace(d, notices=(*d.notices, note)))
            continue
        out.append(_turned(d, start, wrap))
    return out


def _near(group: Sequence[Draft], start: float) -> list[Draft]:
    """Device clocks that wrap, shifted so that all start within half a period of each other."""
    return [_turned(d, start, d.wrap) if d.wrap else d for d in group]


def _turned(d: Draft, start: float, wrap: float) -> Draft:
    """The draft shifted by whole periods of its clock, as close as possible to `start`."""
    return replace(d, ticks=d.ticks + np.round((start - float(d.ticks[0])) / wrap) * wrap)


def digest(d: Draft) -> str:
    """Digest of the signals in single precision, so that a stored and reread stream has the same digest."""
    return signal_digest(d.acc, d.gyr, d.mag)


def signal_digest(acc: Floats, gyr: Floats | None, mag: Floats | None) -> str:
    """Fingerprint of the samples of one sensor, (n, 3) each, for `digest`.

    SHA-256 over weighted sums of `_SUMMED` words of 64 bits, four times as fast as over the words themselves.
    Collisions can be constructed deliberately; it serves to detect copies, not for security.
    """
    h = hashlib.sha256()
    for name, a in (("acc", acc), ("gyr", gyr), ("mag", mag)):
        if a is not None:
            h.update(f"{name}{len(a)}".encode())
            for part in cut_blocks(len(a)):
                bits = _bits(a[part]).ravel()
                end = len(bits) - len(bits) % (2 * _SUMMED)
                words = bits[:end].view(np.uint64)
                # the uppermost bit, the sign of every second number, has any odd weight alike
                words ^= words >> np.uint64(31)
                h.update(np.einsum("i,ij->j", _WEIGHTS, words.reshape(_SUMMED, -1)))
                h.update(bits[end:].tobytes())
    return h.hexdigest()


def _bits(a: Floats) -> NDArray[np.float32]:
    """float32 in C order with one bit pattern for NaN and one for zero."""
    b = np.add(a, np.float32(0), order="C", dtype=np.float32, casting="same_kind")
    missing = np.isnan(b)
    if missing.any():
        b[missing] = np.nan
    return b


def has_whole_row(signal: Floats) -> bool:
    """Whether any sample of (n, axes) is finite in all axes."""
    return any(is_complete(signal[part]).any() for part in cut_blocks(len(signal)))


def _stream(d: Draft, t_s: Floats) -> ImuStream:
    return ImuStream(
        device_id=d.device_id,
        source=d.source,
        t_s=t_s,
        acc=d.acc,
        gyr=d.gyr,
        mag=d.mag,
        quat=d.quat,
        rate_hz=_rate(d),
        clock=d.clock,
        digest=digest(d),
        notices=d.notices,
    )
