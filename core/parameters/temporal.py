"""Strides → temporal parameters, per stride and per side.

Definitions: spec/field.md §4b. Percentages are of the stride. A step belongs to the foot that lands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from core.events.result import Stride, Strides
from core.frames import SIDES
from core.parameters.result import Parameter
from core.parameters.variability import summary

Column = tuple[float | None, ...]


def _stance(s: Stride) -> float | None:
    return None if s.tc_s is None else s.tc_s - s.start_s


def _swing(s: Stride) -> float | None:
    return None if s.tc_s is None else s.end_s - s.tc_s


def _step(s: Stride) -> float | None:
    return None if s.opposite_ic_s is None else s.end_s - s.opposite_ic_s


def _initial_double(s: Stride) -> float | None:
    return None if s.opposite_tc_s is None else s.opposite_tc_s - s.start_s


def _terminal_double(s: Stride) -> float | None:
    # a foot that leaves before the other lands runs: there is no double support to measure
    if s.tc_s is None or s.opposite_ic_s is None or s.tc_s < s.opposite_ic_s:
        return None
    return s.tc_s - s.opposite_ic_s


def _double(s: Stride) -> float | None:
    initial, terminal = _initial_double(s), _terminal_double(s)
    return None if initial is None or terminal is None else initial + terminal


def _single(s: Stride) -> float | None:
    if s.opposite_tc_s is None or s.opposite_ic_s is None:
        return None
    return s.opposite_ic_s - s.opposite_tc_s


_PHASES: Final[Mapping[str, Callable[[Stride], float | None]]] = {
    "stance": _stance,
    "swing": _swing,
    "initial_double_support": _initial_double,
    "terminal_double_support": _terminal_double,
    "double_support": _double,
    "single_support": _single,
}

NAMES: Final[tuple[str, ...]] = (
    "stride_time_s",
    "step_time_s",
    "stance_time_s",
    "stance_pct",
    "swing_time_s",
    "swing_pct",
    "initial_double_support_s",
    "initial_double_support_pct",
    "terminal_double_support_s",
    "terminal_double_support_pct",
    "double_support_s",
    "double_support_pct",
    "single_support_s",
    "single_support_pct",
)
"""Per-side parameters in the order of the tables."""


def stride_values(stride: Stride) -> dict[str, float | None]:
    """Temporal parameters of one stride by name (`NAMES`), s or % of the stride; None where undefined."""
    values: dict[str, float | None] = {"stride_time_s": stride.duration_s, "step_time_s": _step(stride)}
    for phase, measure in _PHASES.items():
        seconds = measure(stride)
        values[f"{phase}_time_s" if phase in ("stance", "swing") else f"{phase}_s"] = seconds
        values[f"{phase}_pct"] = None if seconds is None else 100.0 * seconds / stride.duration_s
    return values


def per_stride(strides: Strides) -> dict[str, Column]:
    """Columns of the stride table, one entry per stride of the list (counted or not), in its order."""
    rows = [stride_values(s) for s in strides.strides]
    return {name: tuple(row[name] for row in rows) for name in NAMES}


def temporal(strides: Strides) -> tuple[Parameter, ...]:
    """Temporal parameters over the counted strides of each side, and the cadence of both.

    Returns
    -------
    mean and sd (n − 1) over strides; without a value a reason: "no_strides", "no_terminal_contact",
    "opposite_foot_missing", "no_double_support" (a flight phase).
    """
    parameters: list[Parameter] = []
    steps: list[float] = []
    for side in SIDES:
        used = strides.used(side)
        rows = [stride_values(s) for s in used]
        for name in NAMES:
            values = [v for row in rows if (v := row[name]) is not None]
            reason = None if values else _missing(name, used)
            parameters.append(summary(name, side, values, "%" if name.endswith("_pct") else "s", reason))
            if name == "step_time_s":
                steps.extend(values)
    parameters.append(_cadence(steps, strides))
    return tuple(parameters)


def _missing(name: str, used: Sequence[Stride]) -> str:
    """Why a parameter has no value on a side."""
    if not used:
        return "no_strides"
    if name.startswith(("stance", "swing")):
        return "no_terminal_contact"
    if all(s.opposite_ic_s is None for s in used) or name.startswith("step"):
        return "opposite_foot_missing"
    if all(s.tc_s is None for s in used) and not name.startswith(("initial", "single")):
        return "no_terminal_contact"
    return "no_double_support"


def _cadence(steps: Sequence[float], strides: Strides) -> Parameter:
    """60 / mean step time of both feet; its sd to first order, 60 sd / mean², and its interval inverted."""
    if not steps:
        reason = "opposite_foot_missing" if strides.used() else "no_strides"
        return Parameter("cadence_spm", None, 0, None, None, "steps/min", reason)
    step = summary("step_time_s", None, steps, "s")
    mean, low, high = float(np.mean(steps)), step.ci_low, step.ci_high
    return replace(
        step,
        name="cadence_spm",
        unit="steps/min",
        mean=60.0 / mean,
        sd=None if step.sd is None else 60.0 * step.sd / mean**2,
        # two wildly different steps say nothing about how few a minute may have
        ci_low=None if high is None or low is None or low <= 0.0 else 60.0 / high,
        ci_high=None if high is None or low is None or low <= 0.0 else 60.0 / low,
    )
