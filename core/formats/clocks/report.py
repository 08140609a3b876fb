"""Descriptions of clock repairs, one sentence per cause."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sagittal.core.errors import FormatError, Severity
from sagittal.core.plurals import plural


@dataclass(frozen=True)
class Repair:
    """Repair of one fault of a clock.

    Parameters
    ----------
    code : stable identifier, snake_case. rows : number of rows affected. message : fault, location and
        correction, without the name of the file.
    """

    code: str
    rows: int
    message: str
    severity: Severity = "info"


def describe_missing(rows: int, first: int) -> Repair:
    """Rows without a stamp that were placed by their neighbours."""
    return Repair(
        "stamps_missing",
        rows,
        f"{rows} {plural(rows, 'row has', 'rows have')} no time stamp, the first is row {first + 1}; "
        f"{plural(rows, 'it was', 'they were')} timed by the neighbouring rows.",
    )


def describe_wrap(times: int, first: int, label: str) -> Repair:
    """Wraps of a clock or counter that were undone."""
    return Repair(
        "clock_wrapped",
        times,
        f"The clock starts again at the end of its range ({label}) {times} {plural(times, 'time', 'times')}, "
        f"first at row {first + 1}; the wraps were undone.",
    )


def describe_leap(row: int, seconds: float, reason: str) -> Repair:
    """A leap of all later stamps by an amount that explains itself."""
    return Repair(
        "clock_leap",
        1,
        f"From row {row + 1} on, all times are {abs(seconds):g} s {'later' if seconds > 0 else 'earlier'} "
        f"({reason}); this jump was removed.",
    )


def describe_set_back(row: int, seconds: float) -> Repair:
    """A clock that was set back by any amount while it recorded."""
    return Repair(
        "clock_set_back",
        1,
        f"At row {row + 1} the clock was set back by {seconds:.3g} s; the later rows were joined without a "
        "gap. If samples are missing there, strides next to it are wrong.",
        "warning",
    )


def describe_order(rows: int, first: int) -> Repair:
    """Rows that came late and were sorted."""
    return Repair(
        "out_of_order",
        rows,
        f"{rows} {plural(rows, 'row', 'rows')} out of order (first: row {first + 1}) "
        f"{plural(rows, 'was', 'were')} sorted by time; no sample is missing because of it.",
    )


def describe_repeats(rows: int, first: int) -> Repair:
    """Rows that were stored twice."""
    return Repair(
        "rows_repeated",
        rows,
        f"{rows} {plural(rows, 'row was', 'rows were')} stored twice (first: row {first + 1}); the "
        "duplicates were removed.",
    )


def describe_wrong(rows: int, first: int, worst_s: float) -> Repair:
    """Rows whose stamp contradicts the rows around them."""
    return Repair(
        "stamps_wrong",
        rows,
        f"{rows} {plural(rows, 'row has', 'rows have')} a wrong time stamp, up to {worst_s:.3g} s off "
        f"(first: row {first + 1}); {plural(rows, 'it was', 'they were')} timed by the neighbouring rows.",
    )


def describe_late(rows: int, first: int) -> Repair:
    """Rows stamped on arrival after a delay."""
    return Repair(
        "stamps_late",
        rows,
        f"{rows} {plural(rows, 'row has', 'rows have')} the time of a delayed transmission instead of the "
        f"time of measurement (first: row {first + 1}); {plural(rows, 'it was', 'they were')} spread evenly.",
    )


def describe_dropped(rows: int, first: int) -> Repair:
    """Rows that have no place on the axis."""
    return Repair(
        "rows_unplaced",
        rows,
        f"{rows} {plural(rows, 'row has', 'rows have')} a time stamp that fits nowhere (first: row "
        f"{first + 1}); {plural(rows, 'it was', 'they were')} left out.",
    )


def describe_shared(most: int, rate_hz: float | None) -> Repair:
    """Stamps that several rows share."""
    rate_text = "" if rate_hz is None else f" at {rate_hz:.4g} Hz"
    return Repair(
        "stamps_shared",
        most,
        f"Up to {most} rows share one time stamp (packets, or times without enough decimals); they were "
        f"spread evenly{rate_text}.",
    )


def describe_equal_neighbours(rows: int, first: int) -> Repair:
    """A few stamps that repeat the one before although a new sample was taken."""
    return Repair(
        "stamps_shared",
        rows,
        f"{rows} {plural(rows, 'row repeats', 'rows repeat')} the time stamp of the row before (first: row "
        f"{first + 1}) and {plural(rows, 'was', 'were')} timed by the neighbouring rows.",
    )


def describe_blind(rows: int, first: int, wrap: float) -> Repair:
    """Losses next to which a narrow counter cannot count."""
    return Repair(
        "counter_blind",
        rows,
        f"The counter starts again after {wrap:.0f} samples, so "
        f"{plural(rows, 'a loss', 'each of the losses')} (first: row {first + 1}) may be {wrap:.0f} "
        "samples longer, or a multiple of it. Strides next to "
        f"{plural(rows, 'it', 'them')} may be wrong.",
        "warning",
    )


def describe_no_time_left(rows: int, first: int) -> Repair:
    """Rows that repeat a stamp while the clock runs on as if they were not there."""
    return Repair(
        "rows_repeated",
        rows,
        f"{rows} {plural(rows, 'row repeats', 'rows repeat')} the time or count of the row before (first: "
        f"row {first + 1}) and {plural(rows, 'was', 'were')} left out.",
    )


def refuse_restart(source: str, device: str, row: int, rows: int, t_s: float | None) -> FormatError:
    """A clock that starts again: two recordings in one file."""
    return FormatError(
        "counter_restart",
        f"{source}: at row {row + 1} of {rows} the packet counter or time starts again, so the file holds "
        "two recordings. Export them separately.",
        sensor=device,
        t_s=t_s,
    )


def refuse_constant(source: str, device: str, rows: int, distinct: int, value: float) -> FormatError:
    """Stamps that a spreadsheet has rounded until all are equal; `value` is NaN for a counter."""
    if math.isnan(value):
        return FormatError(
            "time_constant",
            f"{source}: the packet counter does not count, it has {distinct} different "
            f"{plural(distinct, 'value', 'values')} in {rows} rows. Export the file again with its counter.",
            sensor=device,
        )
    many = "All" if distinct == 1 else f"Nearly all ({distinct} different values)"
    return FormatError(
        "time_constant",
        f"{source}: {many} of the {rows} time stamps are equal ({value:.6g}); a spreadsheet has probably "
        "rounded them. Export the file again without opening it in a spreadsheet, or give rate_hz in the "
        "manifest.",
        sensor=device,
    )
