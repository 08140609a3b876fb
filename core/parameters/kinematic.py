"""JointAngles and Strides → curves over the gait cycle and the parameters read from them.

A curve has 101 points, 0 to 100 % from initial contact to the next of the same foot, by linear interpolation.
The windows of the parameters are those of the reference table (core/norms/data), so that both have the same
meaning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import chain
from typing import Final

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.events.result import Strides
from sagittal.core.frames import FOOT, SIDES, SUFFIX, Bools, Floats, Oriented, Segment, Side
from sagittal.core.parameters.catalogue import CATALOGUE, CurveFigure, find_entry, list_curve_figures
from sagittal.core.parameters.plausible import IMPOSSIBLE, LEAST_KNEE
from sagittal.core.parameters.resample import resample_in_turn
from sagittal.core.parameters.result import CycleCurves, MeanCurve, Parameter
from sagittal.core.parameters.rows import Column, as_column
from sagittal.core.parameters.stance import foot_pitches
from sagittal.core.parameters.variability import summarise_values

POINTS: Final = 101
"""Points of a curve: 0, 1, … 100 % of the cycle."""

MEAN_ZERO: Final = ("pelvis_rotation", "foot_progression")
"""Variables whose zero is their own mean over each stride: they have a shape and no level."""


def is_level(name: str) -> bool:
    """Whether the parameter is a joint angle level, not a range, and thus depends on the standing posture."""
    entry = find_entry(name)
    return entry is not None and entry.curve is not None and entry.curve.statistic != "range"


NO_STANDING: Final = "no_standing"
"""Reason of a level where nobody stood still: the angle has a range and no zero."""

AT_BOUND: Final = "at_bound"
"""Reason of a figure that is the end of what an estimator allows in most strides."""

BOUND_DEG: Final = 0.2
"""A leg at its full length leaves the knee within this of straight (core/body/l7s/poses.py)."""

MOST: Final = 0.5
"""Share of the counted strides at the bound beyond which neither a figure nor a point of a curve is told."""

FOOT_PITCH: Final = ("foot_pitch_ic_deg", "foot_pitch_tc_deg")
"""Sole to floor at the contacts, toes up positive, 0 at standing."""


def cycle_curves(angles: JointAngles, strides: Strides) -> CycleCurves:
    """Cut angles into gait cycles.

    Pelvis angles appear once per side, over that side's cycles; obliquity is positive with that side up.
    Pelvic rotation (that side forward) and foot progression (toes in) are relative to their own mean over the
    stride: they have no level relative to the walking direction (`MEAN_ZERO`). Strides with missing samples
    of the angle are rows of NaN, as are those with an anatomically impossible knee extension (`LEAST_KNEE`).
    """
    curves: dict[str, dict[Side, Floats]] = {}

    def keep(cycles: CycleCurves, variable: str, side: Side, rows: Floats) -> None:
        curves.setdefault(variable, {})[side] = rows

    return replace(read_cycles(angles, strides, keep), curves=curves)


def measure_cycles(
    angles: JointAngles, strides: Strides
) -> tuple[CycleCurves, dict[str, dict[Side, Floats]]]:
    """Metadata of the curves of `cycle_curves`, and their `stride_figures`.

    The curves themselves are discarded once read and are not included: for an hour they are as large as its
    signals.
    """
    figures, values_by_figure = list_curve_figures(), dict[str, dict[Side, Floats]]()

    def read(cycles: CycleCurves, variable: str, side: Side, rows: Floats) -> None:
        for name, figure in figures.items():
            if figure.variable == variable:
                values_by_figure.setdefault(name, {})[side] = _read_figure(figure, rows)

    cycles = read_cycles(angles, strides, read)
    return cycles, {name: values_by_figure[name] for name in figures if name in values_by_figure}


def read_cycles(
    angles: JointAngles,
    strides: Strides,
    take: Callable[[CycleCurves, str, Side, Floats], None],
) -> CycleCurves:
    """Pass every curve of `cycle_curves` to `take`, which can keep or discard it.

    Parameters
    ----------
    take : called with the metadata, variable, side and curve (strides, 101), rad.

    Returns
    -------
    The metadata of the curves.
    """
    stride_columns = strides.columns
    foot_off = 100.0 * (stride_columns.tc_s - stride_columns.start_s) / stride_columns.duration_s
    ends: dict[str, dict[Side, float]] = {}
    reasons = _tell_withheld(angles.withheld)
    cycles = CycleCurves(
        curves={},
        stride_index={side: tuple(own.tolist()) for side, own in stride_columns.of.items()},
        used={side: stride_columns.counted[own] for side, own in stride_columns.of.items()},
        foot_off_pct={side: foot_off[own] for side, own in stride_columns.of.items()},
        why=reasons,
        bounds=ends,
        zero=angles.zero,
    )
    for side in SIDES:
        own = stride_columns.of[side]
        bounds = np.stack((stride_columns.start_s[own], stride_columns.end_s[own]), axis=1)
        names = _name_variables(angles.angles, side)
        courses = {
            variable: angles.headings[segment]
            for segment, variable in (("pelvis", "pelvis_rotation"), (FOOT[side], "foot_progression"))
            if segment in angles.headings
        }
        signals = chain(courses.values(), (angles.angles[name] for name in names))
        rows = resample_in_turn(signals, angles.t_s, bounds, POINTS)
        for variable, row in zip(courses, rows):  # noqa: B905 - the angles follow
            row -= row[:, :-1].mean(axis=1, keepdims=True)
            take(cycles, variable, side, np.negative(row, out=row) if side == "left" else row)
        for (name, base), row in zip(names.items(), rows, strict=True):
            sign = -1.0 if name == "pelvis_obliquity" and side == "left" else 1.0
            # from the mean of walking nobody knows where straight is
            if base == "knee_flexion" and angles.zero == "standing":
                least = LEAST_KNEE - np.radians(angles.standing_deg.get(name, 0.0))
                torn = (row < least).any(axis=1)
                row = np.where(torn[:, None], np.nan, row)
                if torn.any():
                    reasons.setdefault(base, {})[side] = IMPOSSIBLE
            row *= sign
            if name in angles.bounds:
                ends.setdefault(base, {})[side] = angles.bounds[name]
            take(cycles, base, side, row)
    return cycles


def _tell_withheld(withheld: Mapping[str, str]) -> dict[str, dict[Side, str]]:
    """Variable → side → reason for suppression."""
    reasons: dict[str, dict[Side, str]] = {}
    for name, reason in withheld.items():
        base, _, suffix = name.rpartition("_")
        own_sides = [s for s in SIDES if SUFFIX[s] == suffix]
        for side in own_sides or SIDES:
            reasons.setdefault(base if own_sides else name, {})[side] = reason
    return reasons


def _name_variables(angles: Iterable[str], side: Side) -> dict[str, str]:
    """Angle → variable, for the angles of one side and those without a side."""
    names = {}
    for name in angles:
        base, _, suffix = name.rpartition("_")
        if suffix == SUFFIX[side]:
            names[name] = base
        elif suffix not in SUFFIX.values():
            names[name] = name
    return names


def mean_curve(curves: CycleCurves, variable: str, side: Side) -> MeanCurve:
    """Mean curve of the counted strides of a side; strides with gaps in this variable are omitted.

    There is no value where more than half of them are at the bound of a leg model, as for the parameters.
    Cached per curves object: panels and scores request the same ones.
    """
    key = variable, side
    if key not in curves.means:
        curves.means[key] = _mean_curve(curves, variable, side)
    return curves.means[key]


def _mean_curve(curves: CycleCurves, variable: str, side: Side) -> MeanCurve:
    rows = curves.curves.get(variable, {}).get(side)
    if rows is None:
        return MeanCurve(None, None, 0)
    rows = rows[curves.used[side] & np.isfinite(rows).all(axis=1)]
    n = len(rows)
    if not n:
        return MeanCurve(None, None, 0)
    mean, sd = rows.mean(axis=0), None
    if n > 1:
        # to the bit what `std` gives, which would find the mean again
        off = rows - mean
        off *= off
        sd = np.sqrt(off.sum(axis=0) / (n - 1))
    if side in curves.bounds.get(variable, {}):
        held = rest_at_bound(curves, variable, side, rows).mean(axis=0) > MOST
        mean = np.where(held, np.nan, mean)
        sd = None if sd is None else np.where(held, np.nan, sd)
    return MeanCurve(mean, sd, n)


def rest_at_bound(curves: CycleCurves, variable: str, side: Side, angle: Floats) -> Bools:
    """Whether an angle in rad, of any shape, is at the bound of a leg model and not measured."""
    bound = curves.bounds.get(variable, {}).get(side)
    if bound is None:
        return np.zeros(angle.shape, np.bool_)
    return np.asarray(np.abs(angle - bound) < np.radians(BOUND_DEG), np.bool_)


def stride_figures(
    curves: CycleCurves, figures: Mapping[str, CurveFigure] | None = None
) -> dict[str, dict[Side, Floats]]:
    """Angle parameters of every stride: name → side → (strides,) degrees, NaN where undefined.

    Parameters
    ----------
    figures : name → statistic to read from the curves; None = those of the catalogue.
    """
    values: dict[str, dict[Side, Floats]] = {}
    for name, figure in (list_curve_figures() if figures is None else figures).items():
        for side, rows in curves.curves.get(figure.variable, {}).items():
            values.setdefault(name, {})[side] = _read_figure(figure, rows)
    return values


def _read_figure(figure: CurveFigure, rows: Floats) -> Floats:
    """A parameter (strides,) in degrees from curves (strides, 101) in rad."""
    if not len(rows):
        return np.empty(0)
    part = rows[:, figure.start_pct : figure.end_pct + 1]
    if figure.statistic == "at":
        return np.asarray(np.degrees(part[:, 0]))
    # the largest of the radians is the largest of the degrees
    if figure.statistic == "min":
        return np.asarray(np.degrees(part.min(axis=1)))
    most = np.degrees(part.max(axis=1))
    return np.asarray(most if figure.statistic == "max" else most - np.degrees(part.min(axis=1)))


def foot_pitch(
    orientations: Oriented, strides: Strides, pitch: Mapping[Segment, Floats] | None = None
) -> dict[str, dict[Side, Floats]]:
    """Pitch of the foot at IC and TC of every stride: name → side → (strides,) degrees, NaN if undefined.

    Parameters
    ----------
    pitch : from `foot_pitches`, if already computed.
    """
    values: dict[str, dict[Side, Floats]] = {name: {} for name in FOOT_PITCH}
    for foot, angle in (foot_pitches(orientations) if pitch is None else pitch).items():
        side: Side = "left" if foot == FOOT["left"] else "right"
        own, degrees = strides.columns.of[side], np.degrees(angle)
        for name, times in zip(FOOT_PITCH, (strides.columns.start_s, strides.columns.tc_s), strict=True):
            values[name][side] = np.interp(times[own], orientations.t_s, degrees)
    return values


def turning_angle(strides: Strides) -> dict[str, dict[Side, Floats]]:
    """Heading change of the foot over every stride: name → side → (strides,) degrees, left positive."""
    turned = np.degrees(strides.columns.turn_rad)
    return {"turning_angle_deg": {side: turned[own] for side, own in strides.columns.of.items()}}


def summarise_angles(
    curves: CycleCurves, measured: Mapping[str, Mapping[Side, Floats]] | None = None
) -> tuple[Parameter, ...]:
    """Angle parameters over the counted strides of each side, degrees.

    Parameters
    ----------
    measured : values from `measure_cycles`, `foot_pitch` and `turning_angle`; None = those of the curves.

    Returns
    -------
    Parameters; without a value a reason: "joint_missing" (a segment has no sensor), "no_strides", "gap",
    "at_bound" (in most strides), "no_standing" (levels in a recording without quiet standing),
    "estimator_bad", "impossible".
    """
    read = list_curve_figures()
    figures: dict[str, Mapping[Side, Floats]] = {name: {} for name in read}
    figures |= stride_figures(curves) if measured is None else measured
    parameters = []
    for side in SIDES:
        used = curves.used[side]
        for name, sides in figures.items():
            variable = read[name].variable if name in read else name
            suppression = curves.why.get(variable, {}).get(side)
            if side not in sides:
                reason = suppression or "joint_missing"
                values = np.empty(0)
            elif curves.zero == "walking" and is_level(name):
                reason, values = NO_STANDING, np.empty(0)
            else:
                reason = (suppression or "gap") if used.any() else "no_strides"
                used_values = sides[side][used]
                resting = _at_bound(curves, name, side, used_values)
                if np.count_nonzero(resting) > MOST * len(used_values):
                    reason, used_values = AT_BOUND, used_values[:0]
                values = used_values[np.isfinite(used_values)]
            parameters.append(summarise_values(name, side, values, "deg", reason))
    return tuple(parameters)


def _at_bound(curves: CycleCurves, name: str, side: Side, values: Floats) -> Bools:
    """Whether values (strides,) in degrees are at the bound of a leg model and not measured."""
    entry = CATALOGUE.get(name)
    figure = None if entry is None else entry.curve
    if figure is None or figure.statistic == "range":
        return np.zeros(len(values), np.bool_)
    return rest_at_bound(curves, figure.variable, side, np.radians(values))


def without_bounds(
    curves: CycleCurves, figures: Mapping[str, Mapping[Side, Floats]]
) -> dict[str, dict[Side, Floats]]:
    """The same values (strides,), NaN in strides in which they are at the bound of a leg model or are
    levels of angles without a zero.
    """
    level = [name for name in figures if curves.zero == "walking" and is_level(name)]
    return {
        name: {
            s: np.where((name in level) | _at_bound(curves, name, s, x), np.nan, x) for s, x in sides.items()
        }
        for name, sides in figures.items()
    }


def per_stride_figures(strides: Strides, figures: Mapping[str, Mapping[Side, Floats]]) -> dict[str, Column]:
    """Columns of the stride table, one entry per stride of the list in its order, from values per side."""
    columns: dict[str, Column] = {}
    for name, sides in figures.items():
        column = np.full(len(strides.strides), np.nan)
        for side, values in sides.items():
            column[strides.columns.of[side]] = values
        columns[name] = as_column(column)
    return columns
