"""Drafts of a trial → streams: every row at its true time, and one time origin per clock.

Packet counters are comparable only among the sensors of one trial (they wrap at 16 bit and may start on
both sides of the wrap), so the times of all files are determined together.
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
    rates = {o.rate_hz for o in all_of_take if o.clock == d.clock and o.rate_hz is not None}
    if len(rates) == 1:
        rate = rates.pop()
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
    drafts_by_key: dict[tuple[str, str | None], Draft] = {}
    for d in drafts:
        key = d.device_id, d.part
        previous = drafts_by_key.get(key)
        if previous is None:
            drafts_by_key[key] = d
        elif digest(previous) == digest(d) and np.array_equal(previous.ticks, d.ticks):
            note = Notice(
                "file_given_twice",
                f"{d.source} repeats {previous.source} and was left out.",
                d.device_id,
                severity="info",
            )
            drafts_by_key[key] = replace(previous, notices=(*previous.notices, note))
        else:
            raise FormatError(
                "duplicate_device",
                f"{previous.source} and {d.source} both come from sensor {d.device_id} but differ; "
                "upload one take at a time (each sensor once).",
                sensor=d.device_id,
            )
    return list(drafts_by_key.values())


def _in_order(d: Draft) -> Draft:
    """Give every row its true time: rows sorted, wraps undone, faults of the clock repaired and reported."""
    seconds = d.clock == "device"
    wrap = _wrap(d, d.ticks[np.isfinite(d.ticks)]) if d.clock == "counter" or d.wrap is not None else None
    signals = [d.acc] if d.gyr is None else [d.acc, d.gyr]
    true_clock = repair_clock(d.ticks, signals, seconds=seconds, wrap=wrap, tick=d.tick)
    if not len(true_clock.ticks):
        raise FormatError("empty", f"{d.source} has no row with a valid counter or time.", sensor=d.device_id)
    if true_clock.constant is not None:
        return _without_clock(d, true_clock.constant, float(true_clock.ticks[0]))
    if true_clock.restart is not None:
        t = (
            float(true_clock.ticks[true_clock.restart] - true_clock.ticks[0])
            if seconds
            else true_clock.restart / _rate(d)
        )
        raise refuse_restart(d.source, d.device_id, true_clock.restart, len(d.ticks), t)
    notices = (*d.notices, *(_tell(r, d) for r in true_clock.repairs))
    rate = d.rate_hz
    if seconds and len(true_clock.ticks) > 1:
        measured = 1.0 / (true_clock.step or _measure_step(true_clock.ticks))
        if rate is not None and abs(measured - rate) > MOST_OFF * rate:
            notices = (*notices, _contradict(d, rate, measured))
            rate = None
        if rate is None and np.isfinite(measured):
            rate = measured
    if true_clock.rows is None:
        result = replace(d, ticks=true_clock.ticks, rate_hz=rate, notices=notices)
    else:
        rows = true_clock.rows
        result = replace(
            d,
            ticks=true_clock.ticks,
            acc=d.acc[rows],
            gyr=None if d.gyr is None else d.gyr[rows],
            mag=None if d.mag is None else d.mag[rows],
            quat=None if d.quat is None else d.quat[rows],
            rate_hz=rate,
            notices=notices,
        )
    if not has_whole_row(result.acc):
        raise FormatError(
            "empty",
            f"{d.source} has no row with both a valid counter and a complete acceleration; export it again.",
            sensor=d.device_id,
        )
    return result


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
    """Notice of a clock repair; a warning if many rows are affected."""
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
