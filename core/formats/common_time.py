"""Drafts of a take → streams: every row at its true time, and one time origin per clock.

A packet counter says when a sample was taken only relative to the counters of the other sensors of the take
(they wrap at 16 bit and may start on both sides of the wrap), so time is made for all files together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats.clocks import Repair, repair_clock
from sagittal.core.formats.clocks.report import refuse_constant, refuse_restart
from sagittal.core.formats.draft import WRAP_32, Draft, digest, grade_loss, has_whole_row
from sagittal.core.formats.parts import join_parts
from sagittal.core.frames import Floats
from sagittal.core.signals.recording import ImuStream

WRAP_16: Final = 1 << 16
ASSUMED_RATE_HZ: Final = 100.0
"""Shown, never used for results: the notice `rate_unknown` is an error."""
MOST_OFF: Final = 0.02
"""Share by which a declared rate may differ from the time column's [chosen: crystals are off by 1e-4]."""
ROUNDED: Final = 0.005
"""Share by which the mean of the usual intervals differs from their median where stamps were rounded."""
LOSSY: Final = frozenset({"rows_repeated", "rows_unplaced", "stamps_missing"})
"""Repairs after which something is missing or only estimated."""


def finish(drafts: Sequence[Draft]) -> dict[str, ImuStream]:
    """Give all drafts of a take one time origin per clock.

    Raises
    ------
    FormatError
        duplicate_device (two different files of one sensor), counter_restart, empty.
    """
    drafts = join_parts([_in_order(d) for d in _without_second_copies(drafts)])
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
    """Fill a rate that neither file nor clock gives: from the other sensors of the take, else report it."""
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
    kept: dict[tuple[str, str | None], Draft] = {}
    for d in drafts:
        key = d.device_id, d.part
        other = kept.get(key)
        if other is None:
            kept[key] = d
        elif digest(other) == digest(d) and np.array_equal(other.ticks, d.ticks):
            note = Notice(
                "file_given_twice",
                f"{d.source} repeats {other.source} and was left out.",
                d.device_id,
                severity="info",
            )
            kept[key] = replace(other, notices=(*other.notices, note))
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
        f"{d.source}: nearly all time stamps are equal ({value:.6g}), a spreadsheet has probably rounded "
        f"them. The declared rate of {d.rate_hz:g} Hz was used instead; lost samples cannot be detected.",
        d.device_id,
    )
    return replace(d, ticks=np.arange(len(d.ticks)) / d.rate_hz, wrap=None, notices=(*d.notices, note))


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
