"""Strides → temporal parameters, per stride and per side.

Definitions: docs/science/phases-and-regularity.md, "Times". Percentages are of the stride. A step belongs to
the foot that lands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from sagittal.core.events.result import Stride, Strides, list_known
from sagittal.core.frames import SIDES, Floats
from sagittal.core.parameters.catalogue import CATALOGUE, unit_of
from sagittal.core.parameters.plausible import IMPOSSIBLE, is_impossible
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import Column, as_column
from sagittal.core.parameters.variability import summarise_values


def stride_values(stride: Stride) -> dict[str, float | None]:
    """Temporal parameters of one stride by name, s or % of the stride; None if undefined."""
    return {name: list_known(x)[0] for name, x in temporal_values(Strides((stride,))).items()}


def per_stride(strides: Strides) -> dict[str, Column]:
    """Columns of the stride table, one entry per stride of the list (counted or not), in its order."""
    return {name: as_column(x) for name, x in possible_values(temporal_values(strides)).items()}


def temporal_values(strides: Strides) -> dict[str, Floats]:
    """Temporal parameters (strides,) by name, s or % of the stride; NaN if undefined."""
    columns = strides.columns
    start, tc, end, opposite_tc, opposite_ic = (
        columns.start_s, columns.tc_s, columns.end_s, columns.opposite_tc_s, columns.opposite_ic_s
    )  # fmt: skip
    initial = opposite_tc - start
    # a foot that leaves before the other lands runs: there is no double support to measure
    terminal = np.where(tc >= opposite_ic, tc - opposite_ic, np.nan)
    stride = end - start
    phases = {
        "stance_time": tc - start,
        "swing_time": end - tc,
        "initial_double_support": initial,
        "terminal_double_support": terminal,
        "double_support": initial + terminal,
        "single_support": opposite_ic - opposite_tc,
    }
    values = {"stride_time_s": stride, "step_time_s": end - opposite_ic}
    for phase, seconds in phases.items():
        values[f"{phase}_s"] = seconds
        values[f"{phase.removesuffix('_time')}_pct"] = 100.0 * seconds / stride
    return values


def possible_values(times_by_name: Mapping[str, Floats]) -> dict[str, Floats]:
    """The same times (strides,), with NaN also for physiologically impossible values."""
    possible = {}
    for name, x in times_by_name.items():
        low, high = CATALOGUE[name].plausible
        possible[name] = x if (low, high) == (-inf, inf) else np.where((x < low) | (x > high), np.nan, x)
    return possible


def summarise_times(strides: Strides) -> tuple[Parameter, ...]:
    """Temporal parameters over the counted strides of each side, and the cadence of both.

    Returns
    -------
    Mean and sd (n − 1) over strides; without a value a reason: "no_strides", "no_terminal_contact",
    "opposite_foot_missing", "no_double_support" (a flight phase).
    """
    parameters: list[Parameter] = []
    times_by_name = temporal_values(strides)
    possible = possible_values(times_by_name)
    steps = []
    for side in SIDES:
        used = strides.columns.used[side]
        for name, column in possible.items():
            values = column[used]
            values = values[~np.isnan(values)]
            missing_reason = None
            if not len(values):
                has_values = not np.isnan(times_by_name[name][used]).all()
                missing_reason = (
                    IMPOSSIBLE if has_values else explain_missing(name, strides.select_used(side))
                )
            parameters.append(summarise_values(name, side, values, unit_of(name), missing_reason))
            if name == "step_time_s":
                steps.append(values)
    all_steps = np.concatenate(steps)
    reason = "opposite_foot_missing" if strides.columns.counted.any() else "no_strides"
    if not len(all_steps) and any(p.reason == IMPOSSIBLE and p.name == "step_time_s" for p in parameters):
        reason = IMPOSSIBLE
    parameters.append(cadence(summarise_values("step_time_s", None, all_steps, "s", reason)))
    return tuple(parameters)


def explain_missing(name: str, used: Sequence[Stride]) -> str:
    """Reason why a parameter has no value over these strides of a side."""
    if not used:
        return "no_strides"
    if name.startswith(("stance", "swing")):
        return "no_terminal_contact"
    if all(s.opposite_ic_s is None for s in used) or name.startswith("step"):
        return "opposite_foot_missing"
    if all(s.tc_s is None for s in used) and not name.startswith(("initial", "single")):
        return "no_terminal_contact"
    return "no_double_support"


def cadence(step: Parameter) -> Parameter:
    """60 / mean step time of both feet; its sd to first order, 60 sd / mean², and the inverted interval."""
    named = replace(step, name="cadence_spm", unit="steps/min")
    if step.mean is None:
        return named
    if is_impossible(named.name, 60.0 / step.mean):
        return summarise_values(named.name, step.side, [], named.unit, IMPOSSIBLE)
    low, high = step.ci_low, step.ci_high
    # two wildly different steps say nothing about how few a minute may have
    has_interval = low is not None and high is not None and low > 0.0
    return replace(
        named,
        mean=60.0 / step.mean,
        sd=None if step.sd is None else 60.0 * step.sd / step.mean**2,
        ci_low=60.0 / high if has_interval and high is not None else None,
        ci_high=60.0 / low if has_interval and low is not None else None,
    )
