"""Between a file and a stream: signals in SI units whose common time origin is not known yet.

A packet counter says when a sample was taken only relative to the counters of the other sensors of the take
(they wrap at 16 bit and may start on both sides of the wrap), so time is made for all files together.
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
from sagittal.core.formats.clocks import Repair, repair_clock
from sagittal.core.formats.clocks.report import refuse_constant, refuse_restart
from sagittal.core.frames import Floats, Segment
from sagittal.core.plurals import plural
from sagittal.core.signals.held_samples import cut_blocks, is_complete
from sagittal.core.signals.recording import ImuStream

WRAP_16: Final = 1 << 16
WRAP_32: Final = 1 << 32
ASSUMED_RATE_HZ: Final = 100.0
"""Shown, never used for results: the notice `rate_unknown` is an error."""
MOST_OFF: Final = 0.02
"""Share by which a declared rate may differ from that of the time column [our choice: crystals differ by 0.01 %]."""
ROUNDED: Final = 0.005
"""Share by which the mean of the usual intervals differs from their median where stamps were rounded."""
LOSSY: Final = frozenset({"rows_repeated", "rows_unplaced", "stamps_missing"})
"""Repairs after which something is missing or only estimated."""
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
    clock : what `ticks` (n,) are: "counter" packet counter as written, "device" seconds, "index" row number.
    acc, gyr, mag : (n, 3), quat : (n, 4); SI units, NaN where missing; None without such columns.
    rate_hz : None = the file does not say. wrap : tick at which the clock starts again; None = a device clock
        never does, a counter at 16 bit, or 32 when it shows more.
    segment : where it is worn, as the file says it; None = it does not. tick : s of the smallest unit in which
        a device clock is written, 0 = unknown.
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
    tick: float = 0.0


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
    tick: float = 0.0,
) -> Draft:
    """A sensor as its file gives it; a signal without a single number is none, and a gyroscope is missed.

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
    return Draft(device, source, clock, ticks, acc, gyr, mag, quat, rate_hz, tuple(told), wrap, segment, tick)


def finish(drafts: Sequence[Draft]) -> dict[str, ImuStream]:
    """Give all drafts of a take one time origin per clock.

    Raises
    ------
    FormatError
        duplicate_device (two different files of one sensor), counter_restart, empty.
    """
    drafts = [_in_order(d) for d in _without_second_copies(drafts)]
    drafts = [_with_rate(d, drafts) for d in drafts]
    streams: dict[str, ImuStream] = {}
    for clock in sorted({d.clock for d in drafts}):
        group = [d for d in drafts if d.clock == clock]
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
    """Fill a rate that neither the file nor its clock gives: from the other sensors of the take, else say so."""
    if d.rate_hz is not None:
        return d
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
    """Drop a file that was given twice; refuse two different takes of one sensor."""
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
    """Give every row its true time: rows sorted, wraps undone, faults of the clock repaired and reported."""
    seconds = d.clock == "device"
    wrap = _wrap(d, d.ticks[np.isfinite(d.ticks)]) if d.clock == "counter" or d.wrap is not None else None
    signals = [d.acc] if d.gyr is None else [d.acc, d.gyr]
    found = repair_clock(d.ticks, signals, seconds=seconds, wrap=wrap, tick=d.tick)
    if not len(found.ticks):
        raise FormatError("empty", f"{d.source} has no row with a valid counter or time.", sensor=d.device_id)
    if found.constant is not None:
        return _without_clock(d, found.constant, float(found.ticks[0]))
    if found.restart is not None:
        t = float(found.ticks[found.restart] - found.ticks[0]) if seconds else found.restart / _rate(d)
        raise refuse_restart(d.source, d.device_id, found.restart, len(d.ticks), t)
    notices = (*d.notices, *(_tell(r, d) for r in found.repairs))
    rate = d.rate_hz
    if seconds and len(found.ticks) > 1:
        measured = 1.0 / (found.step or _measure_step(found.ticks))
        if rate is not None and abs(measured - rate) > MOST_OFF * rate:
            notices = (*notices, _contradict(d, rate, measured))
            rate = None
        if rate is None and np.isfinite(measured):
            rate = measured
    if found.rows is None:
        kept = replace(d, ticks=found.ticks, rate_hz=rate, notices=notices)
    else:
        rows = found.rows
        kept = replace(
            d,
            ticks=found.ticks,
            acc=d.acc[rows],
            gyr=None if d.gyr is None else d.gyr[rows],
            mag=None if d.mag is None else d.mag[rows],
            quat=None if d.quat is None else d.quat[rows],
            rate_hz=rate,
            notices=notices,
        )
    if not has_whole_row(kept.acc):
        raise FormatError(
            "empty",
            f"{d.source} has no row with both a valid counter and a complete acceleration; export it again.",
            sensor=d.device_id,
        )
    return kept


def _measure_step(ticks: Floats) -> float:
    """Usual interval of rising stamps, s; the mean of the usual ones where few decimals make them differ."""
    steps = np.diff(ticks)
    middle = float(np.median(steps))
    mean = float(steps[(steps > 0.5 * middle) & (steps < 1.5 * middle)].mean())
    return mean if abs(mean - middle) > ROUNDED * middle else middle


def _contradict(d: Draft, declared: float, measured: float) -> Notice:
    return Notice(
        "rate_contradicted",
        f"{d.source}: the declared rate is {declared:g} Hz, but by its time column it was recorded at "
        f"{measured:.4g} Hz; the time column was used. Check the rate and the unit of time.",
        d.device_id,
    )


def _tell(repair: Repair, d: Draft) -> Notice:
    """What was repaired, as a notice; faults of many rows are a warning."""
    severity = repair.severity
    if severity == "info" and repair.code in LOSSY:
        severity = grade_loss(repair.rows, len(d.ticks))
    return Notice(repair.code, f"{d.source}: {repair.message}", d.device_id, severity=severity)


def _without_clock(d: Draft, distinct: int, value: float) -> Draft:
    """The rows timed by the declared rate where the stamps are no clock; refused without a rate."""
    if d.rate_hz is None or d.clock != "device":
        value = value if d.clock == "device" else np.nan
        raise refuse_constant(d.source, d.device_id, len(d.ticks), distinct, value)
    note = Notice(
        "time_constant",
        f"{d.source}: nearly all time stamps are equal ({value:.6g}), a spreadsheet has probably rounded them. "
        f"The declared rate of {d.rate_hz:g} Hz was used instead; lost samples cannot be detected.",
        d.device_id,
    )
    return replace(d, ticks=np.arange(len(d.ticks)) / d.rate_hz, wrap=None, notices=(*d.notices, note))


def grade_loss(lost: int, rows: int) -> Severity:
    """Severity of rows that a file lost: information up to `FEW_ROWS`, a warning beyond."""
    return "info" if lost <= FEW_ROWS * rows else "warning"


def _wrap(d: Draft, ticks: Floats) -> float:
    """Range of the counter: as declared, else 16 bit as in Xsens exports, unless it shows a larger value."""
    if d.wrap is not None:
        return d.wrap
    return WRAP_16 if not len(ticks) or ticks.max() < WRAP_16 else WRAP_32


def _shared_counter(group: Sequence[Draft]) -> list[Draft]:
    """Shift whole wraps so that all sensors start within half a wrap of each other.

    A sensor at another rate than most counts other packets; its time cannot be compared and this is an error.
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
    """Device clocks that wrap, so that all start within half a turn of each other."""
    return [_turned(d, start, d.wrap) if d.wrap else d for d in group]


def _turned(d: Draft, start: float, wrap: float) -> Draft:
    """The same with whole turns of its clock added, nearest to `start`."""
    return replace(d, ticks=d.ticks + np.round((start - float(d.ticks[0])) / wrap) * wrap)


def digest(d: Draft) -> str:
    """Of the signals in single precision, so that a stored and re-read stream keeps its digest."""
    return signal_digest(d.acc, d.gyr, d.mag)


def signal_digest(acc: Floats, gyr: Floats | None, mag: Floats | None) -> str:
    """What tells the samples of one sensor from those of another, (n, 3) each, for `digest`.

    SHA-256 over weighted sums of `_SUMMED` words of 64 bits, in a quarter of the time that it takes over the
    words. Who wants to can make two takes with one digest; a copy is found by it, nothing is secured.
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
    with np.errstate(invalid="ignore"):  # a signalling NaN is NaN too
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
