"""Unit of a time column, from its name and its steps."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from sagittal.core.errors import ManifestError
from sagittal.core.formats.clocks.step import find_packets
from sagittal.core.formats.source_spec import TIME_UNITS
from sagittal.core.frames import Floats

RATES: Final = (20.0, 2000.0)
"""Rates of inertial sensors, Hz: the unit of a clock is the one that gives such a rate."""
_LEAST: Final = 1e-12
"""A shorter step is none."""
_ROWS: Final = 5000
"""Rows by which the step is measured."""
_NAMED: Final = re.compile(
    r"(?:^|[\s_.\-(\[])(?P<unit>s|sec|secs|seconds|ms|msec|millis|milliseconds|us|µs|usec|micros|microseconds|ns|nanos|"
    r"nanoseconds)[\])]?(?:[_\s]elapsed)?$",
    re.IGNORECASE,
)
_UNITS: Final = {"s": "s", "m": "ms", "u": "us", "µ": "us", "n": "ns"}
_DAY: Final = 86_400.0


def read_unit(column: str) -> str | None:
    """The unit that the name of a column ends with."""
    match = _NAMED.search(column)
    if match is None:
        return None
    word = match["unit"].lower()
    if word.startswith(("mi", "ms")):
        return "us" if word.startswith("mic") else "ms"
    return _UNITS[word[0]]


def measure_step(values: Floats) -> float | None:
    """Usual step from row to row of a column, in its own unit; None where it does not count."""
    finite_values = values[np.isfinite(values)][:_ROWS]
    if len(finite_values) < 3 or np.ptp(finite_values) < _LEAST:
        return None
    step = find_packets(finite_values).step
    return step if step and step > _LEAST else None


def find_tick(column: str, values: Floats, rate_hz: float | None, source: str) -> float:
    """Length of the column's unit in s, for columns without a declared unit.

    Raises
    ------
    ManifestError `unit_missing`: no known unit gives the rate of an inertial sensor.
    """
    step = measure_step(values)
    named = read_unit(column)
    if step is None:
        return TIME_UNITS[named or "s"]
    fitting = _fitting(step, rate_hz)
    if named in fitting or (named is not None and not fitting):
        return TIME_UNITS[named]
    if fitting:
        return TIME_UNITS[fitting[0]]
    if RATES[0] <= 1.0 / (step * _DAY) <= RATES[1]:
        return _DAY  # days, as spreadsheets count them
    if rate_hz is not None:
        return 1.0 / (rate_hz * step)
    raise ManifestError(
        "unit_missing",
        f"{source}: column '{column}' advances by {step:g} from row to row, which in s, ms, µs or ns is no "
        "rate of a motion sensor. Give time_unit as the length of one tick in seconds, for example 0.0001.",
    )


def check_tick(column: str, values: Floats, unit: str, source: str) -> None:
    """Refuse a declared unit that cannot be where another one can.

    Raises
    ------
    ManifestError `wrong_time_unit`.
    """
    step = measure_step(values)
    if step is None:
        return
    rate = 1.0 / (step * TIME_UNITS[unit])
    fitting = _fitting(step, None)
    if not 0.25 * RATES[0] <= rate <= 5.0 * RATES[1] and fitting:
        alternative = fitting[0]
        raise ManifestError(
            "wrong_time_unit",
            f"{source}: column '{column}' in '{unit}' would mean {rate:.3g} rows per second; "
            f"in '{alternative}' it is {1.0 / (step * TIME_UNITS[alternative]):.4g}. Correct time_unit.",
        )


def _fitting(step: float, rate_hz: float | None) -> list[str]:
    """Units that give the rate of a sensor, or the declared one to 20 %."""
    low, high = RATES if rate_hz is None else (0.8 * rate_hz, 1.25 * rate_hz)
    return [unit for unit, scale in TIME_UNITS.items() if low <= 1.0 / (step * scale) < high]
